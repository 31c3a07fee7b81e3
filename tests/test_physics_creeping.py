"""rim="smooth": edge waves damped as creeping waves, against exact absorbing spheres and literal quadrature."""

import re
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import oracle
import pytest
import trimesh
from optics import affine, factor, mesh, shape
from scipy.spatial import ConvexHull
from scipy.special import eval_legendre, spherical_jn, spherical_yn

import grimaldi
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.creeping import damped
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.segment import Rule, line, segment_wave

PLANE = oracle.Plane((0, 0, 1))
ACROSS = np.linspace(0, 0.98, 99)  # of the shadow's radius
KA = 200.0
LONG = 2 * np.pi  # the wavelength that makes k = 1


def absorbing_sphere(ka, x, z):
    """M (n,) in the plane wave e^{ikz} at (x, z) (n,), in units of the radius, by partial waves.

    u = Σ (2n+1) iⁿ (jₙ(kr) + bₙ hₙ(kr)) Pₙ(z/r) with ∂u/∂r + iku = 0 on the sphere: what comes straight goes in.
    """
    n = np.arange(int(ka + 8 * np.cbrt(ka) + 10))

    def h(t, derivative=False):
        return spherical_jn(n, t, derivative) + 1j * spherical_yn(n, t, derivative)

    b = -(spherical_jn(n, ka, True) + 1j * spherical_jn(n, ka)) / (h(ka, True) + 1j * h(ka))
    r = np.hypot(x, z)
    scattered = [
        ((2 * n + 1) * 1j ** (n % 4) * b * h(ka * q) * eval_legendre(n, c)).sum() for q, c in zip(r, z / r, strict=True)
    ]
    return 1 + np.array(scattered) * np.exp(-1j * ka * z)


def test_the_reference_radiates_what_its_cross_section_takes():
    """By the optical theorem: σ_ext = (4π/k) Im f(0) → 2πa², half of it absorbed; here from M far ahead."""
    z = np.array([1e7])
    f = (absorbing_sphere(KA, 0 * z, z) - 1) * z  # u_s = f e^{ikr}/r, in radii
    assert (4 * np.pi / KA * f.imag)[0] == pytest.approx(2 * np.pi, rel=0.05)


RIMS = ("sharp", "smooth")


def rms(a, b):
    return np.sqrt(np.mean((abs(a) ** 2 - abs(b) ** 2) ** 2))


def of_the_documentation(table):
    """Rows of a table of docs/limits.md: distance [radii] and two numbers each; `table` is how the head begins."""
    text = (Path(__file__).parents[1] / "docs" / "limits.md").read_text()
    row = re.compile(r"\| \$(\d+)a\$ \| ([\d.]+) \| ([\d.]+) \|")
    return [tuple(map(float, found)) for found in row.findall(text.partition(table)[2].partition("\n\n")[0])]


SHADOWS = of_the_documentation('| distance behind it | `rim="sharp"`')
SPOTS = of_the_documentation("| distance behind it | $ka = 50$")


def test_the_documentation_has_both_tables():
    assert [row[0] for row in SHADOWS] == [2, 5]
    assert [row[0] for row in SPOTS] == [2, 5, 10, 50]


@pytest.mark.parametrize(("distance", "sharp", "smooth"), SHADOWS)
def test_the_shadow_of_an_absorbing_sphere(distance, sharp, smooth):
    z = distance + 0 * ACROSS
    expected = absorbing_sphere(KA, ACROSS, z)
    points = KA * np.stack([0.8 * ACROSS, 0.6 * ACROSS, z], axis=1)
    ball = shape("sphere", affine(KA))
    error = {r: rms(factor(PLANE, points, ball, wavelength=LONG, tolerance=1e-4, rim=r), expected) for r in RIMS}
    assert error["smooth"] == pytest.approx(smooth, abs=1e-3)
    assert error["sharp"] == pytest.approx(sharp, abs=1e-3)


@pytest.mark.parametrize(("distance", "of_50", "of_200"), SPOTS)
def test_the_spot_behind_a_black_disc_and_an_absorbing_sphere(distance, of_50, of_200):
    for ka, times in ((50, of_50), (200, of_200)):
        exact = absorbing_sphere(ka, np.zeros(1), np.array([distance]))
        disc = factor(PLANE, [[0, 0, distance * ka]], shape("disk", affine(ka)), wavelength=LONG, tolerance=1e-4)
        assert (abs(disc) ** 2 / abs(exact) ** 2)[0] == pytest.approx(times, rel=0.05)


DIRECTION = np.array([0.1, 0.2, 1]) / np.linalg.norm([0.1, 0.2, 1])


def spiral(n):
    """Points (n, 3) spread evenly over the unit sphere."""
    i = np.arange(n) + 0.5
    z, turn = 1 - 2 * i / n, np.pi * (1 + np.sqrt(5)) * i
    rho = np.sqrt(1 - z * z)
    return np.stack([rho * np.cos(turn), rho * np.sin(turn), z], axis=1)


# An icosphere has faces exactly along the z axis.
@pytest.mark.parametrize(("kind", "direction"), [("hull", DIRECTION), ("icosphere", np.array([0, 0, 1.0]))])
def test_a_finely_meshed_ball_is_a_ball(kind, direction, tmp_path: Path):
    x = np.cross(direction, [0.3, 0.9, 0.1])
    points = KA * (ACROSS[:, None] * x / np.linalg.norm(x) + 2 * direction)
    if kind == "hull":
        corners = KA * spiral(20_000)
        faces = ConvexHull(corners).simplices
    else:
        ball = trimesh.creation.icosphere(subdivisions=6, radius=KA)
        corners, faces = ball.vertices, ball.faces
    balls = shape("sphere", affine(KA)), mesh(tmp_path / "ball.obj", corners, faces)
    for rim, allowed in (("smooth", 0.01), ("sharp", 0.1)):
        exact, meshed = (factor(oracle.Plane(direction), points, ball, wavelength=LONG, rim=rim) for ball in balls)
        np.testing.assert_allclose(meshed, exact, rtol=0, atol=allowed)


@pytest.mark.parametrize("kind", ["disk", "rectangle", "cube"])
def test_sharp_rims_stay_sharp(kind):
    points = np.stack([30 * ACROSS, 0 * ACROSS, 0 * ACROSS + 60], axis=1)
    body = shape(kind, affine(8))
    sharp, smooth = (
        factor(oracle.Spherical((1, 2, -40)), points, body, rim=rim, tolerance=1e-7) for rim in ("sharp", "smooth")
    )
    np.testing.assert_allclose(smooth, sharp, rtol=0, atol=1e-6)


def outline_of(body, direction=(0.0, 0.0, 1.0)):
    light = {"type": "coherent_directional", "direction": [float(x) for x in direction]}
    scene = grimaldi.load({"type": "scene", "light": light, "body": body})
    return grimaldi.outline(scene, scene.sources[0])


def test_radii_of_curvature(tmp_path: Path):
    """Along a ray at the angle α to its axis a cylinder's is a/sin²α; rims and creases have none."""
    tilt = np.radians(35)
    tube = outline_of(shape("cylinder", affine((5, 5, 40))), (np.sin(tilt), 0, np.cos(tilt)))
    lines = np.linalg.norm(tube.normals[:, 1], axis=1) > 0
    assert 0 < lines.sum() < len(lines)
    np.testing.assert_allclose(tube.radius[lines], 5 / np.sin(tilt) ** 2, rtol=1e-6)
    np.testing.assert_array_equal(tube.radius[~lines], 0)
    np.testing.assert_allclose(outline_of(shape("sphere", affine(3))).radius, 3, rtol=1e-6)
    np.testing.assert_array_equal(outline_of(shape("cube", affine(3)), DIRECTION).radius, 0)
    corners = 3 * spiral(500)
    ball = mesh(tmp_path / "ball.obj", corners, ConvexHull(corners).simplices)
    np.testing.assert_allclose(outline_of(ball, DIRECTION).radius, 3, rtol=0.02)


def test_normals_beside_faces_edge_on_point_outwards(tmp_path: Path):
    """Seen along z an icosphere's outline has faces exactly along the light; their sides are those of the body."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    outline = outline_of(mesh(tmp_path / "ball.obj", ball.vertices, ball.faces))
    middle = 0.5 * (outline.start + outline.end)
    assert (abs(outline.normals[:, :, 2]).min(axis=1) < 1e-12).any()
    assert (np.einsum("ij,ikj->ik", middle, outline.normals) > 0.9).all()
    np.testing.assert_allclose(outline.radius, 1, rtol=0.01)


def literal(source, p, X0, e, length, k, radius):
    """(1/2π) ∫ C W e^{ikΔ} dφ by the midpoint rule; γ counts in the plane across the edge's own plane of light."""
    t = (np.arange(100_000) + 0.5) * length / 100_000
    X = X0 + t[:, None] * e
    if isinstance(source, oracle.Plane):
        a = np.asarray(source.direction, float)
        ray, before = np.broadcast_to(a, X.shape), 0.0
    else:
        S = np.asarray(source.position, float)
        a = (p - S) / np.linalg.norm(p - S)
        r = np.linalg.norm(X - S, axis=1)
        ray, before = (X - S) / r[:, None], r - (X - S) @ a
    s = np.linalg.norm(p - X, axis=1)
    d = (p - X) / s[:, None]
    delta = before + s - (p - X) @ a
    q = (X - p) - ((X - p) @ a)[:, None] * a
    cosine = (ray * d).sum(1)
    dphi = np.cross(q, e) @ a / (q * q).sum(1)
    out = np.cross(e, ray)
    into = -(out * d).sum(1) / np.linalg.norm(out, axis=1)
    W = np.exp(-0.75 * np.cbrt(k * radius) * np.arctan2(np.maximum(into, 0), cosine))
    return (0.5 * (1 + cosine) * W * np.exp(1j * k * delta) * dphi).sum() * length / 100_000 / (2 * np.pi)


@pytest.mark.parametrize("light", [oracle.Spherical((0, 0, -80)), PLANE], ids=["point", "plane"])
@pytest.mark.parametrize("radius", [0.0, 20.0, 3000.0])
def test_a_damped_edge_against_quadrature(light, radius):
    """A long edge, aslant, in parts of which each is damped as a whole; receivers on both sides of its shadow's rim."""
    mi.set_variant("llvm_ad_mono")
    t = types(double=True)
    X0, e, length, k = np.array([3.0, -30, 5]), np.array([0.1, 0.95, 0.25]), 70.0, 2 * np.pi
    e = e / np.linalg.norm(e)
    points = np.array([[-20, 2, 40], [30, 5, 60], [4, 0, 50], [-60, 40, 30], [5, 60, 25], [-2, -50, 90]], float)
    if isinstance(light, oracle.Plane):
        a, S = np.tile([0.0, 0, 1], (len(points), 1)), points * [1, 1, 0]
    else:
        S = np.tile(np.asarray(light.position, float), (len(points), 1))
        a = (points - S) / np.linalg.norm(points - S, axis=1, keepdims=True)
    z1 = -(S * a).sum(1)
    foot = S + z1[:, None] * a
    z2 = ((points - foot) * a).sum(1)
    V, F = t.Vector, t.Float

    def computed(parts):
        """All parts of all points in one kernel."""
        point, part = (i.ravel() for i in np.mgrid[: len(points), :parts])
        frame = Frame(
            V(a[point].T), V(foot[point].T), F(z1[point]), F(z2[point]), F(1), isinstance(light, oracle.Plane)
        )
        starts = X0 + (part * length / parts)[:, None] * e
        ln, span = line(frame, V(starts.T), V(np.tile(e, (len(part), 1)).T)), F(np.full(len(part), length / parts))
        wave = segment_wave(frame, ln, span, F(k), Rule.of(1e-7), dr.mask_t(F)(True))
        if radius:
            wave = damped(wave, frame, ln, span, F(radius), F(k))
        return (wave.real.numpy() + 1j * wave.imag.numpy()).reshape(len(points), parts).sum(axis=1) / (2 * np.pi)

    expected = np.array([literal(light, p, X0, e, length, k, radius) for p in points])
    if not radius:
        np.testing.assert_allclose(computed(1), expected, rtol=0, atol=3e-8)
        return
    errors = [abs(computed(parts) - expected).max() for parts in (32, 128)]
    assert errors[1] < 1e-4
    assert errors[0] > 8 * errors[1]  # second order
    undamped = [literal(light, p, X0, e, length, k, 0.0) for p in points]
    assert abs(np.array(undamped) - expected).max() > 0.05
