"""What blocks and what acts, body by body (THEORY 2, "Which outlines"), each by an argument of its own."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import oracle
import pytest
import shapely
import trimesh
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from optics import affine, emitter, factor, line, mesh, shape
from scipy.spatial.transform import Rotation
from test_physics_shadows import PLANE, tangent_circle

import grimaldi
from grimaldi.reference import arago

LAMP = oracle.Spherical((0, 0, -100))
LIGHTS = {100.0: LAMP, np.inf: PLANE}
ACROSS = line((-30, 0.7, 60), (30, 2, 60), 13)
AXIS = np.array([[0, 0, z] for z in (20.0, 60, 200)])


def disc(radius, z=0.0):
    return shape("disk", affine(radius, at=(0, 0, z)))


def ball(radius, z=0.0):
    return shape("sphere", affine(radius, at=(0, 0, z)))


def box(half, low, high):
    """A box of 2 half[0] by 2 half[1], from z = low to high."""
    return shape("cube", affine((*half, (high - low) / 2), at=(0, 0, (high + low) / 2)))


def spot(solid, radius, z, z1):
    """M on the axis at `AXIS` behind a disc or ball in the plane z, the light z1 before z = 0: its rim's C e^{ikΔ}."""
    offset = 0.0
    if solid is ball:
        radius, offset = arago.tangent_circle(radius, z1 + z)
    return arago.kirchhoff(radius, AXIS[:, 2] - z + offset, 1, z1 + z - offset)


# -------------------------------------------------------------------------- one behind another


@pytest.mark.parametrize("z1", LIGHTS)
@pytest.mark.parametrize("solids", [(disc, disc), (ball, ball), (disc, ball), (ball, disc)])
def test_before_a_larger_body_on_the_axis(solids, z1):
    """The union acts, if edges bend light but once: of a body before a larger one the larger one's rim alone does."""
    small, large = solids
    computed = factor(LIGHTS[z1], AXIS, small(5, -40), large(9, -10), tolerance=1e-5, occlusion="binary")
    np.testing.assert_allclose(computed, spot(large, 9, -10, z1), rtol=0, atol=1e-5)


@pytest.mark.parametrize("z1", LIGHTS)
@pytest.mark.parametrize("solids", [(disc, disc), (ball, ball), (disc, ball), (ball, disc)])
def test_receivers_between_two_bodies(solids, z1):
    """Bodies behind the receiver do nothing but what turns back: M - 1 = (1/2π) ∮ C e^{ikΔ} dφ, none from a sheet."""
    before, after = solids
    points = line((-6, 1, 60), (8, 2, 60), 8)
    alone = factor(LIGHTS[z1], points, before(3), tolerance=1e-5)
    both = factor(LIGHTS[z1], points, before(3), after(12, 120), tolerance=1e-5)
    back = np.zeros(len(points), complex)
    if after is ball:
        rim = oracle.circle_edge(tangent_circle((0, 0, 120), 12, LIGHTS[z1]))
        back = oracle.edge_wave(LIGHTS[z1], points, rim, 1, np.ones((len(points), len(rim.x)), bool))
        assert 1e-4 < abs(back).max() < 0.02
    np.testing.assert_allclose(both, alone + back, rtol=0, atol=1e-5)


@pytest.mark.parametrize("z", [-20, 20, 120])
def test_a_ball_anywhere_along_the_ray(z):
    """Eq. 5 literally: a ball behind the lamp, between it and the receivers, behind them; n = 0 but for the second."""
    light = oracle.Spherical((0, 0, 0))
    rim = oracle.circle_edge(tangent_circle((0, 0, z), 4, light))
    if z == 20:
        expected = 1 - oracle.edge_factor(light, ACROSS, rim, 1)
    else:
        expected = 1 + oracle.edge_wave(light, ACROSS, rim, 1, np.ones((len(ACROSS), len(rim.x)), bool))
    assert abs(expected - 1).max() > 5e-4
    computed = factor(light, ACROSS, ball(4, z), tolerance=1e-5)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-5)


# --------------------------------------------------------------------------- rings and sheets


def ring(inner, outer, n=256):
    """A flat ring of 2n triangles, whose two polygons have the areas of their circles."""
    angle = 2 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1) * np.sqrt(2 * np.pi / n / np.sin(2 * np.pi / n))
    i, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([np.stack([i, j, n + j], 1), np.stack([i, n + j, n + i], 1)])
    return np.concatenate([inner * circle, outer * circle]), faces


@pytest.mark.parametrize("z1", LIGHTS)
def test_a_ring_on_its_axis(tmp_path, z1):
    """Two rims: M = 1 + C e^{ikΔ} of the outer one - C e^{ikΔ} of the inner one."""
    computed = factor(LIGHTS[z1], AXIS, mesh(tmp_path / "ring.obj", *ring(5, 9)), tolerance=1e-5)
    np.testing.assert_allclose(computed, 1 + spot(disc, 9, 0, z1) - spot(disc, 5, 0, z1), rtol=0, atol=1e-5)


@pytest.mark.parametrize("z1", LIGHTS)
def test_a_ring_is_the_difference_of_two_discs(tmp_path, z1):
    """Babinet: what a ring stops is what the outer hole passes and the inner one does not."""
    inner, outer = (
        factor(LIGHTS[z1], ACROSS, outlines=[grimaldi.PlanarOutline.ellipse(affine(radius))], tolerance=1e-5)
        for radius in (5, 9)
    )
    computed = factor(LIGHTS[z1], ACROSS, mesh(tmp_path / "ring.obj", *ring(5, 9)), tolerance=1e-5)
    np.testing.assert_allclose(computed, 1 - (outer - inner), rtol=0, atol=1e-5)


def test_a_sheet_is_a_thin_box():
    """A box of thickness h about the plane of a sheet differs from it by O(h)."""
    light = oracle.Spherical((3, -2, -40))
    sheet = factor(light, ACROSS, shape("rectangle", affine((9, 6, 1))), tolerance=1e-6)
    thickness = np.array([1, 0.5, 0.25, 0.125])
    found = [abs(factor(light, ACROSS, box((9, 6), -h / 2, h / 2), tolerance=1e-6) - sheet).max() for h in thickness]
    assert np.polyfit(np.log(thickness), np.log(found), 1)[0] == pytest.approx(1, abs=0.05)
    assert found[-1] < 0.05 * thickness[-1]


# -------------------------------------------------------------------------- inner and outer edges


@settings(max_examples=12, deadline=None, derandomize=True, phases=[Phase.generate])
@given(st.tuples(*[st.floats(-3, 3)] * 3), st.sampled_from([*LIGHTS]))
def test_the_edges_with_nothing_behind_them_close(turn, z1):
    """(1/2π)∮dφ over them is 1 where the ray meets the body, else 0; edges before the body itself may end freely."""
    solid = trimesh.creation.torus(7, 3, major_sections=48, minor_sections=24)
    vertices = np.asarray(solid.vertices) @ Rotation.from_rotvec(turn).as_matrix().T
    light = LIGHTS[z1]
    with TemporaryDirectory() as folder:
        body = mesh(Path(folder) / "torus.obj", vertices, solid.faces)
        found = grimaldi.outline({"type": "scene", "light": emitter(light), "body": body})
        lit = factor(light, ACROSS, body, diffraction="none")
    outer = np.isinf(found.behind)
    away = np.array([0, 0, 1.0]) if isinstance(light, oracle.Plane) else ACROSS - [0, 0, -z1]
    away = np.broadcast_to(away / np.linalg.norm(away, axis=-1, keepdims=True), ACROSS.shape)
    start, end = (x[outer] - ACROSS[:, None] for x in (found.start, found.end))
    q0, q1 = (x - np.einsum("pij,pj->pi", x, away)[..., None] * away[:, None] for x in (start, end))
    turns = np.arctan2(np.einsum("pij,pj->pi", np.cross(q0, q1), away), (q0 * q1).sum(axis=-1)).sum(axis=1) / (
        2 * np.pi
    )
    np.testing.assert_allclose(turns, 1 - lit.real, rtol=0, atol=2e-5)


# ------------------------------------------------------------------------------------- rooms


CORNERS = np.array([[64, y, z] for y in (-64, -63.9999, 0, 64) for z in (-64, 5, 63.9)], float)


@pytest.mark.parametrize("at", [(0, 0, 0), (20, -30, 10)])
@pytest.mark.parametrize("room", ["cube", "sphere", "icosphere"])
def test_an_empty_convex_room(tmp_path, room, at):
    """Walls that face the lamp send no wave to each other: M = 1 on them, into the corners, and between them."""
    if room == "icosphere":
        solid = trimesh.creation.icosphere(subdivisions=2, radius=64)
        walls, on = mesh(tmp_path / "room.obj", solid.vertices, solid.faces[:, ::-1]), solid.triangles_center[::11]
    else:
        walls = shape(room, affine(64), flip_normals=True)
        on = CORNERS if room == "cube" else 64 * CORNERS / np.linalg.norm(CORNERS, axis=1, keepdims=True)
    points = np.concatenate([on, 0.4 * on])
    np.testing.assert_allclose(factor(oracle.Spherical(at), points, walls), 1, rtol=0, atol=1e-12)


def prism(plan, half):
    """Vertices and outward faces of the plan (n, 2) in x and z, from y = -half to half."""
    n = len(plan)
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(plan)))
    corners = np.array([shapely.get_coordinates(part)[:3] for part in parts])
    floor = np.argmin(np.linalg.norm(corners[:, :, None] - plan, axis=-1), axis=-1)
    i, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([floor, floor[:, ::-1] + n, np.stack([i, j, n + j], 1), np.stack([i, n + j, n + i], 1)])
    vertices = np.concatenate([np.insert(plan, 1, y, axis=1) for y in (-half, half)])
    solid = trimesh.Trimesh(vertices, faces, process=False)
    trimesh.repair.fix_normals(solid)
    return np.array(solid.vertices), np.array(solid.faces)


def test_round_the_corner_of_a_room(tmp_path):
    """In an L-shaped room 3,000 high the one edge that stands out shades the far wall as a half plane's does."""
    half = 1500.0
    plan = np.array([[0, 0], [200, 0], [200, 400], [80, 400], [80, 200], [0, 200]], float)
    vertices, faces = prism(plan, half)
    light = oracle.Spherical((30, 0, 60))
    wall = line((82, 0, 400), (199, 0, 400), 40)
    screen = [[80, -half, 200], [80, half, 200], [-half, half, 200], [-half, -half, 200]]
    expected = 1 - oracle.edge_factor(light, wall, oracle.polygon_edge(screen, 2000), 1)
    assert abs(expected).min() < 0.1
    computed = factor(light, wall, mesh(tmp_path / "room.obj", vertices, faces[:, ::-1]), tolerance=1e-4)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=5e-4)


# ----------------------------------------------------------------------------------- on a floor

SLANT = {
    "lamp": oracle.Spherical((-60, -35, 80)),
    "sun": oracle.Plane(np.array([0.6, 0.3, -0.742]) / np.linalg.norm([0.6, 0.3, -0.742])),
}


def on_the_floor(beside):
    """Receivers (n, 3) in z = 0 that are not under the box of half widths `beside`."""
    points = np.c_[np.random.default_rng(0).uniform(-40, 40, (150, 2)), np.zeros(150)]
    foot = np.array([[s * (beside[0] + gap), 0.3, 0] for s in (-1, 1) for gap in (0.02, 0.1, 1)])
    return np.concatenate([points[(abs(points[:, :2]) > np.array(beside) + 1e-3).any(axis=1)], foot])


@pytest.mark.parametrize("light", SLANT)
def test_a_box_on_a_floor(light):
    """What is under the floor does not matter: a box that stands on it and one that is sunk into it are the same."""
    floor = shape("rectangle", affine((300, 300, 1)))
    points = on_the_floor((8, 6))
    stands, sunk, less = (
        factor(SLANT[light], points, box((8, 6), low, 10), floor, tolerance=1e-4) for low in (0, -10, -1)
    )
    assert abs(sunk).min() < 0.2
    np.testing.assert_allclose(stands, sunk, rtol=0, atol=1e-4)
    np.testing.assert_allclose(less, sunk, rtol=0, atol=1e-4)


@pytest.mark.parametrize("light", SLANT)
def test_a_floor_sends_no_ripples_from_its_border(light):
    """The size of the floor does not matter on it, neither alone nor with a ball that rests on it."""
    points = on_the_floor((1, 1))
    resting = ball(5, 5)
    np.testing.assert_allclose(factor(SLANT[light], points, shape("rectangle", affine(60))), 1, rtol=0, atol=1e-12)
    none, small, large = (
        factor(SLANT[light], points, resting, *floor, tolerance=1e-4)
        for floor in ([], [shape("rectangle", affine(60))], [shape("rectangle", affine(600))])
    )
    assert abs(none).min() < 0.2
    np.testing.assert_allclose(small, none, rtol=0, atol=2e-4)
    np.testing.assert_allclose(large, none, rtol=0, atol=2e-4)
