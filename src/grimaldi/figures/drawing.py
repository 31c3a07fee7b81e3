"""How figures are drawn: pictures with axes, strips of pictures, curves."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grimaldi.files import replacing

Reals = NDArray[np.float64]

DPI = 110


class Panel(NamedTuple):
    """One picture of a strip: values (y, x), the first row lowest, or sRGB colours (y, x, 3)."""

    title: str
    values: ArrayLike
    scale: str = "gray"  # matplotlib's colour map, for values
    limits: tuple[float, float] | None = None
    legend: str = ""  # of the colour bar; none without


@contextmanager
def sheet(path: Path, width: float, height: float) -> Iterator[Any]:
    """A matplotlib figure of so many inches, saved to `path` as a whole or not at all."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    yield figure
    with replacing(path) as temporary:
        figure.savefig(temporary)


def strip(path: Path, panels: Sequence[Panel], extent: Sequence[float], x: str, y: str, height: float = 4.0) -> None:
    """Panels side by side with common axes; extent is left, right, bottom, top."""
    left, right, bottom, top = extent
    each = height * (right - left) / (top - bottom)
    bars = sum(1.1 for panel in panels if panel.legend)
    with sheet(path, len(panels) * each + 1.0 + bars, height + 0.6) as figure:
        grid: Any = figure.subplots(1, len(panels), sharey=True, squeeze=False)
        for axes, panel in zip(grid[0], panels, strict=True):
            low, high = panel.limits or (None, None)
            shown = axes.imshow(
                panel.values, panel.scale, origin="lower", extent=extent, vmin=low, vmax=high, interpolation="nearest"
            )
            axes.set_title(panel.title, fontsize=10)
            axes.set_xlabel(x)
            if panel.legend:
                figure.colorbar(shown, ax=axes, label=panel.legend, shrink=0.95)
        grid[0][0].set_ylabel(y)


def side_by_side(path: Path, pictures: Sequence[tuple[str, NDArray[np.uint8]]]) -> None:
    """Rendered pictures (y, x, 3) of one size under their titles, pixel for pixel."""
    rows, columns = pictures[0][1].shape[:2]
    zoom = max(1, round(480 / columns))
    width, height = zoom * columns / DPI, zoom * rows / DPI
    bar, gap = 0.28, 0.06
    with sheet(path, len(pictures) * (width + gap) - gap, height + bar) as figure:
        figure.set_layout_engine("none")
        total = figure.get_figwidth()
        for i, (title, pixels) in enumerate(pictures):
            box = (i * (width + gap) / total, 0.0, width / total, height / (height + bar))
            axes = figure.add_axes(box)
            axes.imshow(pixels, interpolation="nearest", aspect="auto")
            axes.axis("off")
            figure.text(
                box[0] + 0.5 * box[2], 1 - 0.5 * bar / (height + bar), title, ha="center", va="center", fontsize=9
            )


def grid(left: float, right: float, bottom: float, top: float, n: int) -> tuple[Reals, Reals]:
    """The centres of n by (n · height/width) square pixels: x (columns,), y (rows,)."""
    pixel = (right - left) / n
    rows = round((top - bottom) / pixel)
    x, y = (
        np.asarray(start + pixel * (np.arange(count) + 0.5), np.float64) for start, count in ((left, n), (bottom, rows))
    )
    return x, y


def plane(x: Reals, y: Reals, z: float = 0.0) -> Reals:
    """Points (rows · columns, 3) of a grid at height z, row by row."""
    return np.stack(np.broadcast_arrays(*np.meshgrid(x, y), z), axis=-1).reshape(-1, 3)


class Clock:
    """Seconds since it was made."""

    def __init__(self) -> None:
        self._begun = time.perf_counter()

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self._begun

    def __str__(self) -> str:
        return f"{self.seconds:.2g} s" if self.seconds < 10 else f"{self.seconds:.0f} s"
