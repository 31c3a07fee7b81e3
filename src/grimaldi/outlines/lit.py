"""The parts of candidate edges that the source reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.candidate import Candidates, toward
from grimaldi.outlines.hidden import Sight
from grimaldi.outlines.model import Integers, Reals
from grimaldi.outlines.pieces import Pieces
from grimaldi.scene.model import Source

SAMPLES = (0.03, 0.5, 0.97)  # of each stretch between two crossings
HALVINGS = 40


@dataclass(frozen=True, eq=False)
class Stretches:
    """Intervals low..high (n,) of candidates."""

    candidate: Integers
    low: Reals
    high: Reals

    @staticmethod
    def whole(n: int) -> Stretches:
        """All of n candidates."""
        return Stretches(np.arange(n), np.zeros(n), np.ones(n))

    def __getitem__(self, which: NDArray[np.bool_] | Integers) -> Stretches:
        return Stretches(self.candidate[which], self.low[which], self.high[which])


def lit_parts(sight: Sight) -> Stretches:
    """What the source reaches of edges, in order along them.

    Whether it reaches an edge changes only where that passes behind another outline (found exactly, by the signs of
    determinants) or runs into a surface (by bisection between samples).
    """
    all_ = _between_cuts(len(sight.edges), *_crossings(sight.source, sight.edges, sight.pieces))

    def reached(stretches: Stretches, at: Reals) -> NDArray[np.bool_]:
        return ~sight.hidden(stretches.candidate, at)

    parts = []
    places = [all_.low + f * (all_.high - all_.low) for f in SAMPLES]
    states = [reached(all_, at) for at in places]
    borders = [all_.low]
    for i in range(len(SAMPLES) - 1):
        change = states[i] != states[i + 1]
        border = np.where(change, np.nan, places[i])
        border[change] = _bisect(
            lambda at, of=all_[change]: reached(of, at),
            places[i][change],
            places[i + 1][change],
            states[i][change],
        )
        borders.append(border)
    borders.append(all_.high)
    for i, state in enumerate(states):
        parts.append((np.flatnonzero(state), borders[i][state], borders[i + 1][state]))
    stretch, low, high = _joined(*(np.concatenate(p) for p in zip(*parts, strict=True)))
    return Stretches(all_.candidate[stretch], low, high)


def _crossings(source: Source, edges: Candidates, pieces: Pieces) -> tuple[Integers, Reals]:
    """Where edges pass behind others in the source's view: edge and parameter, of the farther and of the nearer one.

    The farther one may be hidden from there on, and behind the nearer one its own body may begin.
    """
    i, j = (pieces.edge[piece] for piece in pieces.index.overlapping(pieces.low, pieces.high))
    shared = (edges.start[i] == edges.end[j]).all(1) | (edges.end[i] == edges.start[j]).all(1)
    pair = np.sort((i * len(edges) + j)[(i != j) & ~shared])
    i, j = np.divmod(pair[np.append(True, np.diff(pair) != 0)[: len(pair)]], len(edges))
    # i is cut by the plane through the source and j, and the other way round
    t, across_i = _cut(source, edges, i, j)
    s, across_j = _cut(source, edges, j, i)
    x = edges.start[i] + t[:, None] * (edges.end[i] - edges.start[i])
    y = edges.start[j] + s[:, None] * (edges.end[j] - edges.start[j])
    w = toward(source, x)
    ahead = np.einsum("ij,ij->i", y - x, w) / np.maximum(np.einsum("ij,ij->i", w, w), 1e-300)
    # closer to a point source than x, and on the same side of it
    nearer = ahead > 0 if source.is_plane else (ahead > 0) & (ahead < 1)
    keep = across_i & across_j & nearer
    return np.concatenate([i[keep], j[keep]]), np.concatenate([t[keep], s[keep]])


def _cut(source: Source, edges: Candidates, i: Integers, j: Integers) -> tuple[Reals, NDArray[np.bool_]]:
    """Where edges i meet the planes through the source and edges j: the parameter, and whether they do."""
    if source.position is not None:
        a = edges.start[j] - source.position
        normal = np.cross(a, edges.end[j] - source.position)
    else:
        assert source.direction is not None
        a = edges.start[j]
        normal = np.cross(edges.end[j] - a, source.direction)
    origin = edges.start[j]
    low = np.einsum("ij,ij->i", edges.start[i] - origin, normal)
    high = np.einsum("ij,ij->i", edges.end[i] - origin, normal)
    across = (low > 0) != (high > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(across, low / (low - high), 0.0), across


def _between_cuts(n: int, owner: Integers, at: Reals) -> Stretches:
    """The stretches of n candidates between cuts at parameters `at` of candidates `owner`."""
    candidate = np.concatenate([np.arange(n), owner])
    low = np.concatenate([np.zeros(n), np.clip(at, 0, 1)])
    order = np.lexsort((low, candidate))
    candidate, low = candidate[order], low[order]
    last = np.append(candidate[1:] != candidate[:-1], True)
    high = np.where(last, 1.0, np.append(low[1:], 1.0))
    return Stretches(candidate, low, high)[high > low]


def _bisect(reached, low: Reals, high: Reals, at_low: NDArray[np.bool_]) -> Reals:
    """Where `reached` changes between parameters low and high."""
    for _ in range(HALVINGS if len(low) else 0):
        middle = 0.5 * (low + high)
        same = reached(middle) == at_low
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)


def _joined(stretch: Integers, low: Reals, high: Reals) -> tuple[Integers, Reals, Reals]:
    """Intervals low..high of stretches; those that continue each other within one are made one."""
    order = np.lexsort((low, stretch))
    stretch, low, high = stretch[order], low[order], high[order]
    follows = (stretch[1:] == stretch[:-1]) & (low[1:] == high[:-1])
    first = np.flatnonzero(np.append(True, ~follows)[: len(order)])
    last = np.append(first[1:], len(order))[: len(first)] - 1
    return stretch[first], low[first], high[last]
