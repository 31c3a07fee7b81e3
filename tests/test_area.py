"""The brute-force area integral against closed forms, and against `boundary`, with which it shares no formula."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import mitsuba
import numpy as np
import oracle
import pytest
from optics import APERTURE, affine, factor, line, shape

import grimaldi
from grimaldi.errors import InputError

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

LAMP = oracle.Spherical((3, -2, -40))
LIGHTS = {"point": LAMP, "plane": oracle.Plane((0, 0, 1)), "oblique plane": oracle.Plane((0.48, 0, 0.87727))}
ACROSS = np.concatenate([line((-40, 0.7, 60), (40, 0.7, 60), 17), [[2, -0.7, 25], [-30, 5, 27]]])
CONCAVE = np.array([[-10, -9], [11, -8], [2, 1], [9, 12], [-12, 10]], float)
TURNED = affine(6, turn=[[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])

HOLES = {
    "circle": ([shape("disk", affine(12), APERTURE)], []),
    "rectangle": ([shape("rectangle", affine((9, 4, 1)), APERTURE)], []),
    "two": ([shape("rectangle", affine((2, 9, 1), at=(x, 0, 0)), APERTURE) for x in (-5, 5)], []),
    "polygon with an island": ([], [grimaldi.PlanarOutline([CONCAVE, 0.25 * CONCAVE])]),
    "mask": ([], [grimaldi.PlanarOutline(CONCAVE, hole=False)]),
}
BODIES = {
    "disk": shape("disk", affine((10, 5, 1), at=(2, -1, 0), turn=[[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])),
    "cube": shape("cube", TURNED),
    "sphere": {"type": "sphere", "radius": 7.0},
}


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("hole", HOLES)
def test_the_area_of_holes_says_what_their_outlines_say(hole, light, tolerance):
    shapes, outlines = HOLES[hole]
    area = factor(LIGHTS[light], ACROSS, *shapes, outlines=outlines, diffraction="area", tolerance=tolerance)
    boundary = factor(LIGHTS[light], ACROSS, *shapes, outlines=outlines, tolerance=1e-9)
    assert np.abs(area - boundary).max() < 0.1 * tolerance


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("body", BODIES)
def test_the_lit_surface_of_a_body_says_what_its_outline_says(body, light):
    area = factor(LIGHTS[light], ACROSS, BODIES[body], diffraction="area", tolerance=1e-6)
    boundary = factor(LIGHTS[light], ACROSS, BODIES[body], tolerance=1e-8, occlusion=False)
    # Mitsuba's rays do not tell a cube's faces apart within some 1e-4 of their common edges
    np.testing.assert_allclose(area, boundary, atol=2e-3 if body == "cube" else 1e-6)


def test_on_axis_behind_a_circular_hole():
    """U/U0 = 1 - C e^{ikΔ} with the rim's Δ = √(z²+a²) - z and C = (1 + cosγ)/2 (THEORY 5)."""
    z, a = np.array([2.0, 10, 30, 100]), 8.0
    s = np.hypot(z, a)
    expected = 1 - 0.5 * (1 + z / s) * np.exp(2j * np.pi * (s - z))
    points = np.stack([0 * z, 0 * z, z], axis=1)
    hole = shape("disk", affine(a), APERTURE)
    computed = factor(LIGHTS["plane"], points, hole, diffraction="area", tolerance=1e-8)
    np.testing.assert_allclose(computed, expected, atol=1e-9)


def test_the_error_bounds_the_error():
    scene = {
        "type": "scene",
        "light": {"type": "coherent_point", "position": [3, -2, -40]},
        "hole": HOLES["circle"][0][0],
    }
    rough = grimaldi.field(scene, ACROSS, wavelength=1, diffraction="area")
    fine = grimaldi.field(scene, ACROSS, wavelength=1, diffraction="area", tolerance=1e-9)
    assert (np.abs(rough.U - fine.U).values <= rough.error.values).all()
    assert float(rough.error.max()) < 1e-3 * float(np.abs(fine.U).max())


def sampled(points, n, shapes=(HOLES["circle"][0][0],), light=LAMP):
    """M and its standard error by n samples."""
    scene = {"type": "scene", "light": {"type": "coherent_point", "position": [3, -2, -40]}}
    scene |= {f"shape{i}": part for i, part in enumerate(shapes)}
    field = grimaldi.field(scene, points, wavelength=1, diffraction="area", n=n)
    u0 = light.wave(points, 2 * np.pi)[0]
    return field.U.values[0, 0] / u0, field.error.values[0, 0] / np.abs(u0)


GRID = np.stack([*np.meshgrid(np.linspace(-20, 20, 24), np.linspace(-20, 20, 24)), np.full((24, 24), 60.0)], axis=-1)
GRID = GRID.reshape(-1, 3)


@pytest.mark.parametrize("body", [None, "sphere", "cube"])
def test_random_samples_are_unbiased_and_know_their_spread(body):
    """|difference|²/σ² is the mean of 576 exponential variables: 1 ± 6/√576."""
    shapes = [BODIES[body]] if body else [HOLES["circle"][0][0]]
    mean, sigma = sampled(GRID, 256, shapes)
    exact = factor(LAMP, GRID, *shapes, diffraction="area", tolerance=1e-5)
    assert np.mean(np.abs(mean - exact) ** 2 / sigma**2) == pytest.approx(1, abs=0.25)
    bias = np.abs((mean - exact).mean()) / np.sqrt((sigma**2).mean() / len(GRID))
    assert bias < 4


def test_the_spread_falls_with_the_root_of_their_number():
    counts = np.array([64, 256, 1024])
    sigma = [np.sqrt((sampled(GRID, int(n))[1] ** 2).mean()) for n in counts]
    assert np.polyfit(np.log(counts), np.log(sigma), 1)[0] == pytest.approx(-0.5, abs=0.02)


def test_a_point_has_its_own_samples():
    shuffled = np.random.default_rng(1).permutation(len(GRID))
    whole, _ = sampled(GRID, 64)
    np.testing.assert_array_equal(sampled(GRID[shuffled], 64)[0], whole[shuffled])
    np.testing.assert_array_equal(sampled(GRID[100:117], 64)[0], whole[100:117])
    assert len(np.unique(whole)) == len(whole)


def test_the_report_s_figure_2_is_noise_by_1024_samples():
    """A plane wave through a disc of 7000/6 λ, 10000/6 λ behind it.

    On axis each sample is worth A C/(λ s)·…: the spread over the disc of πa² z-weighted kernels, by quadrature in
    one dimension: σ² = (A ∫|K|² dA - |∫K dA|²)/n with K = (1/2)(1 + z/s)(k - i/s …)/(2π s).
    """
    a, z, k, n = 7000 / 6, 10000 / 6, 2 * np.pi, 1024
    rho, w = np.polynomial.legendre.leggauss(400)
    rho, w = 0.5 * a * (rho + 1), 0.5 * a * w
    s = np.hypot(z, rho)
    K2 = ((k * (z / s + 1)) ** 2 + (z / s**2) ** 2) / (4 * np.pi * s) ** 2
    predicted = np.sqrt(np.pi * a**2 * (2 * np.pi * rho * w * K2).sum() / n)
    scene = {
        "type": "scene",
        "light": {"type": "coherent_directional", "direction": [0, 0, 1]},
        "hole": shape("disk", affine(a), APERTURE),
    }
    points = np.stack([np.linspace(-5, 5, 201), np.zeros(201), np.full(201, z)], axis=1)
    field = grimaldi.field(scene, points, wavelength=1, diffraction="area", n=n)
    assert predicted == pytest.approx(68, rel=0.02)  # THEORY 4
    assert float(np.sqrt((field.error**2).mean())) == pytest.approx(predicted, rel=0.01)
    rms = np.sqrt((np.abs(field.U.values) ** 2).mean())
    assert rms == pytest.approx(predicted, rel=0.2)  # noise, and next to nothing of |U| = 1.31


def test_pictures_of_both_kinds():
    """A tiny film behind a hole: by quadrature as by the boundary, by samples as their error says."""
    T = mi.scalar_rgb.ScalarTransform4f
    mi.set_variant("llvm_ad_rgb")
    scene = {
        "type": "scene",
        "light": {"type": "coherent_directional", "direction": [0, 0, 1]},
        "hole": shape("disk", affine(9), APERTURE),
        "screen": {"type": "rectangle", "to_world": T().translate([0, 0, 60]).scale(40).rotate([1, 0, 0], 180)},
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, 30], [0, 0, 60], [0, 1, 0]).scale(15),
            "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
        },
    }
    options: dict[str, Any] = {"wavelength": 1.0, "spp": 4, "seed": 1}
    boundary = grimaldi.render(scene, **options)
    area = grimaldi.render(scene, diffraction="area", **options)
    np.testing.assert_allclose(area.picture, boundary.picture, atol=3e-3)
    noisy = grimaldi.render(scene, diffraction="area", n=4096, **options)
    spread = np.abs(noisy.U.values - area.U.values)
    assert 0.2 < np.sqrt((spread**2).mean()) / float(noisy.error.mean()) < 1
    waves = ({"type": "wave", "wavelength": 1.0, "diffraction": name} for name in ("area", "boundary"))
    one, other = (np.array(mi.render(mi.load_dict(scene), integrator=mi.load_dict(wave), spp=4)) for wave in waves)
    np.testing.assert_allclose(one, other, atol=3e-3)


def test_the_command_prints_the_variance(tmp_path):
    command = ["field", "slit", "--plane", "-1,-1,0; 1,-1,0; -1,1,0; 8x8", "--diffraction", "area", "--n", "128"]
    done = subprocess.run(
        [sys.executable, "-m", "grimaldi", *command, "-o", "x.nc"], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("128 samples a point: standard error ")
    assert "variance" in done.stdout
    assert (tmp_path / "x.nc").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"n": "nyquist"}, "n: 'nyquist' spaces the sources of huygens"),
        ({"wavelength": 1e-3}, "diffraction: 'area' takes .* nodes here, more than 4e\\+06; give a longer wavelength"),
    ],
)
def test_what_it_cannot_sum_is_refused(options: dict[str, Any], says):
    with pytest.raises(InputError, match="^" + says):
        factor(LAMP, ACROSS, HOLES["circle"][0][0], diffraction="area", **options)
