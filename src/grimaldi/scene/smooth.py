"""Meshes with vertex normals, divided into the curved surfaces that they stand for.

Each face becomes the cubic Bézier triangle through its three points, perpendicular to their three normals there:
A. Vlachos, J. Peters, C. Boyd, J. L. Mitchell, "Curved PN Triangles", Symposium on Interactive 3D Graphics 2001,
pp. 159-166. Its distance from the surface falls with the fourth power of the edges, a flat face's with the second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.scene.bodies import FLAT, Surface, carries_light, is_aperture, surface, with_shapes
from grimaldi.scene.triangles import as_mesh, check_triangles

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

DEEPEST = 6  # levels: 4096 faces for one
MOST_FACES = 4_000_000  # of one finer mesh
SHARP = 0.1  # sine of the angle between normals at a crease; those nearer to each other count as their mean


def check_levels(levels: object) -> None:
    """Raises InputError for what is no integer from 0 to 6."""
    if not isinstance(levels, int) or isinstance(levels, bool) or not 0 <= levels <= DEEPEST:
        raise InputError(f"smooth: {levels!r} is no number of levels; give an integer from 0 to {DEEPEST}")


def smooth_meshes(mi_scene: Any, levels: int) -> Any:
    """A Mitsuba scene whose meshes with vertex normals are divided into 4^levels curved parts a face.

    All else is shared with `mi_scene`, which is returned itself where nothing bends. Left as they are: flat meshes,
    meshes shaded by their faces (`face_normals`), apertures, and shapes that emitters or sensors sit on.

    Raises InputError where a mesh would have more than 4e6 faces.
    """
    if levels == 0:
        return mi_scene
    before = mi_scene.shapes()
    after = [_smoothed(shape, levels) for shape in before]
    if all(new is old for new, old in zip(after, before, strict=True)):
        return mi_scene
    return with_shapes(mi_scene, after)


def _smoothed(shape: Any, levels: int) -> Any:
    """The finer mesh of a shape that bends, with its BSDF, media, flags and id; any other shape itself."""
    import mitsuba as mi

    coarse = None if is_aperture(shape) or carries_light(shape) else surface(shape)
    if coarse is None:
        return shape
    name = shape.id() or shape.class_name()
    check_triangles(coarse.vertices, coarse.faces, name)
    fine = subdivided(coarse, levels, name)
    if fine is coarse:
        return shape
    props = mi.Properties()
    props["flip_normals"] = shape.has_flipped_normals()
    parts = {"bsdf": shape.bsdf(), "interior": shape.interior_medium(), "exterior": shape.exterior_medium()}
    for key, part in parts.items():
        if part is not None:
            props[key] = part
    mesh = as_mesh(mi, name, fine.vertices, fine.faces, props, normals=fine.normals, uv=fine.uv)
    for key, values in fine.attributes.items():
        mesh.add_attribute(key, values.shape[1], mi.Float(values.astype(np.float32).ravel()))
    mesh.set_id(shape.id())
    return mesh


def subdivided(coarse: Surface, levels: int, place: str = "mesh") -> Surface:
    """A surface with each face divided into 4^levels; itself where all its faces are flat.

    Faces that share an edge share its curve, bit for bit; at a crease, where their normals differ, it is tangent to
    both faces' planes. Normals and all other values are interpolated linearly, the normals at unit length, so that
    shading stays as it was.

    Raises InputError naming the mesh, `place`, where it would have more than 4e6 faces.
    """
    n = 2**levels
    at = _positions(coarse)
    given, coarse = coarse, _without_empty(coarse, at)
    edges = _edges(coarse, at)
    curves = _curves(coarse, edges)
    if curves is None:
        return given
    count = len(coarse.faces) * n * n
    if count > MOST_FACES:
        raise InputError(f"{place}: smooth={levels} makes {count} faces of it, more than {MOST_FACES}; give less")
    lattice = _lattice(n)
    along = _bernstein(np.arange(1, n) / n) @ curves
    inside = lattice.cubic @ _patches(coarse, edges, curves)
    vertices = np.concatenate([coarse.vertices, along[edges.curve].reshape(-1, 3), inside.reshape(-1, 3)])

    def linear(values: Reals) -> Reals:
        t = np.arange(1, n)[:, None] / n
        along = np.concatenate([1 - t, t], axis=1) @ values[edges.ends]
        inside = lattice.weights @ values[coarse.faces]
        return np.concatenate([values, *(x.reshape(-1, values.shape[1]) for x in (along, inside))])

    return Surface(
        vertices,
        faces=_numbers(coarse, edges, lattice, n)[:, lattice.triangles].reshape(-1, 3),
        normals=_unit(linear(coarse.normals)),
        uv=None if coarse.uv is None else linear(coarse.uv),
        attributes={
            name: linear(values) if name.startswith("vertex_") else np.repeat(values, n * n, axis=0)
            for name, values in coarse.attributes.items()
        },
    )


@dataclass(frozen=True, eq=False)
class _Edges:
    """A mesh's edges (e), each in the direction that all edges in its place have."""

    ends: Integers  # (e, 2) vertices
    of_side: Integers  # (m, 3) the edge of each face's side, from corner 0 to 1, 1 to 2, 2 to 0
    forward: NDArray[np.bool_]  # (m, 3) whether that side runs along its edge
    curve: Integers  # (e,) which of the c curves it is: edges of different vertices may lie in one place
    first: Integers  # (c,) an edge of each curve


def _positions(mesh: Surface) -> Integers:
    """A number (n,) for each vertex, the same for those that lie in one place."""
    return np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)[1].reshape(-1)  # -0.0 becomes 0.0


def _without_empty(mesh: Surface, at: Integers) -> Surface:
    """Without faces that have two corners in one place, as at the poles of a sphere: their patches would stick out."""
    corners = at[mesh.faces]
    whole = np.all(corners != np.roll(corners, 1, axis=1), axis=1)
    attributes = {name: x if name.startswith("vertex_") else x[whole] for name, x in mesh.attributes.items()}
    return replace(mesh, faces=mesh.faces[whole], attributes=attributes)


def _edges(mesh: Surface, at: Integers) -> _Edges:
    count = len(mesh.vertices)
    rank = np.empty(count, np.int64)
    rank[np.argsort(at, kind="stable")] = np.arange(count)
    side = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2)
    forward = rank[side[..., 0]] < rank[side[..., 1]]
    side = np.where(forward[..., None], side, side[..., ::-1]).reshape(-1, 2)
    _, one, of_side = np.unique(rank[side[:, 0]] * count + rank[side[:, 1]], return_index=True, return_inverse=True)
    ends = side[one]
    _, first, curve = np.unique(at[ends[:, 0]] * count + at[ends[:, 1]], return_index=True, return_inverse=True)
    return _Edges(ends, of_side.reshape(-1, 3), forward, curve, first)


def _curves(mesh: Surface, edges: _Edges) -> Reals | None:
    """Control points (c, 4, 3) of the cubic curves in the edges' places; None where all are straight.

    Vlachos et al. 2001, section 3.1: b210 = (2 P1 + P2 - w12 N1) / 3, w12 = (P2 - P1)·N1.
    """
    ends = edges.ends[edges.first]
    start, end = np.moveaxis(mesh.vertices[ends], 1, 0)
    chord = end - start
    normals = _unit(mesh.normals)
    tangents = [_tangent(chord, *_two_normals(normals[edges.ends[:, i]], edges)) for i in range(2)]
    reach = np.ptp(mesh.vertices, axis=0).max() + np.abs(mesh.vertices).max()
    if max(np.abs(chord - tangent).max(initial=0) for tangent in tangents) <= FLAT * reach:
        return None
    return np.stack([start, start + tangents[0] / 3, end - tangents[1] / 3, end], axis=1)


def _two_normals(normals: Reals, edges: _Edges) -> tuple[Reals, Reals]:
    """Of the normals (e, 3) at one end of the edges: for each curve that of one edge, and the one most unlike it."""
    one = normals[edges.first]
    cos = np.abs(np.einsum("ij,ij->i", normals, one[edges.curve]))
    order = np.lexsort((cos, edges.curve))
    most = order[np.searchsorted(edges.curve[order], np.arange(len(one)))]
    return one, normals[most]


def _tangent(chord: Reals, one: Reals, two: Reals) -> Reals:
    """The chords (c, 3) projected into the tangent plane at an end; at a crease, onto the line where two planes meet.

    Where that line leads away from the chord the normals tell nothing of the crease, and it is straight there.
    """
    turned = np.where(np.einsum("ij,ij->i", one, two)[:, None] < 0, -two, two)
    line, mean = np.cross(one, turned), _unit(one + turned)
    crease = np.linalg.norm(line, axis=1, keepdims=True) > SHARP
    line = _unit(line)
    on_line = np.einsum("ij,ij->i", chord, line)[:, None] * line
    in_plane = chord - np.einsum("ij,ij->i", chord, mean)[:, None] * mean
    astray = 2 * np.linalg.norm(on_line, axis=1) < np.linalg.norm(chord, axis=1)
    return np.where(crease, np.where(astray[:, None], chord, on_line), in_plane)


def _patches(mesh: Surface, edges: _Edges, curves: Reals) -> Reals:
    """Control points (m, 10, 3): the corners, two beside each corner along the sides, b111 = E + (E - V) / 2."""
    corners = mesh.vertices[mesh.faces]
    sides = curves[edges.curve[edges.of_side]][:, :, 1:3]
    sides = np.where(edges.forward[..., None, None], sides, sides[:, :, ::-1]).reshape(-1, 6, 3)
    e, v = sides.mean(axis=1, keepdims=True), corners.mean(axis=1, keepdims=True)
    return np.concatenate([corners, sides, e + (e - v) / 2], axis=1)


class _Lattice(NamedTuple):
    """The l points of a divided triangle, i of them on no side."""

    steps: Integers  # (l, 3) barycentric weights times n
    inner: NDArray[np.bool_]  # (l,) whether on no side
    weights: Reals  # (i, 3) of the corners
    cubic: Reals  # (i, 10) of the patch's control points
    triangles: Integers  # (n², 3) between the l points


@cache
def _lattice(n: int) -> _Lattice:
    b, c = np.array([(b, c) for c in range(n + 1) for b in range(n + 1 - c)]).T
    steps = np.stack([n - b - c, b, c], axis=1)
    inner = np.all(steps > 0, axis=1)
    weights = steps[inner] / n
    u, v, w = weights.T
    sides = [3 * x for p, q in ((u, v), (v, w), (w, u)) for x in (p * p * q, p * q * q)]
    cubic = np.stack([u**3, v**3, w**3, *sides, 6 * u * v * w], axis=1)

    def at(b: Integers, c: Integers) -> Integers:
        return c * (n + 1) - c * (c - 1) // 2 + b

    upward = steps[:, 0] >= 1
    downward = steps[:, 0] >= 2
    up = [at(b + i, c + j)[upward] for i, j in ((0, 0), (1, 0), (0, 1))]
    down = [at(b + i, c + j)[downward] for i, j in ((1, 0), (1, 1), (0, 1))]
    triangles = np.concatenate([np.stack(up, axis=1), np.stack(down, axis=1)])
    return _Lattice(steps, inner, weights, cubic, triangles)


def _numbers(mesh: Surface, edges: _Edges, lattice: _Lattice, n: int) -> Integers:
    """The finer mesh's vertex (m, l) at each point of each face: the corners come first, then edges, then insides."""
    m, count = len(mesh.faces), len(mesh.vertices)
    result = np.empty((m, len(lattice.steps)), np.int64)
    for corner in range(3):
        result[:, lattice.steps[:, corner] == n] = mesh.faces[:, [corner]]
    step = np.arange(1, n)
    for side in range(3):
        near = lattice.steps[:, side]
        on = np.flatnonzero((lattice.steps[:, side - 1] == 0) & (near > 0) & (near < n))
        on = on[np.argsort(-near[on])]  # from the side's first corner to its second
        along = np.where(edges.forward[:, [side]], step, n - step)
        result[:, on] = count + edges.of_side[:, [side]] * (n - 1) + along - 1
    inside = int(lattice.inner.sum())
    result[:, lattice.inner] = count + len(edges.ends) * (n - 1) + np.arange(m * inside).reshape(m, inside)
    return result


def _bernstein(t: Reals) -> Reals:
    """Weights (n, 4) of a cubic curve's control points at parameters t (n,)."""
    return np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)


def _unit(normals: Reals) -> Reals:
    """At length 1; 0 where there is no direction."""
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, size, out=np.zeros_like(normals), where=size > 0)
