"""Which boxes overlap, of many: a join by grids whose rows and columns hold equally many boxes.

Each box lies at the finest of a few nested grids on which it covers at most 16 cells, and two boxes meet at the
coarser of theirs (size separation: Koudas & Sevcik, SIGMOD 1997). So neither sizes nor densities that differ by
orders of magnitude make it quadratic.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.model import Integers, Reals

BINS = 1 << 18  # of equal width along each axis, which rows and columns are made of
SIDE = 1024  # most rows, and columns, of the finest grid
COARSER = 3  # each grid has 2³ times fewer rows and columns than the one before
CELLS = 16  # that a box covers at most on its own grid


class _Spans(NamedTuple):
    """Rows i0..i1 and columns j0..j1 (n,) that boxes cover."""

    i0: Integers
    i1: Integers
    j0: Integers
    j1: Integers

    def at(self, which: Integers | NDArray[np.bool_] | slice, shift: int) -> _Spans:
        return _Spans(*(x[which] >> shift for x in self))

    @property
    def cells(self) -> Integers:
        return (self.i1 - self.i0 + 1) * (self.j1 - self.j0 + 1)


class _Level(NamedTuple):
    """Boxes by the cells of one grid that they cover."""

    shift: int
    columns: int
    first: Integers  # (cells + 1,) of each cell's boxes among `box`
    box: Integers
    below: Integers  # (rows + 1, columns + 1) summed-area table of `first`'s counts


class Index:
    """Boxes low..high (3, n), n >= 1, prepared to be met by others. Cells are told by the first two coordinates."""

    def __init__(self, low: Reals, high: Reals) -> None:
        self.low, self.high = low, high
        self.least, self.most = low.min(axis=1), high.max(axis=1)
        side = 1 << int(np.clip(np.ceil(np.log2(2 * np.sqrt(low.shape[1]))), 0, np.log2(SIDE)))
        self.tables = [self._table(axis, side) for axis in range(2)]
        self.spans = self._spans(low, high)
        self.shifts = range(0, side.bit_length() + COARSER - 1, COARSER)
        own = self._own(self.spans)
        self.upto = {s: self._level(own <= s, s, side) for s in self.shifts}
        self.only = {s: self._level(own == s, s, side) for s in self.shifts}

    def overlapping(self, low: Reals, high: Reals) -> tuple[Integers, Integers]:
        """Pairs (query, box) of query boxes low..high (3, m) that overlap the index's."""
        inside = np.flatnonzero(((high >= self.least[:, None]) & (low <= self.most[:, None])).all(axis=0))
        spans = self._spans(low[:, inside], high[:, inside])
        own = self._own(spans)
        found = []
        for s in self.shifts:
            for level, which in ((self.upto[s], own == s), (self.only[s], own < s)):
                if level is not None and which.any():
                    query, box = self._at(level, spans.at(which, s))
                    query = inside[np.flatnonzero(which)[query]]
                    both = np.ones(len(query), bool)
                    for axis in range(3):
                        both &= low[axis].take(query) <= self.high[axis].take(box)
                        both &= high[axis].take(query) >= self.low[axis].take(box)
                    found.append((query[both], box[both]))
        none = np.empty(0, np.int64)
        query, box = (np.concatenate([none, *parts]) for parts in zip(*found, strict=True)) if found else (none, none)
        return query, box

    def _table(self, axis: int, side: int) -> Integers:
        """The row of each bin, such that rows hold equally many boxes' middles."""
        bins = self._bins(axis, 0.5 * (self.low[axis] + self.high[axis]))
        count = np.bincount(bins, minlength=BINS)
        return np.minimum((np.cumsum(count) - count) * side // len(bins), side - 1)

    def _bins(self, axis: int, x: Reals) -> Integers:
        """Grows with x, whatever the rounding."""
        low, high = self.least[axis], self.most[axis]
        scale = (BINS - 1) / max(high - low, 1e-300)
        return ((np.clip(x, low, high) - low) * scale).astype(np.int64)

    def _spans(self, low: Reals, high: Reals) -> _Spans:
        return _Spans(*(self.tables[axis][self._bins(axis, x[axis])] for axis in range(2) for x in (low, high)))

    def _own(self, spans: _Spans) -> Integers:
        """The shift of the finest grid on which each box covers few cells."""
        own = np.zeros(len(spans.i0), np.int64)
        for s in self.shifts[:-1]:
            own[spans.at(slice(None), s).cells > CELLS] = s + COARSER
        return own

    def _level(self, which: NDArray[np.bool_], shift: int, side: int) -> _Level | None:
        box = np.flatnonzero(which)
        if not len(box):
            return None
        spans = self.spans.at(box, shift)
        side = max(side >> shift, 1)
        owner, i, j = _covered(spans)
        cell = i * side + j
        count = np.bincount(cell, minlength=side * side)
        below = np.zeros((side + 1, side + 1), np.int64)
        below[1:, 1:] = count.reshape(side, side).cumsum(axis=0).cumsum(axis=1)
        return _Level(shift, side, np.append(0, np.cumsum(count)), box[owner[np.argsort(cell, kind="stable")]], below)

    def _at(self, level: _Level, spans: _Spans) -> tuple[Integers, Integers]:
        """Pairs (query, box) that share a cell of a grid, each told where both first do."""
        i0, i1, j0, j1 = spans
        below, wide = level.below.ravel(), level.columns + 1
        top, bottom = i0 * wide, (i1 + 1) * wide
        some = np.flatnonzero(below[bottom + j1 + 1] - below[bottom + j0] - below[top + j1 + 1] + below[top + j0])
        owner, i, j = _covered(spans.at(some, 0))
        cell = i * level.columns + j
        first, count = level.first[cell], level.first[cell + 1] - level.first[cell]
        pair = np.repeat(np.arange(len(cell)), count)
        box = level.box[np.arange(len(pair)) - np.repeat(np.cumsum(count) - count - first, count)]
        query = some[owner][pair]
        once = (np.maximum(i0[query], self.spans.i0[box] >> level.shift) == i[pair]) & (
            np.maximum(j0[query], self.spans.j0[box] >> level.shift) == j[pair]
        )
        return query[once], box[once]


def _covered(spans: _Spans) -> tuple[Integers, Integers, Integers]:
    """Which box, row and column, of all cells that boxes cover."""
    cells, width = spans.cells, spans.j1 - spans.j0 + 1
    owner = np.repeat(np.arange(len(cells)), cells)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(cells) - cells, cells)
    i, j = np.divmod(step, width[owner])
    return owner, spans.i0[owner] + i, spans.j0[owner] + j
