"""The closed forms against each other, against slow integrals, and against published values (THEORY 5)."""

import numpy as np
import oracle
import pytest
from scipy.optimize import minimize_scalar
from scipy.special import j0

from grimaldi.reference import (
    airy,
    arago,
    circle,
    double_edge,
    fresnel_edge,
    half_plane,
    lommel,
    rectangle,
    slit,
    sphere,
    superposition,
    young,
)

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


@pytest.mark.parametrize("z1", [40.0, np.inf])
def test_a_circle_off_its_axis_by_its_area(z1):
    light = LAMP if np.isfinite(z1) else PLANE
    points = np.array([[0, 0, 60], [9, 3, 60], [14, -2, 25], [-30, 5, 7]], float)
    expected = oracle.area_factor(light, points, oracle.disc_area(np.diag([12, 12, 12, 1])), 1)
    np.testing.assert_allclose(circle.kirchhoff_area(12, points, 1, z1), expected, atol=1e-12)


@pytest.mark.parametrize("z1", [2e3, np.inf])
def test_lommel_is_fresnel_s_integral_over_the_disc(z1):
    """M = -iu e^{iv²/2u} ∫_0^1 J0(vt) e^{iut²/2} t dt, by quadrature, on both sides of the rim and on it."""
    a, z2 = 30.0, 3e3
    rho = np.array([0, 5, 29.9, 30, 30.1, 60, 150])
    scale = 2 * np.pi * a * (1 / z1 + 1 / z2)
    u, v = scale * a, scale * rho[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(300)
    t, w = (nodes + 1) / 2, weights / 2
    integral = (w * t * j0(v * t) * np.exp(0.5j * u * t**2)).sum(axis=1)
    expected = -1j * u * np.exp(0.5j * v[:, 0] ** 2 / u) * integral
    np.testing.assert_allclose(lommel.hole(a, rho, z2, 1, z1), expected, atol=1e-12)
    np.testing.assert_allclose(lommel.disc(a, rho, z2, 1, z1), 1 - expected, atol=1e-12)


def test_lommel_on_the_axis_and_at_the_rim():
    assert lommel.hole(30, 0, 3e3, 1) == pytest.approx(complex(circle.fresnel(30, 3e3, 1)), abs=1e-14)
    # A large hole's rim is a straight edge but for terms of order 1/√N = 0.01 of it.
    rho = 1e4 + np.array([-100, 0, 100])
    edge = fresnel_edge.factor(fresnel_edge.parameter(rho - 1e4, 1e4, 1))
    np.testing.assert_allclose(lommel.hole(1e4, rho, 1e4, 1), edge, atol=0.01)


def test_airy_has_the_published_rings():
    first = 1.21967 * np.pi  # sinθ = 1.21967 λ/2a (THEORY 5)
    assert airy.amplitude(first) == pytest.approx(0, abs=1e-5)
    lobe = minimize_scalar(lambda w: -(airy.amplitude(w) ** 2), bounds=(first, 7), method="bounded")
    assert -lobe.fun == pytest.approx(0.017498, abs=1e-6)
    assert airy.encircled(first) == pytest.approx(0.83778, abs=1e-5)
    w = np.linspace(0, first, 20_001)
    share = 0.5 * w * airy.amplitude(w) ** 2  # of the light: ∫_0^∞ of this is 1
    assert np.trapezoid(share, w) == pytest.approx(0.83778, abs=1e-5)


def test_airy_is_the_area_integral_far_away():
    a, z = 8.0, 1e6
    rho = z * np.array([0, 0.02, 0.07, 0.2])
    points = np.stack([rho, 0 * rho, 0 * rho + z], axis=1)
    integral = oracle.area_factor(PLANE, points, oracle.disc_area(np.diag([a, a, a, 1]), 60, 120), 1)
    scale = np.pi * a**2 / z
    # k a²/4s = 1e-4 of the axis' value, and as much of rounding: k z e-16
    np.testing.assert_allclose(airy.factor(a, rho, z, 1) / scale, integral / scale, atol=2e-4)


def test_slits():
    x, z2 = np.array([-70.0, 0, 3, 49, 200]), 4e4
    # A slit is a rectangle without ends, of which each brings 1/(√2 π v), v = 1e7 √(2/z2).
    tall = rectangle.factor(60, 2e7, x, 0, z2, 1)
    np.testing.assert_allclose(slit.factor(60, x, z2, 1), tall, atol=1e-5)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    t = 30 * nodes
    integral = 30 * (weights * np.exp(1j * np.pi * (t - x[:, None]) ** 2 / z2)).sum(axis=1) / np.sqrt(1j * z2)
    np.testing.assert_allclose(slit.factor(60, x, z2, 1), integral, atol=1e-13)
    two = slit.factor(60, x - 100, z2, 1) + slit.factor(60, x + 100, z2, 1)
    np.testing.assert_allclose(slit.several(2, 60, 200, x, z2, 1), two, atol=1e-15)


def test_several_slits_far_away():
    count, width, spacing, z2 = 5, 10.0, 40.0, 1e8
    sine = np.concatenate([np.linspace(-0.06, 0.06, 25), [1 / spacing, 0.5 / spacing, 1 / (count * spacing)]])
    near = abs(slit.several(count, width, spacing, sine * z2, z2, 1)) ** 2
    near = near / abs(slit.several(count, width, spacing, 0.0, z2, 1)) ** 2
    far = slit.fraunhofer(count, width, spacing, sine, 1)
    # phases π (2 spacing)²/z2 of the outer slits
    np.testing.assert_allclose(near, far, atol=2 * np.pi * (2.5 * spacing) ** 2 / z2)
    assert far[25] == pytest.approx(np.sinc(width / spacing) ** 2)  # a main maximum
    assert far[27] == pytest.approx(0, abs=1e-15)  # and the first zero beside it


def test_two_edges_in_line_are_a_gaussian_orthant():
    """At grazing, 1/4 + arcsin √(z/(d+z))/2π: the double integral is a Gaussian's over a quadrant, turned in phase."""
    for apart, z in ((100.0, 50.0), (10.0, 400.0), (3e4, 20.0)):
        expected = 0.25 + np.arcsin(np.sqrt(z / (z + apart))) / (2 * np.pi)
        assert double_edge.factor(0, 0, apart, 0, z, 1) == pytest.approx(expected, abs=1e-12)


def test_two_edges_by_damped_quadrature():
    """∫ E(t) e^{iπ(t-x)²/λz} dt along the real line, cut off smoothly far from all that is stationary."""
    first, second, apart, z = 3.0, 5.0, 100.0, 300.0
    t, step = np.linspace(-800, second, 400_001, retstep=True)
    window = 0.5 * (1 + np.tanh(1 / (1e-9 + (t + 800) / 400) - 1 / np.maximum(1e-9, 1 - (t + 800) / 400)))
    window = np.where(t > -400, 1.0, 1 - window)
    weights = np.full(len(t), step)
    weights[1:-1:2] *= 4 / 3
    weights[2:-1:2] *= 2 / 3
    weights[[0, -1]] *= 1 / 3
    behind = fresnel_edge.factor(fresnel_edge.parameter(t - first, apart, 1))
    x = np.array([-40.0, -10, 0, 4, 10, 30])
    for at, m in zip(x, double_edge.factor(first, second, apart, x, z, 1), strict=True):
        integral = (weights * window * behind * np.exp(1j * np.pi * (t - at) ** 2 / z)).sum() / np.sqrt(1j * z)
        assert m == pytest.approx(integral, abs=1e-6)


def test_one_of_two_edges_far_outside_leaves_the_other():
    x = np.array([-30.0, -5, 0, 4, 30])
    for (first, second), z, edge in (((3, 3e3), 1100.0, 3), ((3e3, 4), 1000.0, 4)):
        single = fresnel_edge.factor(fresnel_edge.parameter(x - edge, z, 1))
        # 1/(√2 π v) of the far edge, v = 3e3 √(2/1000)
        np.testing.assert_allclose(double_edge.factor(first, second, 100, x, 1000, 1), single, atol=2e-3)


@pytest.mark.parametrize("tilt", [0.0, 0.5, -0.9])
@pytest.mark.parametrize("boundary", ["soft", "hard"])
def test_sommerfeld_solves_the_boundary_value_problem(boundary, tilt):
    """Helmholtz's equation by differences, the condition on both faces, and U0 alone far in the light."""
    k, h = 2 * np.pi, 1e-3

    def u(x, z):
        return half_plane.field(x, z, 1, boundary, tilt)

    x, z = np.array([[1.3, 0.7], [-2, 0.4], [0.4, -1.1], [3, 5], [-0.2, -0.3]]).T
    laplacian = (u(x + h, z) + u(x - h, z) + u(x, z + h) + u(x, z - h) - 4 * u(x, z)) / h**2
    np.testing.assert_allclose(laplacian, -(k**2) * u(x, z), atol=5e-4 * k**2)  # k⁴h²/12 and rounding
    face = np.array([0.02, 0.6, 4.0])
    for side in (-1e-9, 1e-9):
        if boundary == "soft":
            np.testing.assert_allclose(u(face, side), 0, atol=1e-6)
        else:
            slope = (4 * u(face, 1e3 * side) - u(face, 2e3 * side) - 3 * u(face, side)) / (2e3 * side)
            np.testing.assert_allclose(slope / k, 0, atol=1e-3)
    far = np.exp(1j * k * (-1e7 * np.sin(tilt) + 10 * np.cos(tilt)))
    assert u(-1e7, 10.0) == pytest.approx(far, abs=2e-4)


def test_sommerfeld_near_the_shadow_boundary_is_fresnel_s_edge():
    z = 1e6
    v = np.linspace(-2, 2, 9)
    for boundary in ("soft", "hard"):
        m = half_plane.field(v / np.sqrt(2 / z), z, 1, boundary) * np.exp(-2j * np.pi * z)
        np.testing.assert_allclose(m, fresnel_edge.factor(v), atol=1e-3)  # the reflected wave's edge, 1/(2π√(2z))


@pytest.mark.parametrize("boundary", ["soft", "hard", "absorbing"])
def test_partial_waves_meet_the_boundary_condition(boundary):
    a, k, h = 5.0, 2 * np.pi, 1e-4
    theta = np.linspace(0, np.pi, 13)
    ray = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    at, more, most = (sphere.field((a + i * h) * ray, a, 1, boundary) for i in range(3))
    slope = (4 * more - most - 3 * at) / (2 * h)
    condition = {"soft": at, "hard": slope / k, "absorbing": slope / k + 1j * at}[boundary]
    np.testing.assert_allclose(condition, 0, atol=1e-6)


@pytest.mark.parametrize("boundary", ["soft", "hard", "absorbing"])
def test_light_lost_forward_is_what_the_sphere_takes_away(boundary):
    for size in (0.5, 10.0, 200.0):
        extinction, scattering = sphere.cross_sections(size, boundary)
        if boundary == "absorbing":
            assert scattering < extinction
        else:
            assert scattering == pytest.approx(extinction, rel=1e-12)
    # Small and large spheres: 4, 7(ka)⁴/9 and, of the absorbing one, 4 of πa²; then 2 and edges' (ka)^{-2/3}.
    small = {"soft": 4.0, "hard": 7 / 9 * 1e-8, "absorbing": 4.0}
    assert sphere.cross_sections(0.01, boundary)[0] == pytest.approx(small[boundary], rel=1e-3)
    assert sphere.cross_sections(1000.0, boundary)[0] == pytest.approx(2, abs=0.03)


@pytest.mark.parametrize(("size", "ratios"), [(50, (19, 2.7, 1.6, 1.1)), (200, (290, 6.5, 2.4, 1.2))])
def test_a_black_disc_against_an_absorbing_sphere(size, ratios):
    """THEORY 2, "How good a black screen is", to its two digits."""
    a = size / (2 * np.pi)
    for distance, ratio in zip((2, 5, 10, 50), ratios, strict=True):
        exact = abs(sphere.field([[0, 0, distance * a]], a, 1, "absorbing")[0]) ** 2
        assert abs(arago.kirchhoff(a, distance * a, 1)) ** 2 / exact == pytest.approx(ratio, rel=0.04)
