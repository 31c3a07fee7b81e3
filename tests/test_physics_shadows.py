"""Shadows of bodies (eq. 5): edges, discs, spheres, bodies before bodies, surfaces that no shadow reaches."""

import numpy as np
import oracle
import pytest
from optics import GREY, affine, factor, line, shape

import grimaldi
from grimaldi.reference import arago, fresnel_edge

PLANE = oracle.Plane((0, 0, 1))
LAMP = oracle.Spherical((0, 0, -40))
ASIDE = oracle.Spherical((3, -2, -40))
BEHIND = np.concatenate([line((-30, 0.7, 60), (30, 0.7, 60), 17), [[2, -0.7, 25], [-24, 5, 17]]])
EXTREMA = [(0.0, 0.25), (-1.21720, 1.37044), (-1.87252, 0.77825)]


def tangent_circle(centre, radius, light):
    """The outline of a sphere: (4, 4) of the circle along which rays of `light` touch it."""
    centre = np.asarray(centre, float)
    if isinstance(light, oracle.Plane):
        axis, distance = np.asarray(light.direction, float), np.inf
    else:
        axis = centre - np.asarray(light.position, float)
        distance = float(np.linalg.norm(axis))
        axis = axis / distance
    rho, offset = arago.tangent_circle(radius, distance)
    first = np.cross(axis, (0, 1, 0) if abs(axis[1]) < 0.9 else (1, 0, 0))
    first /= np.linalg.norm(first)
    turn = np.stack([first, np.cross(axis, first), axis], axis=1)
    return affine(rho, at=centre - offset * axis, turn=turn)


def square(half, z=0.0):
    x, y = np.broadcast_to(half, 2)
    return np.array([[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]], float)


@pytest.mark.parametrize("z1", [4000.0, np.inf])
@pytest.mark.parametrize("plate", ["outline", "rectangle"])
def test_straight_edge(plate, z1):
    # Of the plate's three far edges, 6.5e4 off, each adds at most C/(2 √(π kΔ)) to M: C is below 1e-2 for
    # the lamp (they turn its light almost back), so 5e-6, but 1/2 for the plane wave, so 2.3e-4. Paraxial
    # terms are of order 1/(kL), 8e-5.
    light, allowed = (oracle.Spherical((0, 0, -z1)), 1e-4) if np.isfinite(z1) else (PLANE, 1e-3)
    z2, size = 4000.0, 65536.0
    v, intensity = np.array(EXTREMA).T
    offset = v / fresnel_edge.parameter(1, z2, 1, z1)
    points = np.stack([offset * (1 + z2 / z1), 0 * v, 0 * v + z2], axis=1)
    if plate == "outline":
        corners = size * np.array([[0, -1], [1, -1], [1, 1], [0, 1]])
        mask = grimaldi.PlanarOutline(corners, hole=False)
        computed = factor(light, points, outlines=[mask], tolerance=1e-6)
    else:
        body = shape("rectangle", affine((size / 2, size, 1), at=(size / 2, 0, 0)))
        computed = factor(light, points, body, tolerance=1e-6)
    np.testing.assert_allclose(abs(computed) ** 2, intensity, rtol=0, atol=allowed)
    np.testing.assert_allclose(computed, fresnel_edge.factor(v), rtol=0, atol=1e-3)


@pytest.mark.parametrize("z1", [40.0, np.inf])
def test_poisson_spot_of_a_disc(z1):
    light = LAMP if np.isfinite(z1) else PLANE
    z = np.array([10.0, 20, 60, 300, 1e4])
    points = np.stack([0 * z, 0 * z, z], axis=1)
    disc = shape("disk", affine(8))
    computed = factor(light, points, disc, tolerance=1e-5)
    np.testing.assert_allclose(computed, arago.kirchhoff(8, z, 1, z1), rtol=0, atol=1e-4)
    computed = factor(light, points, disc, tolerance=1e-7, precision="double")
    np.testing.assert_allclose(computed, arago.kirchhoff(8, z, 1, z1), rtol=0, atol=1e-6)


def test_a_disc_off_axis_is_one_minus_the_hole():
    expected = 1 - oracle.area_factor(ASIDE, BEHIND, oracle.disc_area(affine(8)), 1)
    computed = factor(ASIDE, BEHIND, shape("disk", affine(8)), tolerance=1e-5)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize("z1", [40.0, np.inf])
def test_poisson_spot_of_a_sphere(z1):
    # The model's: the spot of the circle along which the light touches the sphere.
    light = LAMP if np.isfinite(z1) else PLANE
    rho, offset = arago.tangent_circle(8, z1)
    z = np.array([20.0, 60, 300, 1e4])
    computed = factor(light, np.stack([0 * z, 0 * z, z], axis=1), shape("sphere", affine(8)), tolerance=1e-5)
    expected = arago.kirchhoff(rho, z + offset, 1, z1 - offset)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize("light", [ASIDE, PLANE], ids=["point", "plane"])
def test_a_sphere_off_axis_is_its_tangent_circle(light):
    centre = (1, -2, 3)
    circle = tangent_circle(centre, 8, light)
    expected = 1 - oracle.area_factor(light, BEHIND, oracle.disc_area(circle), 1)
    computed = factor(light, BEHIND, shape("sphere", affine(8, at=centre)), tolerance=1e-5)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize("light", [LAMP, PLANE], ids=["point", "plane"])
def test_a_cube_is_its_front_face(light):
    # From z = -40 only the face at z = -8 is lit; its border is the outline. Along z four faces are edge-on.
    expected = 1 - oracle.area_factor(light, BEHIND, oracle.polygon_area(square(8, z=-8)), 1)
    computed = factor(light, BEHIND, shape("cube", affine(8)), tolerance=1e-5)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize("light", [PLANE, oracle.Spherical((9, 2, -40))], ids=["plane", "point"])
def test_a_box_in_light_along_its_walls_is_its_front_face(light):
    """Walls that the light grazes, all four or one, block no wave of the front's border."""
    front = grimaldi.PlanarOutline(square((9, 4))[:, :2], affine(1, at=(0, 0, -2)), hole=False)
    box = shape("cube", affine((9, 4, 2)))
    assert abs(factor(light, [[0, 0, 60]], box)[0]) > 0.1
    computed = factor(light, BEHIND, box, tolerance=1e-5)
    np.testing.assert_allclose(computed, factor(light, BEHIND, outlines=[front], tolerance=1e-5), rtol=0, atol=1e-4)


@pytest.mark.parametrize("side", [-1, 1])
def test_light_that_turns_past_a_wall_moves_its_border_to_the_back(side):
    """The outline has depth: of a wall lit by 1e-5 rad the far border counts, and M is another."""
    light = oracle.Plane((side * 1e-5, 0, 1))
    back = np.array([[9, -4, 2], [9, -4, -2], [-9, -4, -2], [-9, 4, -2], [9, 4, -2], [9, 4, 2]]) * [-side, 1, 1]
    expected = 1 - oracle.edge_factor(light, BEHIND, oracle.polygon_edge(back), 1)
    computed, front = (
        factor(beam, BEHIND, shape("cube", affine((9, 4, 2))), tolerance=1e-5) for beam in (light, PLANE)
    )
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-4)
    assert 0.1 < abs(computed - front).max() < 0.2


@pytest.mark.parametrize("light", [PLANE, LAMP], ids=["plane", "point"])
@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_a_sheet_in_the_plane_of_the_rays_stops_none(kind, light):
    """A sheet seen edge-on has no lit surface: M = 1."""
    upright = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    points = np.concatenate([BEHIND, [[0, 4, 30], [1, 2, 60]]])
    for mirror in (1, -1):
        sheet = shape(kind, affine((6, 5, mirror), turn=upright))
        np.testing.assert_allclose(factor(light, points, sheet), 1, rtol=0, atol=1e-12)


def test_the_lit_side_of_a_sphere_is_undisturbed():
    polar, azimuth = np.meshgrid(np.radians([0, 5, 20, 40, 60, 75]), np.arange(0, 6, 0.7))
    polar, azimuth = polar.ravel(), azimuth.ravel()
    out = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), -np.cos(polar)], 1)
    tolerance = 1e-3
    computed = factor(LAMP, 8 * out, shape("sphere", affine(8)), tolerance=tolerance)
    np.testing.assert_allclose(computed, 1, rtol=0, atol=tolerance)


@pytest.mark.parametrize("kind", ["rectangle", "disk", "cube"])
def test_a_lit_plane_face_is_undisturbed_up_to_its_border(kind):
    x = np.array([0, 3, 20, 40, 63, 63.99])
    points = np.stack([x / np.sqrt(2), x / np.sqrt(2), 0 * x], axis=1)
    floor = shape(kind, affine((64, 64, -64), at=(0, 0, 64 if kind == "cube" else 0)))
    tolerance = 1e-3
    computed = factor(oracle.Spherical((5, -7, -100)), points, floor, tolerance=tolerance)
    np.testing.assert_allclose(computed, 1, rtol=0, atol=tolerance)


def test_a_floor_under_a_sphere():
    light = oracle.Spherical((0, 0, 100))
    centre = (0, 0, 20)
    floor = shape("rectangle", affine((2048, 2048, 1)))
    ball = shape("sphere", affine(4, at=centre))
    circle = tangent_circle(centre, 4, light)
    x = np.concatenate([np.linspace(0, 12, 25), [20, 40, 80, 200, 900]])
    points = np.stack([0.6 * x, 0.8 * x, 0 * x], axis=1)
    expected = oracle.edge_factor(light, points, oracle.circle_edge(circle), 1)
    computed = factor(light, points, ball, floor, tolerance=1e-4)
    np.testing.assert_allclose(computed, 1 - expected, rtol=0, atol=1e-3)
    assert abs(computed[0]) == pytest.approx(1, abs=0.1)
    assert abs(computed[8:10]).max() < 0.5
    np.testing.assert_allclose(computed[-2:], 1, rtol=0, atol=0.01)


@pytest.mark.parametrize("z2", [20.0, 200.0])
def test_across_the_rim_of_a_spheres_shadow(z2):
    # Grazing paths: just inside the rim they run along the sphere's own surface.
    light = oracle.Spherical((0, 0, -80))
    circle = tangent_circle((0, 0, 0), 4, light)
    rim = (80 + z2) * np.tan(np.arcsin(4 / 80))
    x = rim + np.concatenate([np.linspace(-1, 1, 101), np.linspace(-0.01, 0.01, 101)])
    points = np.stack([0.6 * x, 0.8 * x, 0 * x + z2], axis=1)
    expected = 1 - oracle.edge_factor(light, points, oracle.circle_edge(circle), 1)
    computed = factor(light, points, shape("sphere", affine(4)), tolerance=1e-4)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-3)


def test_a_receiver_sees_the_same_whatever_the_others():
    near, far = np.array([[0, 0, 10.0], [3, 2, 20]]), np.array([[0, 0, 1e4], [30, -400, 1e4]])
    disc = shape("disk", affine(8))
    together = factor(PLANE, np.concatenate([near, far]), disc, tolerance=1e-4)
    apart = [factor(PLANE, points, disc, tolerance=1e-4) for points in (near, far)]
    np.testing.assert_allclose(together, np.concatenate(apart), rtol=0, atol=2e-4)


def test_an_arm_before_a_torso():
    light = oracle.Spherical((0, 0, -400))
    torso = shape("cube", affine(32, at=(0, 0, 32)))
    arm = shape("rectangle", affine((2, 20, 1), at=(0, 0, -20)))
    x = np.linspace(-28, 28, 57)
    on_torso = np.stack([x, 0.25 * x, 0 * x], axis=1)
    # On the lit face the torso's own outline is silent: the arm alone casts its shadow there.
    opening = oracle.polygon_edge(square((2, 20), z=-20))
    expected = 1 - oracle.edge_factor(light, on_torso, opening, 1)
    assert abs(expected[28]) < 0.6
    computed = factor(light, on_torso, arm, torso, tolerance=1e-4)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-3)
    # Behind the torso the arm is hidden, whichever way round.
    behind = line((-8, 3, 200), (8, 3, 200), 9)
    alone = 1 - oracle.edge_factor(light, behind, oracle.polygon_edge(square(32)), 1)
    computed = factor(light, behind, arm, torso, tolerance=1e-4)
    np.testing.assert_allclose(computed, alone, rtol=0, atol=1e-3)


def blocked(points, nodes, z, centre, radius):
    """Whether a disc at z stands between each point and node: (points, nodes)."""
    t = (z - nodes[:, 2]) / (points[:, None, 2] - nodes[:, 2])
    crossing = nodes[:, :2] + t[..., None] * (points[:, None, :2] - nodes[:, :2])
    return (t > 1e-9) & (np.linalg.norm(crossing - centre, axis=-1) < radius)


def test_two_discs_side_by_side_at_two_depths():
    light = oracle.Spherical((0, 0, -100))
    places = [(-12, 0, 0), (30, 1, 20)]
    discs = [affine(8, at=place) for place in places]
    points = line((-60, 2, 120), (80, 2, 120), 29)
    wave = sum(oracle.edge_factor(light, points, oracle.circle_edge(disc), 1) for disc in discs)
    hidden = blocked(points, oracle.circle_edge(discs[0], 400).x, 20, places[1][:2], 8)
    assert not hidden.any()
    computed = factor(light, points, *(shape("disk", disc) for disc in discs), tolerance=1e-4)
    np.testing.assert_allclose(computed, 1 - wave, rtol=0, atol=1e-3)


@pytest.mark.parametrize(("radius", "sees_the_rim"), [(6, True), (9, False)])
def test_a_disc_in_the_shadow_of_another(radius, sees_the_rim):
    # The shadow of the near disc is 12 wide at z = 20: no light touches the far one, but on the axis at
    # z = 100 it hides the near rim, which is seen at 8 through its plane, if it is larger.
    light = oracle.Spherical((0, 0, -100))
    near, far = shape("disk", affine(10)), shape("disk", affine(radius, at=(0, 0, 20)))
    computed = factor(light, [[0, 0, 100]], near, far, tolerance=1e-4, occlusion="binary")
    expected = arago.kirchhoff(10, 100, 1, 100) if sees_the_rim else 0
    assert computed[0] == pytest.approx(complex(expected), abs=1e-3)


def test_a_disc_half_in_the_shadow_of_another():
    light = oracle.Spherical((0, 0, -200))
    source = np.array([0, 0, -200.0])
    near, far = affine(10, at=(-6, 0, 0)), affine(10, at=(7, 1, 8))
    rims = oracle.circle_edge(near), oracle.circle_edge(far)
    points = np.array([[-2, 1, 150], [6, 4, 150], [-14, 3, 150], [-40, 5, 150], [45, -7, 150], [3, 40, 150]])
    # Literally eq. 5: what of each rim is lit, what of it each receiver sees, and whether the ray passes.
    lit = ~blocked(source[None], rims[1].x, 0, (-6, 0), 10)[0]
    waves = [
        oracle.edge_wave(light, points, rims[0], 1, ~blocked(points, rims[0].x, 8, (7, 1), 10)),
        oracle.edge_wave(light, points, rims[1], 1, np.broadcast_to(lit, (len(points), len(lit)))),
    ]
    in_shadow = blocked(points, source[None], 0, (-6, 0), 10) | blocked(points, source[None], 8, (7, 1), 10)
    expected = 1.0 - in_shadow[:, 0] + sum(waves)
    computed = factor(light, points, shape("disk", near), shape("disk", far), tolerance=1e-4, occlusion="binary")
    np.testing.assert_allclose(computed, expected, rtol=0, atol=5e-3)


def test_a_lamp_in_the_middle_of_a_room():
    light = oracle.Spherical((0, 0, 0))
    room = {**shape("cube", affine(64)), "flip_normals": True, "bsdf": GREY}
    ball = shape("sphere", affine(2, at=(16, 0, 0)))
    # On the wall behind the ball: its shadow, 8 wide, and the fringes about it.
    y = np.linspace(-30, 30, 61)
    wall = np.stack([0 * y + 64, y, 0.25 * y], axis=1)
    circle = tangent_circle((16, 0, 0), 2, light)
    expected = 1 - oracle.edge_factor(light, wall, oracle.circle_edge(circle), 1)
    computed = factor(light, wall, room, ball, tolerance=1e-4)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-3)
    assert abs(computed[30]) == pytest.approx(1, abs=0.1)
    assert abs(computed[[23, 37]]).max() < 0.6  # the dark ring about the spot
    # On the opposite wall, its corners and edges, only what turns straight back: C = (1 + cosγ)/2 < 0.016.
    opposite = np.array([[-64, y, z] for y in (-64, -60, 0, 31) for z in (-64, 5, 63.5)], float)
    computed = factor(light, opposite, room, ball, tolerance=1e-4)
    np.testing.assert_allclose(computed, 1, rtol=0, atol=0.016)
    # On the walls beside it only the faint wave of the rim, at most 2/(2 √(π kΔ)) with Δ > 12.
    beside = np.array([[x, 64, z] for x in (-60, 0, 30, 60) for z in (-64, 5, 63.5)], float)
    computed = factor(light, beside, room, ball, tolerance=1e-4)
    np.testing.assert_allclose(computed, 1, rtol=0, atol=0.07)
