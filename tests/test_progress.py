"""The progress bar: on a terminal, for long jobs, and nowhere else."""

from __future__ import annotations

import io
import subprocess
import sys

import pytest

import grimaldi
from grimaldi.engine import progress as module
from grimaldi.engine.asking import work
from grimaldi.engine.progress import progress
from grimaldi.light import prepare
from grimaldi.options import Settings
from grimaldi.variants import ensure_variant


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    return now


def written(monkeypatch: pytest.MonkeyPatch, stderr: io.StringIO, clock: list[float], seconds: float) -> str:
    """What a job of ten steps that takes `seconds` writes to `stderr`."""
    monkeypatch.setattr(sys, "stderr", stderr)
    monkeypatch.setenv("TERM", "xterm")
    with progress(10, "render") as advance, progress(2, "inner") as advance_inner:
        for step in range(10):
            clock[0] = (step + 1) * seconds / 10
            advance(1)
            advance_inner(0)
    return stderr.getvalue()


def test_a_long_job_on_a_terminal_shows_its_bar(monkeypatch: pytest.MonkeyPatch, clock: list[float]) -> None:
    shown = written(monkeypatch, Terminal(), clock, 20.0)
    assert "render" in shown
    assert "%" in shown


def test_a_short_job_shows_nothing(monkeypatch: pytest.MonkeyPatch, clock: list[float]) -> None:
    assert written(monkeypatch, Terminal(), clock, 0.9) == ""


def test_nothing_is_shown_where_there_is_no_terminal(monkeypatch: pytest.MonkeyPatch, clock: list[float]) -> None:
    assert written(monkeypatch, io.StringIO(), clock, 20.0) == ""


def test_an_interrupt_that_got_lost_is_raised_at_the_next_step():
    code = """
import signal, time
from grimaldi.engine import interrupt
from grimaldi.engine.progress import progress
interrupt.listen()
try:
    signal.raise_signal(signal.SIGINT)
except KeyboardInterrupt:
    pass  # swallowed, as a callback from C++ may do
with progress(2, "work") as advance:
    advance(1)
print("went on")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "KeyboardInterrupt" in done.stderr
    assert "went on" not in done.stdout


@pytest.mark.parametrize(("tolerance", "least", "most"), [(1e-3, 4.0, 64.0), (1e-2, 1.0, 1.0)])
def test_tiles_are_smaller_where_every_piece_takes_a_ray(tolerance, least, most):
    """Else nothing is said for half a minute; by lists a receiver takes a hundredth of that."""
    ensure_variant("rgb")
    light = prepare(grimaldi.load("creature"), Settings(wavelength=0.4, tolerance=tolerance))
    assert least <= work(light.beams[0].factor) <= most
