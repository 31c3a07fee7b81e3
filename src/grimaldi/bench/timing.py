"""Seconds: medians of runs that take turns, so that a busy machine slows all alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

from grimaldi.scene.model import Scene

T = TypeVar("T")

LONG = 400.0  # all timed runs of a picture [s]


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """What `work` returns, and the seconds that it takes, Dr.Jit's kernels included."""
    import drjit as dr

    dr.sync_thread()
    begun = time.perf_counter()
    value = work()
    dr.sync_thread()
    return value, time.perf_counter() - begun


def medians(runs: int, *works: Callable[[], Any]) -> tuple[float, ...]:
    """The median seconds of each of `works`, run in turn; once more each at first, untimed, to compile kernels."""
    for work in works:
        work()
    return _in_turn(runs, *works)


def beside(
    runs: int, once: float, work: Callable[[], Any], yardstick: Callable[[], Any], long: float = LONG
) -> tuple[float, float, int]:
    """The median seconds of `work`, which ran before in `once` seconds, and of its yardstick; the runs of `work`.

    They run in turn. Where all runs would take more than `long` [s], `once` counts, which is one run.
    """
    yardstick()
    if runs * once > long:
        (theirs,) = _in_turn(runs, yardstick)
        return once, theirs, 1
    ours, theirs = _in_turn(runs, work, yardstick)
    return ours, theirs, runs


def _in_turn(runs: int, *works: Callable[[], Any]) -> tuple[float, ...]:
    times = [[timed(work)[1] for work in works] for _ in range(runs)]
    return tuple(map(statistics.median, zip(*times, strict=True)))


def written(value: float) -> str:
    """A time as a table shows it."""
    return f"{value:.3g} s"


def anew(scene: Scene) -> Scene:
    """The same scene without what is remembered with it, such as its outlines."""
    return replace(scene)
