"""`grimaldi bench`: the command as a process, the page that it writes, its scenes, and how it judges."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import grimaldi
from grimaldi.bench import ROWS, bodies, chosen, error, gpu, killeroo, memory, pairs, planar, report, scenes
from grimaldi.bench.error import TOLERANCES, Film
from grimaldi.bench.model import Result, Settings, Skipped, Target
from grimaldi.bench.timing import beside, medians
from grimaldi.errors import InputError
from grimaldi.outlines.extract import edges_of
from grimaldi.reference import circle

QUICK = ["--quick", "--runs", "1"]
RESULT = Result(
    "Said.",
    ({"": "a|b", "time": "1 s"}, {"": "", "memory": "2 GB"}),
    (Target("ratio", 4.0, 5.0, "×"), Target("peak", None, 4.0, "GB")),
)


def command(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "grimaldi", "bench", *map(str, arguments)], capture_output=True, text=True, cwd=cwd
    )


def test_the_command_prints_its_rows_and_writes_the_page(tmp_path):
    done = command(*QUICK, "--only", "wavelength,triangles", "-o", tmp_path, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == str(tmp_path / "performance.md")
    page = (tmp_path / "performance.md").read_text()
    for name in ("triangles", "wavelength"):
        assert page.count(f"## {name}: {ROWS[name]}\n") == 1
        assert f"## {name}: {ROWS[name]}\n" in done.stdout
    assert "--quick" in page
    assert "reached" not in page  # small sizes show nothing of what is to be reached
    for fact in ("CPU", "Python", "mitsuba", "LLVM", "variant"):
        assert f"| {fact} | " in page
    assert [path.name for path in tmp_path.iterdir()] == ["performance.md"]


def test_the_list_measures_nothing(tmp_path):
    done = command("--list", cwd=tmp_path)
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()] == [*ROWS]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--only", "kileroo"], "row: there is no 'kileroo'; did you mean 'killeroo'?"),
        (["--runs", "0"], "--runs: 0 is out of reach; give a number from 1 to 1000"),
        (["--seed", "-1"], "--seed: -1 is out of reach; give a number from 0 to 4294967295"),
        (["-o", "nowhere"], "nowhere: is no folder; make it first"),
        (["--data", "nowhere"], "--data: nowhere is no folder; name the one that has scenes/killeroo.xml in it"),
        (["--peers", "nowhere"], "--peers: nowhere is no program; name a Python that has LightPipes or diffractio"),
    ],
)
def test_wrong_input_is_one_line(arguments, says, tmp_path):
    done = command(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"grimaldi: {says}\n")


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to send to another process")
def test_an_interrupted_run_keeps_the_rows_that_were_done(tmp_path):
    words = [sys.executable, "-m", "grimaldi", "bench", *QUICK, "--only", "wavelength,start", "-o", tmp_path]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert running.stdout is not None
    assert running.stdout.readline().startswith("## wavelength")  # the next row runs now
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=60)
    assert (running.returncode, errors) == (130, "grimaldi: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == [report.PAGE]
    page = (tmp_path / report.PAGE).read_text()
    assert [line.split(":")[0] for line in page.splitlines() if line.startswith("## ")] == ["## wavelength"]


def test_every_row_is_a_module_that_measures():
    for name in ROWS:
        assert callable(import_module(f"grimaldi.bench.{name}").measure)
    assert chosen([]) == tuple(ROWS)
    assert chosen(["pairs", "killeroo"]) == ("killeroo", "pairs")
    with pytest.raises(InputError, match="did you mean 'memory'"):
        chosen(["memroy"])


def test_the_peak_of_a_gpu_is_that_of_its_data_sheet():
    """NVIDIA's own figures: H100 SXM5 67 TFLOP/s at 1980 MHz on 132 multiprocessors, A100 19.5 at 1410 MHz on 108."""

    class Driver:
        def __init__(self, **attributes: int) -> None:
            self.attributes = attributes

        def cuDeviceGetAttribute(self, into: Any, which: int, device: int) -> int:
            name = {getattr(gpu, name): name for name in ("CLOCK", "MULTIPROCESSORS", "MAJOR", "MINOR")}[which]
            into._obj.value = self.attributes[name]
            return 0

    assert gpu.peak(Driver(CLOCK=1_980_000, MULTIPROCESSORS=132, MAJOR=9, MINOR=0)) == pytest.approx(67e12, rel=0.01)
    assert gpu.peak(Driver(CLOCK=1_410_000, MULTIPROCESSORS=108, MAJOR=8, MINOR=0)) == pytest.approx(19.5e12, rel=0.01)


def test_a_row_without_its_data_says_so(tmp_path):
    missing = killeroo.measure(Settings(data=tmp_path))
    assert isinstance(missing, Skipped)
    assert "give its folder by --data" in missing.why
    assert pairs._hand_written(None, 10) == "not run: roofline.cpp is not at hand"
    with pytest.raises(planar.Absent, match="No module named 'no_such_library'"):
        planar.Other(sys.executable, "import no_such_library", 8, tmp_path)


def test_verdicts():
    assert Target("x", 5.0, 5.0).verdict == "reached"
    assert Target("x", 5.1, 5.0).verdict == "MISSED"
    assert Target("x", math.nan, 5.0).verdict == "MISSED"
    assert Target("x", None, 5.0).verdict == "not measured"


def test_the_page_says_what_is_reached_and_what_was_left_out():
    settings = Settings(seed=3, runs=7)
    rows = {"memory": RESULT, "killeroo": Skipped("no data")}
    page = report.page({name: report.section(name, row, settings) for name, row in rows.items()}, {"CPU": "some"})
    lines = page.splitlines()
    assert [line.partition(":")[0] for line in lines if line.startswith("## ")] == [
        "## What was to be reached",
        "## killeroo",
        "## memory",
    ]
    assert f"Measured on {date.today()} by `--only memory --runs 7 --seed 3`." in lines
    assert "Not measured: no data." in lines
    assert "| a\\|b | 1 s | - |" in lines
    assert "|  | - | 2 GB |" in lines
    ratio, peak = "ratio: 4× (to reach: ≤ 5×), reached", "peak: - (to reach: ≤ 4 GB), not measured"
    link = "- [memory](#memory-peak-memory-of-a-picture-of-4096²-pixels-with-1e5-segments), "
    for line in (ratio, peak):
        assert lines.count(link + line) == 1
        assert lines.count("- " + line) == 1


def test_a_page_keeps_the_rows_of_the_same_machine_that_are_not_measured_anew(tmp_path, monkeypatch):
    path = tmp_path / report.PAGE
    done = report.section("memory", RESULT, Settings(seed=1))
    monkeypatch.setattr(report, "machine", lambda: {"CPU": "one"})
    report.write("memory", RESULT, Settings(seed=1), tmp_path)
    for why in ("firstly", "lastly"):
        report.write("killeroo", Skipped(why), Settings(seed=2), tmp_path)
    again = report.section("killeroo", Skipped("lastly"), Settings())
    assert path.read_text() == report.page({"memory": done, "killeroo": again}, {"CPU": "one"})
    monkeypatch.setattr(report, "machine", lambda: {"CPU": "another"})
    report.write("killeroo", Skipped("lastly"), Settings(), tmp_path)
    assert path.read_text() == report.page({"killeroo": again}, {"CPU": "another"})


def test_runs_take_turns_after_one_untimed():
    order: list[str] = []
    assert len(medians(2, lambda: order.append("a"), lambda: order.append("b"))) == 2
    assert order == ["a", "b"] * 3


def test_a_long_picture_is_not_run_again():
    order: list[str] = []
    works = (lambda: order.append("a"), lambda: order.append("b"))
    assert beside(3, 1.0, *works, long=4.0)[2] == 3
    assert order == ["b", *["a", "b"] * 3]
    order.clear()
    assert beside(3, 1.0, *works, long=2.0)[::2] == (1.0, 1)
    assert order == ["b"] * 4


@pytest.mark.parametrize("share", [0.02, 1.0, 30.0, 1e3])
def test_the_tolerance_is_the_loosest_whose_error_is_allowed(share, monkeypatch):
    """Of pictures that err by `share` times the tolerance, relative to what diffraction changes."""

    def picture(scene, wavelength, film, tolerance):
        return np.full((4, 4, 3), 7.0 + 2.0 * share * (tolerance - error.REFERENCE))

    def exact(scene, wavelength, film, patience):
        return error.Reference(np.arange(5), np.full((5, 3), 7.0), np.full((5, 3), 5.0))

    monkeypatch.setattr(error, "picture", picture)
    monkeypatch.setattr(error, "reference", exact)
    monkeypatch.setattr(error, "anew", lambda scene: scene)
    found = error.loosest(None, 1.0, Film(4, 1, 0))  # type: ignore[arg-type]
    errors = [share * (tolerance - error.REFERENCE) for tolerance in TOLERANCES]
    allowed = [tolerance for tolerance, e in zip(TOLERANCES, errors, strict=True) if e <= error.ALLOWED]
    assert found.tolerance == max(allowed, default=TOLERANCES[-1])
    assert found.error == pytest.approx(share * (found.tolerance - error.REFERENCE))
    assert found.pixels == 5
    assert ("above 10%" in found.cells()["error"]) == (found.error > error.ALLOWED)
    hasty = error.loosest(None, 1.0, Film(4, 1, 0), patience=-1.0)  # type: ignore[arg-type]
    assert hasty.tolerance == TOLERANCES[0]


@pytest.mark.filterwarnings("ignore:.*alias:grimaldi.errors.GrimaldiWarning")
def test_the_reference_is_the_picture_at_its_pixels():
    """Bit for bit, since a tile is a function of the pixels; so that its error is 0, and that of the rays exactly 1."""
    film = Film(20, 2, 5)
    scene = grimaldi.load(scenes.bodies(3, seed=1))
    found = error.reference(scene, scenes.WAVELENGTH, film)
    wave = error.picture(scene, scenes.WAVELENGTH, film, tolerance=error.REFERENCE, fast=False)
    rays = error.picture(scene, scenes.WAVELENGTH, film, diffraction="none")
    assert len(found.pixels) == 400
    np.testing.assert_array_equal(found.wave, wave.reshape(400, -1)[found.pixels])
    np.testing.assert_array_equal(found.rays, rays.reshape(400, -1)[found.pixels])
    assert (found.error(wave), found.error(rays)) == (0, 1)
    hasty = error.reference(scene, scenes.WAVELENGTH, film, patience=-1.0)
    np.testing.assert_array_equal(hasty.pixels, found.pixels[: error.LENGTH])
    np.testing.assert_array_equal(hasty.wave, found.wave[: error.LENGTH])


def test_strips_are_apart_on_the_film_and_anywhere():
    film = Film(700, 16, 3)
    firsts = np.array(film.strips())
    assert firsts.tolist() == film.strips() != Film(700, 16, 4).strips()
    assert len(firsts) == error.STRIPS
    assert np.diff(np.sort(firsts)).min() >= error.LENGTH
    assert 0 <= firsts.min() <= firsts.max() <= 700**2 - error.LENGTH
    # the mean of as many uniform numbers lies within four of its standard deviations
    assert abs(firsts.mean() / 700**2 - 0.5) < 4 / np.sqrt(12 * error.STRIPS)


def test_the_exponent_is_that_of_a_power_law():
    times = {n: 3 * n**0.4 for n in (10, 100, 1000)}
    assert bodies._slope(times, 100, 1000) == pytest.approx(0.4)
    assert bodies._slope(times, 100, 10_000) is None
    assert bodies._expected(times, 10_000) == pytest.approx(3 * 10_000**0.4)
    assert bodies._expected({10: 2.0}, 100) == pytest.approx(20)  # in proportion, while nothing else is known


@pytest.mark.filterwarnings("ignore:.*alias:grimaldi.errors.GrimaldiWarning")
def test_a_picture_that_would_take_too_long_is_left_out():
    result = bodies.growth((1, 2, 3), Film(8, 1, 0), runs=1, patience=1e-9)
    assert [line["time"].startswith("left out") for line in result.lines] == [False, True, True]
    assert result.targets[0].verdict == "not measured"


def test_bodies_are_apart_of_one_density_and_the_same_whatever_their_number():
    few, many = scenes.layer(100, 5), scenes.layer(2000, 5)
    np.testing.assert_array_equal(few, many[:100])
    assert not np.array_equal(few, scenes.layer(100, 6))
    distance = np.linalg.norm(many[:, None] - many[None], axis=2) + np.diag(np.full(2000, np.inf))
    assert distance.min() > 2 * scenes.RADIUS
    for radius in (30.0, 60.0):
        count = (np.linalg.norm(many[:, :2], axis=1) < radius).sum()
        assert count == pytest.approx(np.pi * radius**2 / scenes.CELL, rel=0.03)


def test_turns_are_rotations():
    turns = scenes.rotations(50, 1)
    np.testing.assert_allclose(
        np.einsum("nij,nkj->nik", turns, turns), np.broadcast_to(np.eye(3), (50, 3, 3)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-12)


@pytest.mark.parametrize("split", [1, 2, 5])
def test_divided_meshes_are_closed_and_keep_their_shape(split):
    """Euler: V - E + F = 2, each edge at two faces; the box keeps its volume, the sphere tends to 4π/3."""
    for points, faces in (scenes.divided(*scenes._cuboid(), split), scenes.icosphere(split)):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edges, count = np.unique(edges, axis=0, return_counts=True)
        assert (count == 2).all()
        assert len(points) - len(edges) + len(faces) == 2
        volume = np.linalg.det(points[faces]).sum() / 6
        if len(faces) == 12 * split**2:
            assert volume == pytest.approx(1)
        else:
            assert len(faces) == 20 * split**2
            assert 0 < 4 * np.pi / 3 - volume < 2.5 / split**2  # inscribed: less by the square of the edges


def test_the_box_has_one_outline_however_finely_it_is_meshed():
    lengths = []
    for split in (1, 4, 16):
        loaded = grimaldi.load(scenes.box(split, seed=2))
        edges, body = edges_of(loaded, loaded.sources[0], [1e-3] * len(loaded.bodies))
        of_box = [b.name for b in loaded.bodies].index("box")
        mine = body == of_box
        assert mine.sum() == 6
        lengths.append(np.linalg.norm(edges.end[mine] - edges.start[mine], axis=1).sum())
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-5)


def test_bodies_joined_or_not_cast_the_same_edges():
    edges = []
    for joined in (False, True):
        loaded = grimaldi.load(scenes.bodies(6, seed=1, joined=joined))
        found, _ = edges_of(loaded, loaded.sources[0], [1e-3] * len(loaded.bodies))
        edges.append(found.start[np.lexsort(found.start.T)])
    np.testing.assert_allclose(edges[0], edges[1])
    assert len(edges[0]) / 6 == pytest.approx(33, rel=0.2)


def test_another_library_takes_its_turns_at_the_same_points(tmp_path):
    """Whose phase is compared but for a constant: here the plain script itself, turned by a quarter."""
    script = "from grimaldi.bench.planar import plain\ndef run():\n    return 1j * plain(a, z, wavelength, x, 1e-9)\n"
    side, points = planar.square(8)
    exact = planar.plain(planar.RADIUS, planar.DISTANCE, planar.WAVELENGTH, side, 1e-9).ravel()
    other = planar.Other(sys.executable, script, 8, tmp_path)
    try:
        seconds, errors = planar._in_turn({"other": other}, 2, np.arange(64), exact)
    finally:
        other.close()
    assert points.shape == (64, 3)
    assert seconds["other"] > 0
    assert errors["other"] < 1e-9  # a wider square is another sum, to the same tolerance
    assert planar._error(1j * exact, exact, turned=False) > 1


def test_the_plain_script_is_fresnels_integral_on_the_axis():
    a, z, wavelength = planar.RADIUS, planar.DISTANCE, planar.WAVELENGTH
    side, _ = planar.square(16)
    u = planar.plain(a, z, wavelength, side, 1e-9)
    assert side[8] == 0
    assert abs(u[8, 8]) == pytest.approx(abs(circle.fresnel(a, z, wavelength)), abs=1e-8)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="elsewhere the system counts what the parent held")
def test_a_childs_peak_is_its_own():
    held = np.ones(50_000_000)  # 0.4 GB
    code = "from grimaldi.bench.memory import peak; print(peak())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 0.01 < float(done.stdout) < 0.3 < held.nbytes / 1e9


def test_a_process_that_is_late_is_ended_and_larger_pictures_are_left_out():
    result = memory.peaks(1, (8, 16), Settings(), patience=0.5)
    first, *others = result.lines
    assert first["time"] == "left out: not done in 0.5 s"
    if Path("/proc/self/status").exists():
        assert float(first["peak memory"].split()[1]) > 0.001
    assert [line["time"] for line in others] == ["left out: 8², 1 spp was not done"] * 3
    assert {target.verdict for target in result.targets} == {"not measured"}
    with pytest.raises(memory.Late):
        memory._child(8, 1, 1, 0, patience=0.1)
