"""`grimaldi validate`: the command as a process, and the page that it writes."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from grimaldi.errors import InputError
from grimaldi.validation import CASES, chosen, report
from grimaldi.validation.model import STARSHADE_FILES, Case, Curve, Settings

FAST = "young,kite"


def command(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "grimaldi", "validate", *map(str, arguments)], capture_output=True, text=True, cwd=cwd
    )


def case(error: float = 2e-7, **changes) -> Case:
    x = np.linspace(0, 1, 5)
    plain = Case("kite", "exact", "r", error, 1e-7, 2e-7, 0.1, "said", Curve(x, x + error, x, "x", "M"))
    return replace(plain, **changes)


def test_the_command_prints_a_row_a_case_and_writes_the_page(tmp_path):
    done = command("--only", FAST, "-o", tmp_path, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    head, *rows, written = done.stdout.splitlines()
    assert head.split()[:3] == ["case", "digits", "error"]
    assert [row.split()[0] for row in rows] == FAST.split(",")
    assert all("kept" in row for row in rows)
    assert written == str(tmp_path / "accuracy.md")
    page = (tmp_path / "accuracy.md").read_text()
    for name in FAST.split(","):
        assert page.count(f"| [{name}](#{name}) |") == 1
        assert f"](images/accuracy/{name}.png)" in page
        picture = (tmp_path / "images" / "accuracy" / f"{name}.png").read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) < 60_000


def test_json(tmp_path):
    done = command("--json", "--only", FAST, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert [c["name"] for c in said["cases"]] == FAST.split(",")
    young, kite = said["cases"]
    assert kite["digits"] == pytest.approx(-np.log10(kite["error"]))
    assert kite["digits"] > 9  # its tolerance is 1e-9
    assert young["regime"] == "Fresnel"
    assert 0 < young["error"] <= young["tolerance"] + young["remainder"] < 1e-6
    assert {"grimaldi", "mitsuba", "python"} <= said["versions"].keys()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--only", "kit"], "grimaldi: case: there is no 'kit'; did you mean 'kite'?\n"),
        (["--only", "kite", "-o", "nowhere"], "grimaldi: nowhere: is no folder; make it first\n"),
        (["--data", "nowhere"], "grimaldi: --data: nowhere is no folder; name the one that has data/starshade in it\n"),
    ],
)
def test_wrong_input_is_one_line(arguments, says, tmp_path):
    done = command(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", says)


def test_a_promise_is_kept_within_tolerance_and_remainder():
    assert case(2.9e-7).verdict == "kept"
    assert case(3.1e-7).verdict == "MISSED"
    assert case(float("nan")).verdict == "MISSED"
    assert case(1e-2, regime="other model").verdict == "stated"


def test_a_missed_promise_ends_with_1(monkeypatch, capsys):
    import typer
    from typer.testing import CliRunner

    from grimaldi import validation
    from grimaldi.cli.validate import validate

    monkeypatch.setitem(validation.CASES, "kite", lambda: case(1.0))
    app = typer.Typer()
    app.command()(validate)
    missed = CliRunner().invoke(app, ["--only", "kite"])
    assert missed.exit_code == 1
    assert "MISSED" in missed.stdout
    monkeypatch.setitem(validation.CASES, "kite", lambda: case(1.0, regime="other model"))
    assert CliRunner().invoke(app, ["--only", "kite"]).exit_code == 0


def test_digits():
    assert case(1e-7).digits == pytest.approx(7)
    assert report.digits(case(0.0)) == "all"
    assert report.digits(case(float("nan"))) == "none"


def test_the_starshade_needs_its_data(tmp_path):
    everything = chosen([], Settings(tmp_path))
    assert everything.keys() == CASES.keys()
    with pytest.raises(InputError, match=r"^starshade: its data is not at hand; give"):
        chosen(["starshade"], Settings(tmp_path))
    (tmp_path / "data" / "starshade").mkdir(parents=True)
    for name in STARSHADE_FILES:
        (tmp_path / "data" / "starshade" / name).touch()
    assert [*chosen(["starshade", "edge"], Settings(tmp_path))] == ["edge", "starshade"]


def test_names_are_those_of_the_cases():
    """A case calls itself as the table does (the fast ones)."""
    for name in ("sources", "sommerfeld-soft", "edge"):
        assert CASES[name]().name == name


def test_the_published_page_has_a_row_a_case():
    page = (Path(__file__).parents[1] / "docs" / "accuracy.md").read_text()
    for name in (*CASES, "starshade"):
        assert page.count(f"| [{name}](#{name}) |") == 1, name
        assert (Path(__file__).parents[1] / "docs" / "images" / "accuracy" / f"{name}.png").is_file()
    assert "MISSED" not in page
