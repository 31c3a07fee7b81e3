"""Points that stand in the rows and columns of a lattice, known from their coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Vector


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
    return 2e-15 * np.maximum(points.max(axis=0), -points.min(axis=0))


def lattice(points: Reals) -> Lattice | None:
    """The lattice whose rows are the points (n, 3), but for rounding; None where there is none."""
    if len(points) < 4:
        return None
    slack = rounding(points)
    ahead = points[: 1 << 15]
    on = np.abs(ahead - ahead[0] - np.arange(len(ahead))[:, None] * (ahead[1] - ahead[0])) <= len(ahead) * slack
    columns = len(on) if on.all() else int(on.all(axis=1).argmin())
    if columns < 2 or len(points) % columns or len(points) < 2 * columns:
        return None
    rows = points.reshape(-1, columns, 3)
    u, v = (rows[0, -1] - rows[0, 0]) / (columns - 1), (rows[-1, 0] - rows[0, 0]) / (len(rows) - 1)
    for axis in range(3):
        off = rows[:, :, axis] - (rows[0, 0, axis] + np.arange(columns) * u[axis])
        off -= (np.arange(len(rows)) * v[axis])[:, None]
        if max(off.max(), -off.min()) > slack[axis]:
            return None
    return Lattice(len(rows), columns, u, v)
