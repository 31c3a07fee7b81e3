"""Points that stand in the rows and columns of a lattice, known from their coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grimaldi.outlines.model import Reals
from grimaldi.parts import parts
from grimaldi.scene.model import Vector

SHORT = 1 << 11  # points of most rows
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
    columns = _on_a_line(points[:SHORT])
    if columns == SHORT:
        columns = _on_a_line(points[: 1 << 15])
    if columns < 2 or len(points) % columns or len(points) < 2 * columns:
        return None
    rows = points.reshape(-1, columns, 3)
    u, v = (rows[0, -1] - rows[0, 0]) / (columns - 1), (rows[-1, 0] - rows[0, 0]) / (len(rows) - 1)
    found = Lattice(len(rows), columns, u, v)
    return found if _stands(found, points) else None


def _stands(grid: Lattice, points: Reals) -> bool:
    """Whether all points are where the lattice has them, a few rows at a time, as they fit the cache."""
    size = max(1, CACHED // grid.columns)
    for axis, slack in enumerate(rounding(points[grid.corners])):
        rows, u, v = points[:, axis].reshape(grid.rows, grid.columns), grid.u[axis], grid.v[axis]
        first = rows[0, 0] + np.arange(grid.columns) * u + np.arange(min(size, grid.rows))[:, None] * v
        for some in parts(grid.rows, size):
            off = rows[some] - first[: some.stop - some.start]
            shift = some.start * v
            if not max(off.max() - shift, shift - off.min()) <= slack:
                return False
    return True


def _on_a_line(points: Reals) -> int:
    """How many of the points, from the first on, stand as far from one to the next as the second from the first."""
    off = np.abs(points - points[0] - np.arange(len(points))[:, None] * (points[1] - points[0]))
    on = (off <= len(points) * rounding(points)).all(axis=1)
    return len(on) if on.all() else int(on.argmin())
