"""Plane parts of meshes as few triangles: the same solid, the same edges, the same light."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import mitsuba
import numpy as np
import pytest
from numpy.typing import NDArray
from optics import mesh

import grimaldi
from grimaldi.bench.scenes import divided, icosphere
from grimaldi.scene.facets import facets
from grimaldi.scene.model import Facets, Mesh

mitsuba.set_variant("llvm_ad_mono")

Reals = NDArray[np.float64]

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def prism(*loops: list[tuple[float, float]], height: float = 1.0) -> tuple[Reals, NDArray[np.int64]]:
    """A plate with these loops, the first its border and the others holes in it, as few triangles, closed."""
    import shapely

    flat = shapely.constrained_delaunay_triangles(shapely.Polygon(loops[0], loops[1:]))
    places = shapely.get_coordinates(flat).reshape(-1, 4, 2)[:, :3]
    points = [point for loop in loops for point in loop]
    index = np.array([[points.index(tuple(p)) for p in three] for three in places.tolist()])
    u, v = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    index = np.where((u[:, 0] * v[:, 1] > u[:, 1] * v[:, 0])[:, None], index, index[:, ::-1])
    n = len(points)
    walls, first = [], 0
    for number, loop in enumerate(loops):
        turns = shapely.LinearRing(loop).is_ccw == (number == 0)
        here = first + np.arange(len(loop))[:: 1 if turns else -1]
        there = np.roll(here, -1)
        walls += [np.stack([here, there, n + there], axis=1), np.stack([here, n + there, n + here], axis=1)]
        first += len(loop)
    x = np.array([(*p, z) for z in (0.0, height) for p in points])
    return x, np.concatenate([index[:, ::-1], n + index, *walls])


def in_float32(vertices: Reals, faces: NDArray[np.int64]) -> Mesh:
    """As Mitsuba keeps it, turned and moved."""
    return Mesh((vertices @ TURN.T + [3, -2, 1]).astype(np.float32).astype(np.float64), faces)


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def of(mesh: Mesh) -> Facets:
    found = facets(mesh)
    assert found is not None
    return found


SQUARE = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]
HOLE = [(1.0, 1.0), (1.0, 2.0), (3.0, 1.5)]
SOLIDS = {
    "box": ((SQUARE,), 12),
    "L": (([(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.5, 1.0), (1.5, 3.0), (0.0, 3.0)],), 20),
    "window": ((SQUARE, HOLE), 28),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_divided_solid_has_the_triangles_of_the_plain_one(name: str):
    loops, triangles = SOLIDS[name]
    x, faces = prism(*loops)
    fine = in_float32(*divided(x, faces, 8))
    found = of(fine)
    assert len(faces) == triangles == len(found.faces)
    assert volume(found) == pytest.approx(volume(in_float32(x, faces)), rel=1e-6)
    sides = Counter((int(a), int(b)) for face in found.faces for a, b in zip(face, np.roll(face, -1), strict=True))
    assert all(sides[b, a] == count == 1 for (a, b), count in sides.items())  # closed, and wound one way


def test_edges_name_those_of_the_mesh():
    fine = in_float32(*divided(*prism(SQUARE, HOLE), 8))
    found = of(fine)
    face, i = np.divmod(found.edges, 3)
    start, end = (fine.vertices[fine.faces[face, (i + j) % 3]] for j in range(2))
    own = found.vertices[found.faces]
    begins = (start == own).all(2)
    along = np.linalg.norm(np.cross(end - start, np.roll(own, -1, axis=1) - own), axis=2) < 1e-5
    # each of the 21 edges of the solid from both of its sides; the others lie inside of a facet
    assert np.count_nonzero(begins & along) >= 2 * 21
    assert (begins & along).sum(1).min() >= 1


def test_curved_surfaces_stay_as_they_are():
    assert facets(Mesh(*icosphere(40))) is None  # 1.5e-2 rad from face to face: each is level with its neighbours
    x, faces = divided(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]), 300)
    x[:, 2] = 1e-4 * x[:, 0] ** 2  # by less than the rounding from face to face, by more as a whole
    assert facets(Mesh(x, faces)) is None


def test_few_flat_faces_on_a_round_body_stay_too():
    x, faces = icosphere(20)
    x[:, 2] = np.maximum(x[:, 2], -0.9)
    assert facets(Mesh(x, faces)) is None


def test_a_border_of_many_corners_keeps_its_curve():
    """Each corner of the circle is in line with its neighbours; half a turn of them is not in line with its ends."""
    n, rings = 4000, 6
    angle = 2 * np.pi * np.arange(n) / n
    radius = np.linspace(0.5, 1, rings + 1)
    x = np.concatenate([r * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) for r in radius])
    here = (n * np.arange(rings)[:, None] + np.arange(n)).ravel()
    there = (n * np.arange(rings)[:, None] + np.roll(np.arange(n), -1)).ravel()
    faces = np.concatenate([np.stack([here, n + here, n + there], 1), np.stack([here, n + there, there], 1)])
    found = of(in_float32(x, faces))
    assert len(found.faces) > n
    a, b, c = (found.vertices[found.faces[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(0.75 * 0.5 * n * np.sin(2 * np.pi / n), rel=1e-5)


@pytest.mark.parametrize("kind", ["sheet", "solid"])
def test_light_behind_facets_is_that_behind_the_mesh(kind: str, tmp_path: Path):
    x, faces = prism(SQUARE, HOLE)
    if kind == "sheet":
        faces = faces[(x[faces, 2] == 0).all(1)]
    points = np.random.default_rng(0).uniform([-2, -2, -12], [6, 5, -10], (500, 3))

    def field(divisions: int) -> Reals:
        fine = divided(x, faces, divisions)
        scene = grimaldi.load(
            {
                "type": "scene",
                "light": {"type": "coherent_point", "position": [1.0, 2.0, 30.0]},
                "body": mesh(tmp_path / f"{divisions}.obj", *fine),
            }
        )
        assert (scene.bodies[0].facets is not None) == (divisions > 1)
        return grimaldi.field(scene, points, wavelength=0.05, tolerance=1e-5).U.values

    plain = field(1)
    assert np.abs(field(9) - plain).max() <= 1e-5 * np.abs(plain).max()
