"""The closed forms against each other, against slow integrals, and against published values (THEORY 5)."""

import numpy as np
import oracle
import pytest
from scipy.optimize import minimize_scalar

from grimaldi.reference import arago, circle, fresnel_edge, rectangle, superposition, young

AXIS = np.array([[0.0, 0.0, 60.0]])
PLANE = oracle.Plane((0, 0, 1))
LAMP = oracle.Spherical((0, 0, -40))
OBLIQUE = oracle.Spherical((3, -2, -40))
RECEIVERS = np.array([[x, 0.7, 60.0] for x in np.linspace(-40, 40, 9)] + [[2, -0.7, 25], [-30, 5, 7]])
CONCAVE = np.array([[-10, -9, 0], [11, -8, 0], [2, 1, 0], [9, 12, 0], [-12, 10, 0]])


def intensity(v):
    return abs(fresnel_edge.factor(v)) ** 2


def test_straight_edge_has_the_published_extrema():
    assert intensity(0.0) == pytest.approx(0.25, abs=1e-15)
    maximum = minimize_scalar(lambda v: -intensity(v), bounds=(-1.5, -0.5), method="bounded")
    minimum = minimize_scalar(intensity, bounds=(-2.2, -1.5), method="bounded")
    assert (maximum.x, -maximum.fun) == pytest.approx((-1.21720, 1.37044), abs=2e-5)
    assert (minimum.x, minimum.fun) == pytest.approx((-1.87252, 0.77825), abs=2e-5)
    assert fresnel_edge.factor(-1e6) == pytest.approx(1, abs=1e-6)
    assert fresnel_edge.factor(1e6) == pytest.approx(0, abs=1e-6)


def test_circle_on_axis():
    # a = 0.5 m, λ = 2.2 µm, z = 5 km: I = 4 sin²(πN/2)
    assert abs(circle.fresnel(0.5, 5e3, 2.2e-6)) ** 2 == pytest.approx(3.3097215, abs=1e-7)
    # Report figure 2: a = 7000/6 λ, z = 10000/6 λ, Kirchhoff against Fresnel.
    assert abs(circle.kirchhoff(7000 / 6, 1e4 / 6, 1)) ** 2 == pytest.approx(1.7215, abs=5e-5)
    assert abs(circle.fresnel(7000 / 6, 1e4 / 6, 1)) ** 2 == pytest.approx(3.0, abs=1e-9)
    to_world = np.diag([12, 12, 12, 1])
    for source, z1 in ((PLANE, np.inf), (LAMP, 40.0)):
        integral = oracle.area_factor(source, AXIS, oracle.disc_area(to_world), 1)
        assert circle.kirchhoff(12, 60, 1, z1) == pytest.approx(integral[0], abs=1e-12)
    # Both agree where the paraxial phase error k a⁴/8z³ is small: 2e-5 here.
    assert circle.kirchhoff(30, 3e3, 1) == pytest.approx(complex(circle.fresnel(30, 3e3, 1)), abs=1e-4)


def test_disc_on_axis():
    blocked = 1 - oracle.area_factor(LAMP, AXIS, oracle.disc_area(np.diag([12, 12, 12, 1])), 1)
    assert arago.kirchhoff(12, 60, 1, 40) == pytest.approx(blocked[0], abs=1e-12)
    # Kirchhoff and Rayleigh-Sommerfeld part by C² = (1 + cosθ)²/4 against cos²θ.
    cosine = 60 / np.hypot(60, 12)
    assert abs(arago.kirchhoff(12, 60, 1)) ** 2 == pytest.approx((1 + cosine) ** 2 / 4)
    assert arago.rayleigh_sommerfeld(12, 60) == pytest.approx(cosine**2)


def test_rays_touch_the_sphere_on_its_tangent_circle():
    rho, offset = arago.tangent_circle(8, 40)
    touch, source = np.array([rho, 0, -offset]), np.array([0, 0, -40])
    assert np.linalg.norm(touch) == pytest.approx(8)
    assert touch @ (touch - source) == pytest.approx(0, abs=1e-12)
    assert arago.tangent_circle(8, np.inf) == (8, 0)


@pytest.mark.parametrize(("source", "z1"), [(oracle.Spherical((0, 0, -1e5)), 1e5), (PLANE, np.inf)])
def test_rectangle(source, z1):
    x, y = np.array([[0, 0], [40, 10], [100, 0], [130, -70]], float).T
    # Seen from the source, the points of the plane at z2 = 4e4 whose rays cross at x, y.
    z2 = 4e4
    receivers = np.stack([x * (1 + z2 / z1), y * (1 + z2 / z1), 0 * x + z2], axis=1)
    integral = oracle.area_factor(source, receivers, oracle.square_area(np.diag([100, 60, 1, 1])), 1)
    # k b⁴/8z³ = 1e-4 for b = 265
    np.testing.assert_allclose(rectangle.factor(200, 120, x, y, z2, 1, z1), integral, atol=1e-4)


@pytest.mark.parametrize("source", [OBLIQUE, oracle.Plane((0.6, 0, 0.8))])
def test_the_edge_integral_is_the_area_integral(source):
    disc = np.diag([12, 12, 12, 1])
    ellipse = np.array([[9, 4, 0, 1], [-2, 7, 3, 2], [1, 2, 5, -3], [0, 0, 0, 1]], float)
    for area, edge in (
        (oracle.disc_area(disc, 150, 300), oracle.circle_edge(disc)),
        (oracle.disc_area(ellipse, 150, 300), oracle.circle_edge(ellipse)),
        (oracle.polygon_area(CONCAVE, order=120), oracle.polygon_edge(CONCAVE)),
        (oracle.polygon_area(CONCAVE[::-1], order=120), oracle.polygon_edge(CONCAVE[::-1])),
    ):
        by_area = oracle.area_factor(source, RECEIVERS, area, 1)
        by_edge = oracle.edge_factor(source, RECEIVERS, edge, 1)
        np.testing.assert_allclose(by_edge, by_area, atol=1e-11)


def test_square_and_polygon_nodes_agree():
    corners = np.array([[-12, -12, 0], [12, -12, 0], [12, 12, 0], [-12, 12, 0]])
    square = oracle.area_factor(OBLIQUE, RECEIVERS, oracle.square_area(np.diag([12, 12, 1, 1])), 1)
    polygon = oracle.area_factor(OBLIQUE, RECEIVERS, oracle.polygon_area(corners), 1)
    np.testing.assert_allclose(polygon, square, atol=1e-11)


def test_arcs_make_the_circle():
    disc = np.diag([12, 12, 12, 1])
    arcs = oracle.arc_edge(disc, 0, 2, 20_000) + oracle.arc_edge(disc, 2, 2 * np.pi, 20_000)
    whole = oracle.edge_factor(OBLIQUE, RECEIVERS, oracle.circle_edge(disc), 1)
    np.testing.assert_allclose(oracle.edge_factor(OBLIQUE, RECEIVERS, arcs, 1), whole, atol=1e-5)


def test_young_is_the_superposition_of_two_sources():
    wavelength, distance, separation = 1.0, 1e6, 50.0
    spacing = young.fringe_spacing(wavelength, distance, separation)
    assert spacing == 2e4
    x = np.linspace(-2, 2, 33) * spacing
    points = np.stack([x, 0 * x, 0 * x + distance], axis=1)
    sources = [[separation / 2, 0, 0], [-separation / 2, 0, 0]]
    for phase in (0.0, 1.0):
        total = superposition.fields(sources, [1, 1], [0, phase], ["a", "a"], points, wavelength)
        relative = superposition.intensity(total) * (points**2).sum(axis=1)
        expected = young.intensity(x, wavelength, distance, separation, phase)
        # Paraxial: k s x³/2L³ = 0.010, and the two amplitudes differ by s x/2L² = 1e-6.
        np.testing.assert_allclose(relative, expected, atol=0.02)


def test_groups_add_intensities():
    points = np.array([[0, 0, 3.0]])
    sources, amplitudes, phases = [[0, 0, 0]] * 3, [3, 6, 1.5], [0, np.pi, np.pi / 2]
    apart = superposition.fields(sources, amplitudes, phases, ["a", "b", "b"], points, 1)
    assert list(apart) == ["a", "b"]
    assert apart["b"][0] == pytest.approx(-2 + 0.5j)
    assert superposition.intensity(apart)[0] == pytest.approx(1 + 4 + 0.25)
    together = superposition.fields(sources, amplitudes, phases, ["a"] * 3, points, 1)
    assert superposition.intensity(together)[0] == pytest.approx(1 + 0.25)


def test_phases_of_long_paths_are_exact():
    # A path of exactly (1e9 + 1/4) λ has a phase of exactly π/2.
    total = superposition.fields([[0, 0, 0]], [1e9], [0], ["a"], [[1e9 + 0.25, 0, 0]], 1)
    assert np.angle(total["a"][0]) == pytest.approx(np.pi / 2, abs=1e-12)
