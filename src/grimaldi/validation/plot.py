"""A case's plot: both curves, and their difference."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from grimaldi.figures.drawing import sheet
from grimaldi.validation.model import Case

LEAST = 1e-17  # drawn of a difference


def plot(case: Case, path: Path) -> None:
    """Squared moduli (or the real values themselves) over the line, and |computed - reference| below."""
    curve = case.curve
    is_complex = np.iscomplexobj(curve.computed)
    shown = [abs(values) ** 2 if is_complex else values for values in (curve.computed, curve.expected)]
    error = np.maximum(abs(curve.computed - curve.expected), LEAST)
    with sheet(path, 5.0, 3.2) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
        above.plot(curve.x, shown[1], color="0.7", linewidth=4, label=case.reference)
        above.plot(curve.x, shown[0], color="C0", linewidth=1.2, label="grimaldi.field")
        above.set_ylabel(f"|{curve.quantity}|²" if is_complex else curve.quantity)
        above.set_title(f"{case.name}: {case.verdict}", fontsize=10)
        above.legend(fontsize=8)
        below.semilogy(curve.x, error, color="C3", linewidth=1)
        if case.is_promise:
            below.axhline(case.allowed, color="0.5", linestyle=":", label="promised")
            below.legend(fontsize=8, loc="lower right")
        below.set_ylabel(f"|Δ{curve.quantity}|" if is_complex else "difference")
        below.set_xlabel(curve.label)
        for axes in (above, below):
            axes.grid(alpha=0.25)
            axes.margins(x=0.01)
