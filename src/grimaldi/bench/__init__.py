"""The figures of speed and memory, each beside its yardstick in the same run: one row a file, imported when it runs."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module

from grimaldi.bench.model import Measure, Result, Settings, Skipped
from grimaldi.conventions import did_you_mean
from grimaldi.errors import GrimaldiWarning, InputError

ROWS = {
    "killeroo": "a mesh in one light, beside Mitsuba's own `direct`",
    "bodies": "10 to 10,000 bodies at one density and field of view",
    "triangles": "one body of 1e3 to 1e6 triangles, of the same silhouette",
    "wavelength": "one scene at λ and λ/100",
    "planar": "a circular hole at 1024² points, beside a plain finufft script, LightPipes and diffractio",
    "disc": "figure 2 of the report: a coherent disc, 512² pixels",
    "start": "the first picture, from an empty cache of kernels and from a full one",
    "memory": "peak memory of a picture of 4096² pixels with 1e5 segments",
    "outlines": "extracting the outlines of 1e6 triangles",
    "pairs": "pairs of point and segment a second, beside a hand-written loop",
}
"""What each row measures; its module, of the same name, has `measure`."""


def chosen(names: Sequence[str]) -> tuple[str, ...]:
    """The rows called `names`, all where there are none, in their own order.

    Raises InputError naming the nearest of a wrong one.
    """
    for name in names:
        if name not in ROWS:
            raise InputError(f"row: there is no {name!r}; {did_you_mean(name, ROWS)}")
    return tuple(name for name in ROWS if name in names or not names)


def run(names: Sequence[str], settings: Settings) -> Iterator[tuple[str, Result | Skipped]]:
    """Each row with its name, one at a time."""
    from grimaldi.variants import ensure_variant

    ensure_variant("rgb")
    for name in names:
        measure: Measure = import_module(f"grimaldi.bench.{name}").measure
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", GrimaldiWarning)  # small films alias; errors are measured, not estimated
            row = measure(settings)
        # what is to be reached is said of the full sizes
        yield name, replace(row, targets=()) if settings.quick and isinstance(row, Result) else row
