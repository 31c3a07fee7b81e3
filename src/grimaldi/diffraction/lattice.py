"""Points that stand in the rows and columns of a lattice, known from their coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Vector

CACHED = 1 << 15  # numbers: a quarter of a MB


class Lattice(NamedTuple):
    """Points that stand in `rows` of `columns`."""

    rows: int
    columns: int
    u: Vector  # (3,) from one point of a row to the next
    v: Vector  # (3,) from one row to the next

    @property
    def middle(self) -> int:
        """The point that finufft counts its modes from."""
        return (self.rows // 2) * self.columns + self.columns // 2

    @property
    def corners(self) -> list[int]:
        last = (self.rows - 1) * self.columns
        return [0, self.columns - 1, last, last + self.columns - 1]


def rounding(points: Reals) -> Vector:
    """How far (3,) rounding may move points (n, 3) of these coordinates."""
    return 2e-15 * np.array([max(axis.max(), -axis.min()) for axis in points.T])


def lattice(points: Reals) -> Lattice | None:
    """The lattice whose rows are the points (n, 3), but for rounding; None where there is none."""
    if len(points) < 4:
        return None
    ahead = points[: 1 << 15]
    on = np.abs(ahead - ahead[0] - np.arange(len(ahead))[:, None] * (ahead[1] - ahead[0]))
    on = (on <= len(ahead) * np.maximum(rounding(ahead), rounding(points[-1:]))).all(axis=1)
    columns = len(on) if on.all() else int(on.argmin())
    if columns < 2 or len(points) % columns or len(points) < 2 * columns:
        return None
    rows = points.reshape(-1, columns, 3)
    u, v = (rows[0, -1] - rows[0, 0]) / (columns - 1), (rows[-1, 0] - rows[0, 0]) / (len(rows) - 1)
    found = Lattice(len(rows), columns, u, v)
    return found if _stands(found, points) else None


def _stands(grid: Lattice, points: Reals) -> bool:
    """Whether all points are where the lattice has them, a few rows at a time, as they fit the cache."""
    rows = points.reshape(grid.rows, 3 * grid.columns)
    slack = np.tile(rounding(points[grid.corners]), grid.columns)
    first = (points[0] + np.arange(grid.columns)[:, None] * grid.u).ravel()
    step = np.tile(grid.v, grid.columns)
    block = max(1, CACHED // len(first))
    for start in range(0, grid.rows, block):
        off = rows[start : start + block] - first
        off -= np.multiply.outer(np.arange(start, start + len(off)), step)
        if not (np.abs(off, out=off) <= slack).all():
            return False
    return True
