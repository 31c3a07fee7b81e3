"""The scenes of the benchmarks, as dictionaries for `grimaldi.load`: made anew from a seed, at any size.

Lengths are in scene units; light falls along `LIGHT`, amplitude 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.scene.builtin.bench import film, transform
from grimaldi.scene.triangles import as_mesh
from grimaldi.variants import ensure_variant

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

LIGHT = (0.3, 0.2, -1.0)
FLOOR = -10.0  # height of the receiving floor; bodies float about z = 0
WAVELENGTH = 0.02  # the first fringe on the floor takes √(λ·10) = 0.45
VIEW = 16.0  # width of the floor that the camera sees, about its middle

RADIUS = 1.0  # of a body
CELL = 16.0  # area of the layer for each
SPLIT = 5  # parts of an icosahedron's edges: 500 faces, 33 silhouette edges on the average
GOLDEN = np.pi * (3 - np.sqrt(5))


def bodies(n: int, *, seed: int = 0, size: int = 256, spp: int = 4, joined: bool = False) -> dict[str, Any]:
    """n bodies of one mesh and size floating in a layer of constant density over a floor, all in one light.

    The camera sees the same piece of floor whatever n, under the middle of the layer; the bodies of n are the first n
    of any more.

    Args:
        n: bodies, each of 500 faces and about 33 silhouette edges.
        seed: of their places and turns.
        size: pixels of each side of the film.
        spp: samples a pixel.
        joined: put all into one mesh in place of a shape each.
    """
    vertices, faces = icosphere(SPLIT)
    centres = layer(n, seed)
    turned = np.einsum("nij,vj->nvi", rotations(n, seed), RADIUS * vertices) + centres[:, None]
    if joined:
        shifted = faces + len(vertices) * np.arange(n)[:, None, None]
        shapes = {"bodies": _mesh("bodies", turned.reshape(-1, 3), shifted.reshape(-1, 3))}
    else:
        shapes = {f"body-{i}": _mesh(f"body-{i}", x, faces) for i, x in enumerate(turned)}
    return _over_floor(shapes, float(np.abs(centres[:, :2]).max()), size, spp)


def box(split: int, *, seed: int = 0, size: int = 256, spp: int = 4) -> dict[str, Any]:
    """A turned box of 12 split² triangles over the floor: whatever `split`, its outline is the same six lines."""
    vertices, faces = divided(*_cuboid(), split)
    turned = vertices * [4.0, 3.0, 2.0] @ rotations(1, seed)[0].T
    return _over_floor({"box": _mesh("box", turned, faces)}, 2.7, size, spp)


def floor_points(n: int, seed: int = 0) -> Reals:
    """n points (n, 3) at random on the floor that the camera sees."""
    points = np.full((n, 3), FLOOR)
    points[:, :2] = np.random.default_rng(seed).uniform(-VIEW / 2, VIEW / 2, (n, 2))
    return points


def layer(n: int, seed: int) -> Reals:
    """Centres (n, 3): a sunflower's spiral, of one density everywhere, with each place shifted at random."""
    i = np.arange(n)
    radius, angle = np.sqrt(CELL / np.pi * (i + 0.5)), GOLDEN * i
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)], axis=1)
    return places + np.random.default_rng([seed, 0]).uniform(-0.7, 0.7, (n, 3)) * RADIUS


def rotations(n: int, seed: int) -> Reals:
    """n rotations (n, 3, 3), uniformly at random."""
    q = np.random.default_rng([seed, 1]).normal(size=(n, 4))
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=1, keepdims=True), 1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def icosphere(split: int) -> tuple[Reals, Integers]:
    """Vertices (n, 3) on the unit sphere and faces (20 split², 3): an icosahedron, its edges in `split` parts each."""
    import trimesh

    solid = trimesh.creation.icosahedron()
    vertices, faces = divided(np.array(solid.vertices), np.array(solid.faces, np.int64), split)
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def divided(vertices: Reals, faces: Integers, split: int) -> tuple[Reals, Integers]:
    """Each face of a mesh as split² flat ones, of edges in `split` equal parts; each vertex is there once."""
    # Places in a face by their distances from one corner along two sides, and the small triangles among them.
    a, b = (index.ravel() for index in np.indices((split + 1, split + 1)))
    a, b = a[a + b <= split], b[a + b <= split]
    place = np.zeros((split + 1, split + 1), np.int64)
    place[a, b] = np.arange(len(a))
    i, j = a[a + b < split], b[a + b < split]
    upright = np.stack([place[i, j], place[i + 1, j], place[i, j + 1]], axis=1)
    i, j = a[a + b < split - 1], b[a + b < split - 1]
    inverted = np.stack([place[i + 1, j], place[i + 1, j + 1], place[i, j + 1]], axis=1)
    small = np.concatenate([upright, inverted])
    parts = np.broadcast_to(np.stack([split - a - b, a, b], axis=1), (len(faces), len(a), 3))
    # A vertex is told by the corners that it lies between and its parts of each: faces that meet there agree on them.
    keys = np.sort(np.where(parts > 0, faces[:, None] * (split + 1) + parts, -1), axis=2).reshape(-1, 3)
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    points = np.einsum("fpk,fkx->fpx", parts / split, vertices[faces]).reshape(-1, 3)[first]
    which = which.reshape(len(faces), -1)
    return points, which[:, small].reshape(-1, 3)


def _cuboid() -> tuple[Reals, Integers]:
    import trimesh

    solid = trimesh.creation.box(extents=[1, 1, 1])
    return np.array(solid.vertices), np.array(solid.faces, np.int64)


def _mesh(name: str, vertices: Reals, faces: Integers) -> Any:
    """A Mitsuba mesh of the current variant, grey."""
    import mitsuba as mi

    ensure_variant("rgb")
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "diffuse"})
    return as_mesh(mi, name, vertices, faces, properties)


def _over_floor(shapes: dict[str, Any], reach: float, size: int, spp: int) -> dict[str, Any]:
    """Shapes, whose shadows reach no further than they do by some, a floor, the light, and a camera below them."""
    T = transform()
    wide = reach + VIEW
    return {
        "type": "scene",
        "light": {"type": "coherent_directional", "direction": list(LIGHT)},
        **shapes,
        "floor": {
            "type": "rectangle",
            "to_world": T().translate([0, 0, FLOOR]).scale([wide, wide, 1]),
            "bsdf": {"type": "diffuse"},
        },
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, FLOOR / 2], [0, 0, FLOOR], [0, 1, 0]).scale([VIEW / 2, VIEW / 2, 1]),
            "film": film(size, size),
            "sampler": {"type": "independent", "sample_count": spp},
        },
    }
