"""The report's own method, and what its sums converge to (THEORY 4)."""

from __future__ import annotations

from typing import Any

import mitsuba
import numpy as np
import oracle
import pytest
from optics import APERTURE, affine, factor, line, mesh, shape

import grimaldi
from grimaldi.errors import InputError
from grimaldi.outlines.offset_test import offset_outline

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

LAMP = oracle.Spherical((3, -2, -40))
PLANE = oracle.Plane((0, 0, 1))
BEHIND = line((-30, 5, 60), (30, 9, 60), 7)
SQUARE = affine((9, 6, 1))
CORNERS = np.array([[-9, -6, 0], [9, -6, 0], [9, 6, 0], [-9, 6, 0]], float)
HUYGENS: dict[str, Any] = {"diffraction": "huygens", "precision": "double"}
COUNTS = np.array([96, 192, 384, 768])


def order(errors):
    """The slope of log error against log n, with its sign turned."""
    return -np.polyfit(np.log(COUNTS), np.log(errors), 1)[0]


def edges(*loops):
    """Segments of closed polygons (n, 3)."""
    return np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops])


def length_sum(light, points, segments, k):
    """∮ U0 e^{iks}/s dl over U0(P), forward only, by 20,000 midpoints an edge."""
    total = np.zeros(len(points), complex)
    t = (np.arange(20_000) + 0.5) / 20_000
    for start, end in segments:
        x = start + t[:, None] * (end - start)
        w = np.linalg.norm(end - start) / len(t)
        travel = np.broadcast_to(light.direction, x.shape) if isinstance(light, oracle.Plane) else x - light.position
        for i, p in enumerate(points):
            s = np.linalg.norm(p - x, axis=1)
            forward = ((p - x) * travel).sum(1) > 0
            total[i] += (forward * w * light.wave(x, k)[0] * np.exp(1j * k * s) / s).sum()
    return total / light.wave(points, k)[0]


@pytest.mark.parametrize("light", [LAMP, PLANE], ids=["point", "plane"])
@pytest.mark.parametrize("opening", [True, False], ids=["hole", "sheet"])
def test_kernel_sources_converge_to_boundary_to_second_order(light, opening):
    """The midpoint rule of a smooth integrand, away from the rim."""
    sheet = shape("rectangle", SQUARE, **({"bsdf": APERTURE} if opening else {}))
    exact = factor(light, BEHIND, sheet, tolerance=1e-10, precision="double")
    errors = [np.abs(factor(light, BEHIND, sheet, n=int(n), weights="kernel", **HUYGENS) - exact).max() for n in COUNTS]
    assert errors[-1] < 1e-4
    assert order(errors) == pytest.approx(2, abs=0.15)


@pytest.mark.parametrize("light", [LAMP, PLANE], ids=["point", "plane"])
def test_length_sources_converge_to_their_own_integral_to_second_order(light):
    """∮ U0 e^{iks}/s dl, which is not Kirchhoff's field."""
    sheet = shape("rectangle", SQUARE)
    rays = factor(light, BEHIND, sheet, diffraction="none")
    limit = rays + length_sum(light, BEHIND, edges(CORNERS), 2 * np.pi)
    errors = [np.abs(factor(light, BEHIND, sheet, n=int(n), weights="length", **HUYGENS) - limit).max() for n in COUNTS]
    assert order(errors) == pytest.approx(2, abs=0.15)
    assert np.abs(limit - factor(light, BEHIND, sheet)).max() > 0.05


@pytest.mark.parametrize("weights", ["length", "kernel"])
def test_an_opaque_mask_and_a_sheet_are_the_same(weights):
    mask = grimaldi.PlanarOutline(CORNERS[:, :2], hole=False)
    by_mask = factor(LAMP, BEHIND, outlines=[mask], n=20, weights=weights, **HUYGENS)
    by_sheet = factor(LAMP, BEHIND, shape("rectangle", SQUARE), n=20, weights=weights, **HUYGENS)
    np.testing.assert_allclose(by_mask, by_sheet, atol=1e-6)  # the sheet's corners are Float32


def polygon_sheet(path, corners):
    """A planar fan over corners (n, 2)."""
    n = len(corners)
    vertices = np.concatenate([[[0, 0, 0]], np.c_[corners, np.zeros(n)]])
    faces = [[0, 1 + i, 1 + (i + 1) % n] for i in range(n)]
    return mesh(path, vertices, faces)


def test_the_report_is_a_plain_sum_of_equal_lamps(tmp_path):
    """Literally: n sources an edge, spaced evenly, each of the outline's length over their number."""
    corners = np.array([[-9, -6], [2, -7], [9, -6], [8, 5], [-9, 6]], float)
    sheet = polygon_sheet(tmp_path / "sheet.obj", corners)
    segments, k, n = edges(np.c_[corners, np.zeros(5)]), 2 * np.pi, 3
    lamps = np.concatenate([a + (b - a) * ((np.arange(n) + 0.5) / n)[:, None] for a, b in segments])
    w = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum() / len(lamps)
    expected = factor(LAMP, BEHIND, sheet, diffraction="none")
    for i, p in enumerate(BEHIND):
        s = np.linalg.norm(p - lamps, axis=1)
        expected[i] += (w * LAMP.wave(lamps, k)[0] * np.exp(1j * k * s) / s).sum() / LAMP.wave(p[None], k)[0][0]
    np.testing.assert_allclose(factor(LAMP, BEHIND, sheet, n=n, **HUYGENS), expected, atol=1e-9)


def test_the_report_is_brighter_where_the_mesh_is_finer(tmp_path):
    """The left edge of a square cut into m: its share of the sources is m/(m + 3), of the length 1/4."""
    m, k = 29, 2 * np.pi
    left = np.stack([np.full(m, -6.0), np.linspace(6, -6, m + 1)[:-1]], axis=1)
    sheet = polygon_sheet(tmp_path / "sheet.obj", np.concatenate([left, [[-6, -6], [6, -6], [6, 6]]]))
    # far down the axis of the left edge, all its sources are in phase but for the others' small share
    p = np.array([[-6.0, 0, 5000]])
    rays = factor(PLANE, p, sheet, diffraction="none")
    report = factor(PLANE, p, sheet, **HUYGENS) - rays
    length = factor(PLANE, p, sheet, weights="length", **HUYGENS) - rays
    square = np.array([[-6, -6, 0], [6, -6, 0], [6, 6, 0], [-6, 6, 0]], float)
    one = length_sum(PLANE, p, edges(square)[3:], k)
    others = length_sum(PLANE, p, edges(square)[:3], k)
    expected = one * (m / (m + 3)) / (1 / 4) + others * (3 / (m + 3)) / (3 / 4)
    assert np.abs(report - expected) < 0.02 * np.abs(expected)
    assert np.abs(length - (one + others)) < 0.02 * np.abs(one + others)
    # what does not converge in the report does in the exact model: cutting an edge changes nothing
    fine, plain = (factor(PLANE, p, s, tolerance=1e-8) for s in (sheet, shape("rectangle", affine((6, 6, 1)))))
    np.testing.assert_allclose(fine, plain, atol=1e-6)


def scene_of(*shapes):
    parts: dict[str, Any] = {f"shape{i}": part for i, part in enumerate(shapes)}
    return grimaldi.load({"type": "scene", "light": {"type": "coherent_point", "position": [3, -2, -40]}, **parts})


def test_the_offset_test_finds_a_convex_bodys_silhouette():
    scene = scene_of(shape("cube", affine(5, turn=[[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])))
    exact = grimaldi.outline(scene)
    by_offset = offset_outline(scene, scene.sources[0])
    whole = {tuple(np.round((*a, *b), 4)) for a, b in zip(by_offset.start, by_offset.end, strict=True)}
    for a, b in zip(exact.start, exact.end, strict=True):
        assert any(
            np.linalg.norm(np.cross(b - a, np.array(w[:3]) - a)) < 1e-3 * np.linalg.norm(b - a)
            and np.dot(b - a, np.array(w[3:]) - np.array(w[:3])) > 0
            for w in whole
        )
    total = np.linalg.norm(by_offset.end - by_offset.start, axis=1).sum()
    assert total == pytest.approx(np.linalg.norm(exact.end - exact.start, axis=1).sum(), rel=1e-6)


def test_the_offset_test_changes_with_epsilon():
    scene = grimaldi.load("creature")
    found = [offset_outline(scene, scene.sources[0], epsilon) for epsilon in (1, 0.03, 0.003)]
    sets = [set(outline.edge[outline.body == 0]) for outline in found]
    exact = grimaldi.outline(scene)
    true = set(exact.edge[exact.body == 0])
    assert len(sets[0]) > 2 * len(true)  # beside fine edges the rays pass others
    assert true - sets[2]  # gaps
    assert sets[1] - sets[2]


def test_a_sphere_gets_its_great_circle():
    scene = scene_of({"type": "sphere", "radius": 5.0})
    found = offset_outline(scene, scene.sources[0])
    middle = 0.5 * (found.start + found.end)
    light = np.array([3, -2, -40.0])
    np.testing.assert_allclose(middle @ light, 0, atol=1e-9)
    assert len(found) == 32
    turn = np.cross(found.start, found.end) @ -light
    assert (turn > 0).all()


def test_nyquist_spacing_is_under_half_a_wavelength():
    """n sources an edge, n = ⌊2 length/λ⌋ + 1: the same sum."""
    sheet = shape("rectangle", affine((9, 9, 1)))
    by_name = factor(LAMP, BEHIND, sheet, n="nyquist", weights="length", wavelength=0.7, **HUYGENS)
    by_number = factor(LAMP, BEHIND, sheet, n=int(18 / 0.35) + 1, weights="length", wavelength=0.7, **HUYGENS)
    np.testing.assert_allclose(by_name, by_number, atol=1e-12)


def test_secondary_sources_are_hemispherical():
    """Beside and before the sheet, whatever goes back towards the light is left out."""
    sheet = shape("rectangle", SQUARE)
    before = np.array([[15.0, 3, -5]])
    np.testing.assert_allclose(factor(PLANE, before, sheet, n=50, weights="length", **HUYGENS), 1, atol=1e-12)


@pytest.mark.parametrize("weights", ["report", "length", "kernel"])
def test_the_report_s_sources_stay_behind_what_hides_them(weights):
    """A second sheet close behind the first hides its whole rim."""
    first, second = shape("rectangle", affine((5, 5, 1))), shape("rectangle", affine((50, 50, 1), at=(0, 0, 3)))
    p = np.array([[0.5, 1, 60.0]])
    both = factor(LAMP, p, first, second, n=30, weights=weights, **HUYGENS)
    alone = factor(LAMP, p, second, n=30, weights=weights, **HUYGENS)
    np.testing.assert_allclose(both, alone, atol=1e-7 if weights != "report" else 0.2 * abs(alone[0]))


@pytest.mark.parametrize(
    ("shapes", "options", "says"),
    [
        ([shape("rectangle", SQUARE, APERTURE)], {}, "weights: 'report' finds silhouettes of bodies, not apertures"),
        ([shape("rectangle", affine(1e5))], {"n": "nyquist", "wavelength": 0.01}, "n: 'nyquist' makes 1.6e+08 sources"),
        ([shape("rectangle", SQUARE)], {"n": 1 << 23}, "n: 8388608 makes 3.36e+07 sources, more than 1e+07"),
    ],
)
def test_what_cannot_be_summed_is_refused(shapes, options: dict[str, Any], says):
    with pytest.raises(InputError, match="^" + says.replace("+", r"\+")):
        factor(LAMP, BEHIND, *shapes, diffraction="huygens", **options)


def test_nothing_in_the_light_sends_nothing():
    np.testing.assert_allclose(factor(LAMP, BEHIND, **HUYGENS), 1)


@pytest.mark.parametrize("n", [2, "nyquist"])
def test_the_integrator_sums_the_same_sources(n):
    """mi.render with `wave`, and grimaldi.render: eq. 3a of the field at the pixels."""
    mi.set_variant("llvm_ad_rgb")
    T = mi.ScalarTransform4f
    waves = {"type": "wave", "wavelength": 2.0, "diffraction": "huygens", "n": n, "weights": "kernel"}
    scene = {
        "type": "scene",
        "integrator": waves,
        "light": {"type": "coherent_directional", "direction": [0, 0, 1], "amplitude": 1.0},
        "sheet": shape("rectangle", affine((9, 6, 1))),
        "screen": {"type": "rectangle", "to_world": T().translate([0, 0, 60]).scale(40).rotate([1, 0, 0], 180)},
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, 30], [0, 0, 60], [0, 1, 0]).scale(20),
            "film": {"type": "hdrfilm", "width": 12, "height": 12, "rfilter": {"type": "box"}},
        },
    }
    loaded = mi.load_dict(scene)
    ours = grimaldi.render(loaded, spp=4, seed=1)
    theirs = np.array(mi.render(loaded, spp=64))
    assert ours.attrs["diffraction"] == "huygens"
    assert np.isfinite(ours.error.values).all()
    lit = ours.intensity.values * 0.5 / np.pi  # albedo 1/2, the light upright
    np.testing.assert_allclose(ours.picture.values[..., 0], lit, rtol=1e-5)
    assert np.corrcoef(theirs[..., 0].ravel(), lit.ravel())[0, 1] > 0.9
