"""Neighbouring segments that lie nearly in one line, made one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.model import Integers, Outline, Reals

ALIKE = 0.05  # of unit normals, and of a radius of curvature: what neighbours may differ by
STEEPEST = 0.5  # cosine of the angle to the line that stands for it below which a segment is kept
MOST = 64  # rounds; the longest run is of 2³² segments


def merged(outline: Outline, sag: float) -> Outline:
    """An outline with fewer segments, each within `sag` [scene units] of all that it stands for.

    Corners stay where they are or are left out, so that segments still share their ends; chains, and the ends of open
    ones, are the same. Only neighbours on one body are merged whose faces and curvature are alike (within 0.05) and
    that both have their body behind them, or not. An arc's chords lie inside it: M errs to first order in `sag`, by
    about k·sag·|∇Δ|/2 at most, |∇Δ| <= d (1/z1 + 1/z2) (`Outline.detour`).
    `edge` and `interval` are those of a segment's first part.
    """
    first = runs(outline.start, outline.end, ~_alike(outline), np.full(len(outline), sag))
    if len(first) == len(outline):
        return outline
    last = np.append(first[1:], len(outline)) - 1
    middle = (first + last) // 2
    return replace(
        outline,
        start=outline.start[first],
        end=outline.end[last],
        body=outline.body[first],
        edge=outline.edge[first],
        interval=outline.interval[first],
        normals=outline.normals[middle],
        outward=_across(outline, first, last),
        behind=np.minimum.reduceat(outline.behind, first),
        chain=outline.chain[first],
        radius=outline.radius[middle],
        sag=outline.sag + sag,
    )


def _alike(outline: Outline) -> NDArray[np.bool_]:
    """Whether each segment but the first may be merged with the one before it, wherever they lie."""
    return (
        (outline.chain[1:] == outline.chain[:-1])
        & (outline.body[1:] == outline.body[:-1])
        & (np.isfinite(outline.behind[1:]) == np.isfinite(outline.behind[:-1]))
        & alike(outline.normals, outline.radius)
    )


def alike(normals: Reals, radius: Reals) -> NDArray[np.bool_]:
    """Whether each of n neighbours but the first has about the normals (n, 2, 3) and radius (n,) of the one before."""
    turned = np.abs(np.diff(normals, axis=0)).max(axis=(1, 2), initial=0.0)
    return (turned <= ALIKE) & (np.abs(np.diff(radius)) <= ALIKE * np.minimum(radius[1:], radius[:-1]))


def _across(outline: Outline, first: Integers, last: Integers) -> Reals:
    """The open side (n, 3) of merged segments: across the rays, so the middle part's, made perpendicular again."""
    span = outline.end[last] - outline.start[first]
    span /= np.maximum(np.linalg.norm(span, axis=1, keepdims=True), 1e-300)
    out = outline.outward[(first + last) // 2]
    out = out - (out * span).sum(1, keepdims=True) * span
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)


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
