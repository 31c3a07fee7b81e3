"""A case's plot: both curves, and their difference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grimaldi.figures.drawing import sheet
from grimaldi.validation.model import Case

LEAST = 1e-17  # drawn of a difference


def plot(case: Case, path: Path) -> None:
    """Squared moduli (or the real values themselves) over the line, and |computed - reference| below."""
    from matplotlib.ticker import NullFormatter

    curve = case.curve
    is_complex = np.iscomplexobj(curve.computed)
    shown = [abs(values) ** 2 if is_complex else values for values in (curve.computed, curve.expected)]
    error = np.maximum(abs(curve.computed - curve.expected), LEAST)
    with sheet(path, 5.0, 3.2) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
        above.plot(curve.x, shown[1], color="0.7", linewidth=4, label=case.reference)
        above.plot(curve.x, shown[0], color="C0", linewidth=1.2, label="grimaldi.field")
        above.set_ylabel(f"|{curve.quantity}|²" if is_complex else curve.quantity)
        below.semilogy(curve.x, error, color="C3", linewidth=1, label="difference")
        if case.is_promise:
            below.axhline(case.allowed, color="0.4", linestyle=":", label="promised")
        below.set_ylim(*_decades(error, case.allowed if case.is_promise else 0.0))
        below.set_ylabel(f"|Δ{curve.quantity}|" if is_complex else "difference")
        below.yaxis.set_minor_formatter(NullFormatter())
        below.set_xlabel(curve.label)
        if curve.is_logarithmic:
            above.set_yscale("log")
        for axes in (above, below):
            axes.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0, 0.97), ncols=2, frameon=False)
            axes.grid(alpha=0.25)
            axes.margins(x=0.01)


def _decades(error: NDArray[np.float64], allowed: float) -> tuple[float, float]:
    """Whole decades around a difference and what is promised of it, six at most below the largest."""
    high = np.ceil(np.log10(1.2 * max(float(error.max()), allowed)))
    low = np.floor(np.log10(float(error.min())))
    return 10.0 ** max(low, high - 6), 10.0**high
