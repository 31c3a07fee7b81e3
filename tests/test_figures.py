"""The report's figures: each shows what it should, at sizes that take seconds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import mitsuba
import numpy as np
import pytest
from optics import affine, shape

import grimaldi
from grimaldi.figures import FIGURES, bodies, corner, disc, page, spheres, two_lights, wavelets
from grimaldi.figures.drawing import grid, plane
from grimaldi.figures.model import Answer, Figure, Picture, Settings
from grimaldi.outlines.offset_test import offset_outline

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for


@pytest.fixture(autouse=True)
def rgb():
    mi.set_variant("llvm_ad_rgb")


def maxima(values):
    return int(((values[1:-1] > values[:-2]) & (values[1:-1] > values[2:])).sum())


def test_1_has_as_many_bright_fringes_as_whole_path_differences():
    x = np.linspace(-20, 20, 4001)
    field = grimaldi.field(two_lights.scene(), plane(x, np.zeros(1)), wavelength=1.0, diffraction="none")
    contrast = field.intensity.values * (x**2 + two_lights.HEIGHT**2)  # brightness falls with the distance
    assert maxima(contrast) == two_lights.bright_fringes(20) == 15
    apart = grimaldi.field(
        two_lights.scene(), plane(x, np.zeros(1)), wavelength=1.0, diffraction="none", interference=False
    )
    assert maxima(apart.intensity.values) <= 2


def test_2_is_a_disc_with_rings_and_no_airy_pattern():
    """|U|² = 1.7215 on the axis; rings 0.87 λ apart: λ √(z²+a²)/(2 a), doubled by the edge's two sides (THEORY 5)."""
    loaded = grimaldi.load(disc.scene())
    rho, intensity = disc.radial(loaded, 40.0)
    assert intensity[0] == pytest.approx(1.7215, abs=1e-3)
    spacing = np.hypot(disc.RADIUS, disc.DISTANCE) / (2 * disc.RADIUS)
    assert spacing == pytest.approx(0.87, abs=0.005)
    spectrum = np.abs(np.fft.rfft((intensity - intensity.mean())[100:]))
    frequencies = np.fft.rfftfreq(len(rho) - 100, disc.STEP)
    near = (frequencies > 0.9) & (frequencies < 1.4)
    assert frequencies[near][spectrum[near].argmax()] == pytest.approx(1 / spacing, rel=0.05)
    inside = grimaldi.field(loaded, [[disc.RADIUS / 2, 1, disc.DISTANCE]], wavelength=1.0)
    assert float(inside.intensity[0]) == pytest.approx(1, abs=0.2)  # an Airy pattern would be dark there


def test_2_has_between_its_samples_what_the_field_has():
    """Where fringes are finest, and at the disc's edge, where all waves across the plane are strong."""
    loaded = grimaldi.load(disc.scene())
    rho, intensity = disc.radial(loaded, 1200.0)
    chosen = np.concatenate([np.arange(3, 400, 13), round(disc.RADIUS / disc.STEP) + np.arange(-300, 300, 17)])
    points = np.stack([rho[chosen], 0 * rho[chosen], np.full(len(chosen), disc.DISTANCE)], axis=1)
    field = grimaldi.field(loaded, points, wavelength=1.0)
    np.testing.assert_allclose(intensity[chosen], field.intensity, rtol=0, atol=1e-4)


def test_2_takes_the_mean_over_each_pixel():
    """cos²(ρ) over squares, some about the axis and some beside it, against a finer sum."""
    rho = np.linspace(0, 40, 40_001)
    x, y = grid(-20, 20, -12, 20, 5)
    means = disc.footprints(x, y, 8.0, rho, np.cos(rho) ** 2)
    fine_x, fine_y = grid(-20, 20, -12, 20, 2000)
    expected = np.cos(np.hypot(*np.meshgrid(fine_x, fine_y))) ** 2
    np.testing.assert_allclose(means, expected.reshape(4, 400, 5, 400).mean(axis=(1, 3)), rtol=0, atol=1e-5)


def test_3_adds_up_to_an_even_front():
    assert wavelets.LENGTH / (max(wavelets.COUNTS) - 1) < 0.5  # under Nyquist's spacing
    assert wavelets.unevenness(65) < 0.05
    assert wavelets.unevenness(9) > 0.2


def test_5_has_the_report_s_bias_and_boundary_does_not(tmp_path):
    """A border of which a quarter is meshed ten times finer gets 10/13 of the report's sources."""
    fine = np.linspace(6, -6, 11)[:-1]
    rim = np.concatenate([np.stack([np.full(10, -6.0), fine], axis=1), [[-6, -6], [6, -6], [6, 6]]])
    vertices = ["v 0 0 0", *(f"v {x} {y} 0" for x, y in rim)]
    faces = [f"f 1 {2 + i} {2 + (i + 1) % len(rim)}" for i in range(len(rim))]
    (tmp_path / "sheet.obj").write_text("\n".join([*vertices, *faces]))
    light = {"type": "coherent_directional", "direction": [0, 0, 1]}
    scene = grimaldi.load(
        {"type": "scene", "light": light, "sheet": {"type": "obj", "filename": str(tmp_path / "sheet.obj")}}
    )
    found = offset_outline(scene, scene.sources[0])
    assert len(found) == 13
    low, high = bodies.strengths(np.linalg.norm(found.end - found.start, axis=1))
    assert (low, high) == (pytest.approx(4 / 13), pytest.approx(40 / 13))  # of equal sources' strength per length
    points = np.array([[1.0, 2, 50], [-5, 0, 60]])
    plain = {"type": "scene", "light": light, "sheet": shape("rectangle", affine((6, 6, 1)))}
    exact, cut = (grimaldi.field(s, points, wavelength=1, tolerance=1e-8).U.values for s in (plain, scene))
    np.testing.assert_allclose(cut, exact, atol=1e-6)


def test_6_differs_by_interference_then_by_diffraction():
    pictures = [
        grimaldi.render(spheres.scene(64, 48), wavelength=spheres.WAVELENGTH, spp=16, seed=1, **way)
        for way in spheres.WAYS.values()
    ]
    neither, interference, both = (p.intensity.values for p in pictures)
    patch = np.s_[36:48, 34:64]  # of open floor
    assert neither[patch].std() < 0.05 * neither[patch].mean()
    assert interference[patch].std() > 0.2 * interference[patch].mean()
    shadow = neither == 0
    assert shadow.any()
    assert both[shadow].mean() > 0
    assert not interference[shadow].any()


def test_6_has_youngs_fringes():
    """Along the line that joins the lights' feet: λ·distance/s apart."""
    x = np.linspace(-100, 100, 8001)
    scene = {name: part for name, part in spheres.scene(8, 8).items() if name in ("type", "left", "right")}
    points = plane(x - 120.0, np.array([-90.0]))
    intensity = grimaldi.field(scene, points, wavelength=spheres.WAVELENGTH).intensity.values
    inner = np.flatnonzero((intensity[1:-1] > intensity[:-2]) & (intensity[1:-1] > intensity[2:])) + 1
    middle = np.abs(x[inner]) < 50
    np.testing.assert_allclose(
        np.diff(x[inner][middle]), spheres.WAVELENGTH * spheres.DISTANCE / spheres.APART, rtol=0.02
    )


def test_7_sound_goes_round_the_corner_the_longer_the_louder():
    """|M| grows as √λ away from the shadow's boundary: 10 dB a decade; by rays nothing comes."""
    listener = np.array([[6.0, -4.0, 0.0]])
    long, short = corner.level(listener, 0.34)[0], corner.level(listener, 0.034)[0]
    assert long - short == pytest.approx(10, abs=0.3)
    assert corner.level(listener, 0.34, "none")[0] == pytest.approx(-120)


def test_the_page_says_all_and_escapes():
    figure = Figure(
        "9", "a < b", "text", (Picture("x.png", "c & d"),), {"p": "<1>"}, answers=(Answer("q", "corrected", "r"),)
    )
    text = page.page([figure], ["without killeroo"])
    for part in ("a &lt; b", "c &amp; d", "&lt;1&gt;", 'src="x.png"', "without killeroo", "<b>corrected</b>"):
        assert part in text


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "grimaldi", "figures", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder)


def test_the_command_draws_a_page(tmp_path):
    done = run(tmp_path, "-o", "page", "--only", "3,4")
    assert done.returncode == 0, done.stderr
    files = {path.name for path in (tmp_path / "page").iterdir()}
    assert {"index.html", "figure-3.png", "figure-4-creature.png"} <= files
    text = (tmp_path / "page" / "index.html").read_text(encoding="utf-8")
    assert all(name in text for name in files - {"index.html"})
    assert 'id="figure-3"' in text
    assert 'id="figure-5"' not in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["-o", "page", "--only", "8"], "figure: there is no '8'; known are 1, 2, 3"),
        (["-o", "page", "--only", ""], "figure: there is no ''"),
        (["-o", "file"], "file: is a file; name a folder"),
        (["-o", "no/page"], "no/page: the folder no does not exist; make it first"),
        (["-o", "page", "--data", "none"], "--data: none is no folder"),
    ],
)
def test_wrong_input_exits_with_2(tmp_path, arguments, says):
    (tmp_path / "file").touch()
    done = run(tmp_path, *arguments)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert says in line
    assert not (tmp_path / "page").exists()


def test_every_figure_has_a_way_to_be_drawn():
    assert list(FIGURES) == ["1", "2", "3", "4", "5", "6", "7"]
    assert Settings(Path()).killeroo is None
