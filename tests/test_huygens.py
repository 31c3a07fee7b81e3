"""The report's own method, and what its sums converge to (THEORY 4)."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import mitsuba
import numpy as np
import oracle
import pytest
from optics import APERTURE, GREY, affine, emitter, factor, line, mesh, shape

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


def order(errors, counts=COUNTS):
    """The slope of log error against log n, with its sign turned."""
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0]


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


CONCAVE = np.array([[-10, -9], [11, -8], [2, 1], [9, 12], [-12, 10]], float)
TURNED = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
BODIES: dict[str, dict[str, Any]] = {
    "concave hole": {"outlines": [grimaldi.PlanarOutline(CONCAVE)]},
    "cube": {"shapes": [shape("cube", affine(5, turn=TURNED))]},
    "sphere": {"shapes": [{"type": "sphere", "radius": 6.0, "bsdf": GREY}]},
}


def computed(what, points, **options):
    """M and its reported error, relative to |U0|, at points (n, 3) behind one of BODIES in the lamp's light."""
    scene = {"type": "scene", "light": emitter(LAMP), **{f"s{i}": s for i, s in enumerate(what.get("shapes", ()))}}
    loaded = grimaldi.load(scene, outlines=what.get("outlines", ()))
    result = grimaldi.field(loaded, points, wavelength=1.0, **options)
    incident = LAMP.wave(points, 2 * np.pi)[0]
    return result.U.values[0, 0] / incident, result.error.values[0, 0] / np.abs(incident)


@pytest.mark.parametrize("body", ["concave hole", "cube"])
def test_kernel_sources_converge_at_a_concave_hole_and_a_solid_body(body):
    counts = np.array([20, 40, 80, 160])
    whole: dict[str, Any] = {"occlusion": False, "precision": "double"}  # or each source is hidden for itself
    exact, _ = computed(BODIES[body], BEHIND, tolerance=1e-10, **whole)
    options: dict[str, Any] = {"weights": "kernel", "diffraction": "huygens", **whole}
    runs = [computed(BODIES[body], BEHIND, n=int(n), **options)[0] for n in counts]
    assert order([np.abs(m - exact).max() for m in runs], counts) == pytest.approx(2, abs=0.15)


@pytest.mark.parametrize("body", BODIES)
def test_the_reported_error_of_kernel_sources_tells_their_distance_from_boundary(body):
    """At five points in six no less, also for even n (whatever alternates along a circle cancels), nor far more."""
    rng = np.random.default_rng(1)
    points = rng.uniform([-30, -30, 30], [30, 30, 90], (200, 3))
    exact, _ = computed(BODIES[body], points, tolerance=1e-6, precision="double")
    for n in (20, 21) if body != "sphere" else (1, 2):
        m, told = computed(BODIES[body], points, n=n, weights="kernel", diffraction="huygens")
        off = np.abs(m - exact)
        assert (off <= told).mean() > 0.8
        assert np.median(told) < 5 * np.median(off) + 2e-4  # a tenth of the tolerance is for the circle's polygon


@pytest.mark.parametrize("light", [LAMP, PLANE], ids=["point", "plane"])
@pytest.mark.parametrize("hole", [True, False])
def test_kernel_sources_have_no_jump_at_the_rim(light, hole):
    """Sum and n take the side of an edge from one number: no M is off by 1, however Float32 rounds at the rim."""
    angle, rng = 0.37, np.random.default_rng(0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    corners = CORNERS[:, :2] @ turn
    along = (corners[1] - corners[0]) / 18
    off = rng.choice([-1, 1], 300) * rng.choice([0, 1e-9, 1e-7, 1e-6, 1e-4], 300)
    rim = corners[0] + rng.uniform(2, 16, (300, 1)) * along + off[:, None] * np.array([-along[1], along[0]])
    points = np.c_[rim * (1 if light is PLANE else 2.5), np.full(300, 60.0)]
    if light is LAMP:
        points[:, :2] -= 1.5 * np.array([3, -2])
    outlines = [grimaldi.PlanarOutline(corners, hole=hole)]
    exact = factor(light, points, outlines=outlines, tolerance=1e-6)
    by_sources = factor(light, points, outlines=outlines, n=400, weights="kernel", diffraction="huygens")
    np.testing.assert_allclose(by_sources, exact, atol=0.01)


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


@pytest.mark.parametrize("n", [1, 3])
def test_the_report_weighs_a_uniform_mesh_by_length(tmp_path, n):
    """Equal edges with as many sources each: the same lamps, so the same sum."""
    angle = 2 * np.pi * np.arange(12) / 12
    sheet = polygon_sheet(tmp_path / "sheet.obj", 7 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    report, length = (factor(LAMP, BEHIND, sheet, n=n, weights=w, **HUYGENS) for w in ("report", "length"))
    np.testing.assert_allclose(report, length, atol=1e-6)  # its corners are Float32


def test_the_report_on_a_sphere_is_a_plain_sum_over_its_great_circle():
    """Across the light, not where the light touches: THEORY 4."""
    ball = {"type": "sphere", "radius": 6.0, "bsdf": GREY}
    found = offset_outline(scene_of(ball), grimaldi.load({"type": "scene", "light": emitter(LAMP)}).sources[0])
    k, n = 2 * np.pi, 4
    t = (np.arange(n) + 0.5) / n
    lamps = (found.start[:, None] + t[:, None] * (found.end - found.start)[:, None]).reshape(-1, 3)
    w = np.linalg.norm(found.end - found.start, axis=1).sum() / len(lamps)
    assert w * len(lamps) == pytest.approx(2 * np.pi * 6, rel=0.02)
    expected = factor(LAMP, BEHIND, ball, diffraction="none")
    for i, p in enumerate(BEHIND):
        s = np.linalg.norm(p - lamps, axis=1)
        expected[i] += (w * LAMP.wave(lamps, k)[0] * np.exp(1j * k * s) / s).sum() / LAMP.wave(p[None], k)[0][0]
    np.testing.assert_allclose(factor(LAMP, BEHIND, ball, n=n, occlusion=False, **HUYGENS), expected, atol=1e-9)


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


@pytest.mark.parametrize("weights", ["report", "length", "kernel"])
@pytest.mark.parametrize("place", [(0.3, 0, 0), (0, 0, 0)])
def test_a_room_around_the_source_has_no_outline(place, weights):
    room = {"type": "sphere", "radius": 10.0, "flip_normals": True, "bsdf": GREY}
    points = np.array([[1, 2, 1], [0, 3, -2.0]])
    m = factor(oracle.Spherical(place), points, room, weights=weights, diffraction="huygens")
    np.testing.assert_allclose(m, 1, atol=1e-12)
    np.testing.assert_allclose(factor(oracle.Spherical(place), points, room), 1, atol=1e-12)


@pytest.mark.parametrize("weights", ["report", "length", "kernel"])
@pytest.mark.parametrize("wavelength", [1e-12, 1e15])
def test_any_wavelength_gives_numbers(wavelength, weights):
    cube = shape("cube", affine(3))
    m = factor(LAMP, BEHIND, cube, wavelength=wavelength, weights=weights, diffraction="huygens")
    assert np.isfinite(m).all()


def test_the_command_sums_sources_spaced_under_half_a_wavelength(tmp_path):
    """`grimaldi field --diffraction huygens --n nyquist --weights kernel`: what the library returns."""
    scene = {"type": "scene", "light": emitter(LAMP), "sheet": shape("rectangle", SQUARE)}
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><emitter type="coherent_point"><point name="position" x="3" y="-2" z="-40"/></emitter>'
        '<shape type="rectangle"><transform name="to_world"><scale x="9" y="6"/></transform>'
        '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape></scene>'
    )
    np.save(tmp_path / "points.npy", BEHIND)
    asked = ["--diffraction", "huygens", "--n", "nyquist", "--weights", "kernel", "--wavelength", "1"]
    done = subprocess.run(
        [sys.executable, "-m", "grimaldi", "field", "scene.xml", "--points", "points.npy", "-o", "u.npz", *asked],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    ours = grimaldi.field(scene, BEHIND, wavelength=1, diffraction="huygens", n="nyquist", weights="kernel")
    np.testing.assert_allclose(np.load(tmp_path / "u.npz")["U"], ours.U.values, rtol=1e-5)


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
