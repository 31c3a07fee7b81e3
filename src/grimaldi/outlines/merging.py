"""Neighbouring segments that lie nearly in one line, made one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.model import Integers, Reals

ALIKE = 0.05  # of unit normals, and of a radius of curvature: what neighbours may differ by
STEEPEST = 0.5  # cosine of the angle to the line that stands for it below which a segment is kept
MOST = 64  # rounds; the longest run is of 2³² segments


def alike(normals: Reals, radius: Reals) -> NDArray[np.bool_]:
    """Whether each of n neighbours but the first has about the normals (n, 2, 3) and radius (n,) of the one before."""
    turned = np.abs(np.diff(normals, axis=0)).max(axis=(1, 2), initial=0.0)
    return (turned <= ALIKE) & (np.abs(np.diff(radius)) <= ALIKE * np.minimum(radius[1:], radius[:-1]))


def runs(start: Reals, end: Reals, breaks: NDArray[np.bool_], sag: Reals) -> Integers:
    """First segments of runs of n segments (n, 3) whose every corner lies within sag (n,) of its run's chord.

    breaks (n - 1,): where no run may go on. Neighbouring runs are joined two by two, as long as some can be.
    """
    n = len(start)
    group = np.append(0, np.cumsum(breaks))[:n]
    first, idle = np.arange(n), 0
    settled = np.zeros(n, bool)  # of each run: whether it was refused with its right neighbour as they are
    for round_ in range(2 * MOST):
        of = group[first]
        begin = np.flatnonzero(np.append(True, np.diff(of) != 0)[: len(first)])
        place = np.arange(len(first)) - np.repeat(begin, np.diff(np.append(begin, len(first))))
        left = np.flatnonzero((place[:-1] % 2 == round_ % 2) & (of[1:] == of[:-1]) & ~settled[:-1])
        joins = left[_straight(start, end, first, left, sag)]
        settled[left] = True
        settled[joins] = False
        settled[joins[joins > 0] - 1] = False
        idle = 0 if len(joins) else idle + 1
        if idle == 2:
            break
        first, settled = np.delete(first, joins + 1), np.delete(settled, joins + 1)
    return first


def _straight(start: Reals, end: Reals, first: Integers, left: Integers, sag: Reals) -> NDArray[np.bool_]:
    """Whether each of the runs `left` lies along one line with its right neighbour."""
    begin, stop = first[left], np.append(first, len(start))[left + 2]
    count = stop - begin
    if not len(left):
        return np.zeros(0, bool)
    at = np.cumsum(count) - count
    which = np.repeat(np.arange(len(left)), count)
    segment = np.arange(len(which)) + np.repeat(begin - at, count)
    chord = end[stop - 1] - start[begin]
    length = np.linalg.norm(chord, axis=1)
    unit = (chord / np.maximum(length, 1e-300)[:, None])[which]
    v = end[segment] - start[begin][which]
    off = np.linalg.norm(v - (v * unit).sum(1)[:, None] * unit, axis=1) - sag[segment]
    span = end[segment] - start[segment]
    ahead = (span * unit).sum(1) - STEEPEST * np.linalg.norm(span, axis=1)
    return (np.maximum.reduceat(off, at) <= 0) & (np.minimum.reduceat(ahead, at) >= 0)
