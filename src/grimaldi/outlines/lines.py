"""Lit stretches of edges as the segments of an outline: put together where edges go on in one line, and cut evenly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grimaldi.outlines.candidate import Candidates
from grimaldi.outlines.lit import Stretches
from grimaldi.outlines.merging import alike, runs
from grimaldi.outlines.model import Integers, Reals

ROUNDING = 2.0**-22  # of the coordinates: how far Float32 corners lie off the line that they were meant for


class Lines(NamedTuple):
    """Segments, m of them, and where on which edge the middle of each lies."""

    start: Reals  # (m, 3)
    end: Reals  # (m, 3)
    stretch: Integers  # (m,) the one that the middle lies on, and its candidate and parameter
    candidate: Integers
    middle: Reals
    edge: Integers  # (m,) and interval (m, 2) as in `Outline`
    interval: Reals


def each(edges: Candidates, lit: Stretches) -> Lines:
    """Every stretch as a segment."""
    start, end = ends(edges, lit)
    c = lit.candidate
    interval = np.stack([lit.low, lit.high], axis=1)
    return Lines(start, end, np.arange(len(c)), c, 0.5 * (lit.low + lit.high), edges.edge[c], interval)


def straight(edges: Candidates, lit: Stretches, chain: Integers, radius: Reals, longest: Reals) -> Lines:
    """Stretches, which follow each other in chains, by the lines that they make, none longer than `longest`.

    Whole mesh edges that meet end to end become one where their corners lie in one line, as far as Float32 tells, and
    the faces beside them are alike. chain: of each stretch; radius, longest (n,): of each edge.
    """
    start, end = ends(edges, lit)
    c = lit.candidate
    goes_on = (lit.high[:-1] == 1) & (lit.low[1:] == 0) & (chain[1:] == chain[:-1])
    goes_on &= (edges.edge[c[1:]] >= 0) & (edges.edge[c[:-1]] >= 0) & alike(edges.normals[c], radius[c])
    first = runs(start, end, ~goes_on, ROUNDING * np.abs(end).max(axis=1, initial=0.0))
    last = np.append(first[1:], len(c))[: len(first)] - 1

    length = np.linalg.norm(end - start, axis=1)
    along = np.append(0, np.cumsum(length))
    total = along[last + 1] - along[first]
    pieces = np.maximum(np.ceil(total / longest[c[first]]), 1).astype(np.int64)
    run = np.repeat(np.arange(len(first)), pieces)
    step = np.arange(len(run)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    low, high = step / pieces[run], (step + 1) / pieces[run]
    begin, stop = start[first[run]], end[last[run]]

    def at(t: Reals) -> Reals:
        return np.where((t < 1)[:, None], begin + t[:, None] * (stop - begin), stop)

    place = along[first[run]] + 0.5 * (low + high) * total[run]
    stretch = np.clip(np.searchsorted(along, place, side="right") - 1, first[run], last[run])
    share = np.clip((place - along[stretch]) / length[stretch], 0, 1)
    middle = lit.low[stretch] + share * (lit.high - lit.low)[stretch]
    alone, head = first[run] == last[run], first[run]
    interval = np.stack([_within(lit, head, alone, t) for t in (low, high)], axis=1)
    return Lines(at(low), at(high), stretch, c[stretch], middle, edges.edge[c[head]], interval)


def _within(lit: Stretches, which: Integers, alone: np.ndarray, t: Reals) -> Reals:
    """Parameters t (m,) along stretches as those along their edges; along several edges in one line as they are."""
    low, high = lit.low[which], lit.high[which]
    return np.where(alone, np.where(t < 1, low + t * (high - low), high), t)


def ends(edges: Candidates, lit: Stretches) -> tuple[Reals, Reals]:
    """Where stretches start and end (n, 3); those that reach an edge's end share its bits."""
    c = lit.candidate
    start = np.where((lit.low > 0)[:, None], edges.at(c, lit.low), edges.start[c])
    return start, np.where((lit.high < 1)[:, None], edges.at(c, lit.high), edges.end[c])
