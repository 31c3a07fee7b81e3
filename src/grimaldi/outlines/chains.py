"""Segments in an order in which they follow each other."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.triangles import merged_points


def chains(start: Reals, end: Reals) -> tuple[Integers, Integers]:
    """An order in which segments (n, 3) follow each other end to start, and the chain that each then belongs to.

    Open chains come first. Where several segments start at one point, each is followed to by another one.
    """
    n = len(start)
    before = _before(start, end)
    head, rank = _heads(before)
    loop = before[head] >= 0
    order = np.lexsort((rank, head, loop))
    first = np.append(True, np.diff(head[order]) != 0)[:n]
    return order, np.cumsum(first) - 1


def _before(start: Reals, end: Reals) -> Integers:
    """The segment (n,) at whose end each starts, no two the same; -1 where there is none."""
    n = len(start)
    points = np.ascontiguousarray(np.concatenate([start, end]).T) + 0.0  # -0.0 becomes 0.0
    _, number = merged_points(points, np.zeros(2 * n, np.int64))
    # the k-th that starts at a point follows the k-th that ends there
    leaving, arriving = _ranked(number[:n], n), _ranked(number[n:], n)
    order = np.argsort(arriving)
    place = np.minimum(np.searchsorted(arriving[order], leaving), max(n - 1, 0))
    return np.where(arriving[order][place] == leaving, order[place], -1)


def _ranked(number: Integers, n: int) -> Integers:
    """Numbers (n,), told apart by how many equal ones stand before them."""
    order = np.argsort(number, kind="stable")
    new = np.flatnonzero(np.append(True, np.diff(number[order]) != 0)[:n])
    rank = np.empty(n, np.int64)
    rank[order] = np.arange(n) - np.repeat(new, np.diff(np.append(new, n)))
    return number * (n + 1) + rank


def _heads(before: Integers) -> tuple[Integers, Integers]:
    """Each segment's first one, of a loop that of the least number, and its distance from there, by doubling."""
    n = len(before)
    here = np.arange(n)
    jump, least = np.where(before < 0, here, before), here
    open_ = before[jump] < 0  # where the way back ends
    for _ in range(n.bit_length()):
        less, jump = np.minimum(least, least[jump]), jump[jump]
        ends = before[jump] < 0
        done = (less == least).all() and (ends == open_).all()
        least, open_ = less, ends
        if done:
            break
    head = np.where(open_, jump, least)
    jump = np.where(here == head, here, before)
    rank = (jump != here).astype(np.int64)
    while (more := rank[jump]).any():
        rank, jump = rank + more, jump[jump]
    return head, rank
