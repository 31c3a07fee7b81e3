"""Edge waves that graze another body on their way: occlusion "graded" against "binary" and twofold propagation.

The references propagate what one edge leaves from its own plane to the next one, where the second edge cuts it, and
on to the receiver: Fresnel's approximation for half planes, the first Rayleigh-Sommerfeld integral for discs.
"""

import re
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import oracle
import pytest
from optics import affine, factor, mesh, shape
from scipy.spatial import ConvexHull

from grimaldi.diffraction.knife_edge import amplitude
from grimaldi.errors import InputError
from grimaldi.reference import fresnel_edge

LAMP = oracle.Spherical((0, 0, -40))
FAR = 65536.0  # the other edges of a half plane
Z0, Z1, Z2 = 1e4, 5e3, 5e3  # from the source to the first edge, the second, the receivers


def test_the_amplitude_of_a_knife_edge():
    mi.set_variant("llvm_ad_mono")
    v = np.concatenate([np.linspace(0, 8, 2001), np.geomspace(8, 1e3, 200)])
    real, imag = amplitude(dr.llvm.ad.Float64(v))
    expected = fresnel_edge.factor(v) * np.exp(-0.5j * np.pi * v**2)
    np.testing.assert_allclose(real.numpy() + 1j * imag.numpy(), expected, rtol=0, atol=2e-5)


def knife_edges(h1, side, h2):
    """Half planes as plates: x < h1 at z = 0, and x < h2 (side 1) or x > h2 (side -1) at z = Z1."""
    first = shape("rectangle", affine((FAR / 2, FAR, 1), at=(h1 - FAR / 2, 0, 0)))
    second = shape("rectangle", affine((FAR / 2, FAR, 1), at=(h2 - side * FAR / 2, 0, Z1)))
    return first, second


def through_both(h1, side, h2, x):
    """M at (x, 0, Z1 + Z2) behind both: Fresnel's integral over what the second leaves of the first one's field."""
    length = 1 / (1 / (Z0 + Z1) + 1 / Z2)
    y = np.linspace(-1, 1, 40_001) * 60 * np.sqrt(length)  # about the ray, in the second plane
    fade = np.where(abs(y) < y[-1] / 2, 1, np.cos(np.pi * (abs(y) / y[-1] - 0.5)) ** 2)
    kernel = np.sqrt(-1j / length) * np.exp(1j * np.pi * y**2 / length) * fade * (y[1] - y[0])
    result = []
    for ray in x * (Z0 + Z1) / (Z0 + Z1 + Z2):
        before = fresnel_edge.factor(fresnel_edge.parameter(h1 - (ray + y) * Z0 / (Z0 + Z1), Z1, 1, Z0))
        open_ = np.clip(side * (ray + y - h2) / (y[1] - y[0]) + 0.5, 0, 1)  # the cell that the edge cuts counts in part
        result.append((before * open_ * kernel).sum())
    return np.array(result)


def edges_of_the_documentation():
    """Side and place of the second edge, rms errors of the intensity, largest steps: rows of docs/limits.md."""
    row = re.compile(r"\| hides \$x ([<>]) (-?\d+)\$ \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|")
    text = (Path(__file__).parents[1] / "docs" / "limits.md").read_text()
    return [(1 if side == "<" else -1, float(h2), *map(float, rest)) for side, h2, *rest in row.findall(text)]


def test_the_documentation_has_five_pairs_of_edges():
    assert len(edges_of_the_documentation()) == 5


# The first edge lies at x = 0, so that its own shadow begins at 0; what the second hides of it follows from
# similar triangles.
@pytest.mark.parametrize(("side", "h2", "graded", "binary", "step"), edges_of_the_documentation())
def test_two_knife_edges_are_as_far_off_as_the_documentation_says(side, h2, graded, binary, step):
    x = np.linspace(-300, 400, 281)
    points = np.stack([x, 0 * x, 0 * x + Z1 + Z2], axis=1)
    expected = through_both(0, side, h2, x)
    slope = abs(np.diff(expected)).max()
    error, steps = {}, {}
    for occlusion in ("graded", "binary"):
        m = factor(
            oracle.Spherical((0, 0, -Z0)),
            points,
            *knife_edges(0, side, h2),
            tolerance=1e-4,
            precision="double",
            occlusion=occlusion,
        )
        error[occlusion] = np.sqrt(np.mean((abs(m) ** 2 - abs(expected) ** 2) ** 2))
        steps[occlusion] = abs(np.diff(m)).max()
    assert error["graded"] == pytest.approx(graded, rel=0.05, abs=1e-4)
    assert error["binary"] == pytest.approx(binary, rel=0.05)
    assert steps["graded"] < 1.2 * slope
    assert steps["binary"] == pytest.approx(step, rel=0.05)


def test_no_step_where_an_edge_passes_behind_another_nor_in_its_own_shadows_rim():
    """On a grid so fine that |dM/dx| times the spacing is 1e-3 of what `binary` jumps by."""
    light = oracle.Spherical((0, 0, -Z0))
    for x0 in (0.0, 100.0):  # the rim of the first edge's shadow; where the second begins to hide it
        x = x0 + np.linspace(-0.05, 0.05, 21)
        points = np.stack([x, 0 * x, 0 * x + Z1 + Z2], axis=1)
        m = factor(light, points, *knife_edges(0, -1, 50), tolerance=1e-4, precision="double")
        assert abs(np.diff(m)).max() < 1e-3
    jump = factor(light, points, *knife_edges(0, -1, 50), tolerance=1e-4, precision="double", occlusion="binary")
    assert abs(np.diff(jump)).max() > 0.05


@pytest.mark.parametrize("radius", [6.5, 8.0, 9.0, 10.0, 11.0])
def test_a_disc_behind_a_disc(radius):
    """On their axis, where the whole rim acts at once, even a curved edge behind a curved one."""
    light, k = oracle.Spherical((0, 0, -100)), 2 * np.pi
    rho = np.linspace(0, 120, 6001)
    plane = np.stack([rho, 0 * rho, 0 * rho + 20], axis=1)
    field = factor(light, plane, shape("disk", affine(10)), tolerance=1e-4) * light.wave(plane, k)[0]
    s = np.hypot(rho, 80)
    kernel = (1 / s - 1j * k) * np.exp(1j * k * s) * 80 / s**2 * rho  # -∂/∂z e^{iks}/s, about the axis
    fade = np.where(rho < 60, 1, np.cos(np.pi * (rho / 60 - 1) / 2) ** 2)
    open_ = np.clip((rho - radius) / rho[1] + 0.5, 0, 1)
    point = np.array([[0, 0, 100.0]])
    expected = (field * open_ * kernel * fade).sum() * rho[1] / light.wave(point, k)[0][0]
    discs = shape("disk", affine(10)), shape("disk", affine(radius, at=(0, 0, 20)))
    off = {
        o: abs(factor(light, point, *discs, tolerance=1e-4, occlusion=o)[0] - expected) for o in ("graded", "binary")
    }
    assert off["graded"] < 0.55 * off["binary"]


def ball(folder, n=12):
    """A convex mesh, its corners on a sphere of radius 8."""
    i = np.arange(n * n) + 0.5
    z, turn = 1 - 2 * i / (n * n), np.pi * (1 + np.sqrt(5)) * i
    corners = 8 * np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    return mesh(folder / "ball.obj", corners, ConvexHull(corners).simplices)


@pytest.mark.parametrize("kind", ["sphere", "disk", "cube", "cylinder", "mesh"])
def test_a_single_convex_body_grazes_nothing(kind, tmp_path: Path):
    x = np.linspace(-30, 30, 31)
    points = np.stack([x, 0 * x + 0.7, 0 * x + 60], axis=1)
    body = ball(tmp_path) if kind == "mesh" else shape(kind, affine(8))
    graded, binary = (factor(LAMP, points, body, tolerance=1e-4, occlusion=o) for o in (True, "binary"))
    np.testing.assert_array_equal(graded, binary)


def test_occlusion_says_what_it_takes():
    disc, point = shape("disk", affine(8)), [[0, 0, 60.0]]
    for same in ((True, "graded"), (False, "none")):
        first, second = (factor(LAMP, point, disc, occlusion=o) for o in same)
        assert first == second
    with pytest.raises(InputError, match="occlusion: 'grade' is unknown; did you mean 'graded'"):
        factor(LAMP, point, disc, occlusion="grade")
