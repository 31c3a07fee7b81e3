"""Meshes of smooth bodies converge to the bodies with the square of their edge length, away from the rim.

A chord lies h²/8ρ inside of its curve, and Δ is off by as much times the turn of the path. That the outline also
steps by O(h) along the light, from facet to facet, counts only by 1 - cosγ: source and receivers are far enough here.
"""

from __future__ import annotations

import numpy as np
import oracle
import pytest
import trimesh
from optics import affine, factor, mesh, shape
from scipy.spatial.transform import Rotation

LIGHT = oracle.Spherical((3, -2, -600))
TURN = Rotation.from_rotvec((0.3, 0.5, 0.1)).as_matrix()
INSIDE = np.random.default_rng(1).uniform(-1, 1, (20, 2)) * 35
POINTS = np.c_[INSIDE, np.full(len(INSIDE), 600.0)]
RADIUS = 8.0
TUBE = {"p0": [-1, -9, 0], "p1": [2, 8, 1], "radius": 4.0}


def icosphere(n):
    return trimesh.creation.icosphere(subdivisions=n, radius=RADIUS)


def uv_sphere(n):
    return trimesh.creation.uv_sphere(radius=RADIUS, count=[4 * 2**n // 2 + 2, 8 * 2**n // 2 + 4])


def tube(n):
    """An open tube of 6·2ⁿ faces round, between p0 and p1."""
    p0, p1 = np.array(TUBE["p0"]), np.array(TUBE["p1"])
    x = np.cross(p1 - p0, (0, 0, 1.0))
    x /= np.linalg.norm(x)
    y = np.cross(p1 - p0, x) / np.linalg.norm(p1 - p0)
    count = 6 * 2**n
    angle = 2 * np.pi * (np.arange(count)[:, None] + 0.5) / count  # the light touches the middle of a face
    ring = TUBE["radius"] * (np.cos(angle) * x + np.sin(angle) * y)
    i, j = np.arange(count), (np.arange(count) + 1) % count
    faces = np.concatenate([np.stack([i, j, count + j], 1), np.stack([i, count + j, count + i], 1)])
    return trimesh.Trimesh(np.concatenate([p0 + ring, p1 + ring]), faces, process=False)


def errors(path, meshes, exact, **options):
    """Root of the mean |M - exact|² over the receivers (n,)."""
    bodies = (mesh(path, part.vertices, part.faces) for part in meshes)
    fields = [factor(LIGHT, POINTS, body, tolerance=1e-5, **options) for body in bodies]
    return np.array([np.sqrt((abs(field - exact) ** 2).mean()) for field in fields])


def order(steps, found):
    return np.polyfit(np.log(steps), np.log(found), 1)[0]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("kind", [icosphere, uv_sphere])
def test_meshed_spheres_converge_to_the_sphere(tmp_path, kind, turned):
    """|M_mesh - M| = O(h²), h the mean edge length."""
    exact = factor(LIGHT, POINTS, shape("sphere", affine(RADIUS)), tolerance=1e-6)
    meshes = [kind(n) for n in (1, 2, 3, 4)]
    if turned:
        for part in meshes:
            part.apply_transform(affine(1, turn=TURN))
    found = errors(tmp_path / "ball.obj", meshes, exact)
    assert order([part.edges_unique_length.mean() for part in meshes], found) == pytest.approx(2, abs=0.25)
    assert found[-1] < 2e-3


def test_meshed_tubes_converge_to_the_cylinder(tmp_path):
    """|M_mesh - M| = O(h²), h the width of a face; what hides parts of the rims adds steps, and is left out."""
    exact = factor(LIGHT, POINTS, shape("cylinder", affine(1), **TUBE), tolerance=1e-6, occlusion=False)
    found = errors(tmp_path / "tube.obj", [tube(n) for n in range(1, 5)], exact, occlusion=False)
    assert order(0.5 ** np.arange(1, 5), found) == pytest.approx(2, abs=0.25)


def test_a_finely_meshed_tube_hides_the_same_as_the_cylinder(tmp_path):
    """X→P along a wall is told as finely for the cylinder, 150 radii away, as for its faces."""
    exact = factor(LIGHT, POINTS, shape("cylinder", affine(1), **TUBE), tolerance=1e-5)
    assert errors(tmp_path / "tube.obj", [tube(6)], exact)[0] < 2e-3


def test_meshed_tori_converge_to_the_finest(tmp_path):
    """|M_mesh - M| = O(h²); the finest of 192 × 96 faces stands for the torus, which adds (1/8)² at most."""
    tori = [trimesh.creation.torus(7, 2, major_sections=2 * n, minor_sections=n) for n in (6, 12, 24, 96)]
    finest = factor(LIGHT, POINTS, mesh(tmp_path / "finest.obj", tori[-1].vertices, tori[-1].faces), tolerance=1e-6)
    found = errors(tmp_path / "torus.obj", tori[:-1], finest)
    assert order([4, 2, 1], found) == pytest.approx(2, abs=0.25)
