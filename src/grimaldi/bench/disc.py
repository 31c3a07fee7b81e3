"""Figure 2 of the report, which took it two days."""

from __future__ import annotations

import numpy as np

from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.timing import medians, written
from grimaldi.figures import disc
from grimaldi.figures.drawing import grid
from grimaldi.scene import load

MOST = 0.5  # seconds


def measure(settings: Settings) -> Result:
    return picture(32 if settings.quick else 512, settings)


def picture(pixels: int, settings: Settings) -> Result:
    """The mean intensity over each of pixels² pixels, as `grimaldi figures` draws it."""
    loaded = load(disc.scene())
    x, y = grid(-disc.HALF, disc.HALF, -disc.HALF, disc.HALF, pixels)
    pixel = float(x[1] - x[0])

    def whole() -> np.ndarray:
        return disc.exact(loaded, x, y)[2]

    (time,) = medians(settings.runs, whole)
    points, error = disc.check(loaded, whole(), x, y, pixel)
    line = {"pixels": f"{pixels}²", "time": written(time), "error of the mean intensity": f"{error:.1g}"}
    text = (
        "A coherent disc of radius 7000/6 λ, 10000/6 λ away: the mean of |U|² over each pixel, about 1, warm. The "
        f"error is the largest at three pixels against the plain mean of {points:,} points in each."
    )
    return Result(text, (line,), (Target(f"{pixels}² pixels", time, MOST, "s"),))
