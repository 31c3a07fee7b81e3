"""Spheres round what lies near each other, and round those, so that a receiver passes by what is far from its ray.

The nodes stand depth first: the next node is the first child, and `skip` leads past all that is inside (Smits, JGT
3(2), 1998). Δ = r + s - R is convex, so that over a sphere about C it is at least Δ(C) - |∇Δ(C)| times the radius.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import Types, buffer, on_device
from grimaldi.diffraction.frame import Frame, way

CHILDREN = 2
BITS = 10  # of each coordinate, by which neighbours are found


class Tree(NamedTuple):
    """Nodes as flat device buffers; `item` is what they stand for."""

    spheres: Any
    skip: Any
    item: Any
    size: Any
    types: Types

    def node(self, i: Any) -> tuple[Any, Any]:
        """Centre and radius."""
        a = dr.gather(self.types.Packet, self.spheres, i)
        return self.types.Vector(a.x, a.y, a.z), a.w

    def after(self, i: Any, inside: Any) -> Any:
        """The next node, where a node is gone into or passed by."""
        return dr.select(inside, i + 1, dr.gather(type(self.skip), self.skip, i))

    def item_of(self, i: Any) -> Any:
        """What a node stands for."""
        return dr.gather(type(self.item), self.item, i)


NONE = 0xFFFFFFFF


class Layout(NamedTuple):
    """A hierarchy over items in `order`: each node's sphere, where to go past it, and which of them it holds."""

    order: NDArray[np.int64]
    spheres: NDArray[np.float64]  # centre and radius (m, 4)
    skip: NDArray[np.int64]
    begin: NDArray[np.int64]
    end: NDArray[np.int64]

    def tree(self, item: NDArray[np.int64], types: Types) -> Tree:
        """On the device; item (m,): what each node stands for, `NONE` if only for what is inside."""
        index = dr.uint32_array_t(types.Float)
        size = on_device(index, len(self.skip))
        return Tree(types.buffer(self.spheres), buffer(index, self.skip), buffer(index, item), size, types)


def flat(centre: NDArray[np.float64], radius: NDArray[np.float64]) -> Layout:
    """Items (n, 3) with radii (n,) in their own order, and nothing above them."""
    leaf = np.arange(len(centre))
    return Layout(leaf, np.column_stack([centre, radius]), leaf + 1, leaf, leaf + 1)


def layout(centre: NDArray[np.float64], radius: NDArray[np.float64], group: NDArray[np.int64]) -> Layout:
    """The hierarchy of items (n, 3) with radii (n,): near groups together, items of a group in their order."""
    n = len(centre)
    _, of = np.unique(group, return_inverse=True)
    place = morton(np.stack([np.bincount(of, x) for x in centre.T], axis=1) / np.bincount(of)[:, None])
    rank = np.argsort(np.argsort(place, kind="stable"))
    order = np.argsort(rank[of], kind="stable")
    centre, radius = centre[order], radius[order]
    blocks = _blocks(n)
    total = n + sum(-(-n // b) for b in blocks)
    spheres = np.zeros((total, 4))
    skip, begin, end = (np.zeros(total, np.int64) for _ in range(3))
    leaf = np.arange(n)
    at = leaf + sum((leaf // b + 1 for b in blocks), np.zeros(n, np.int64))
    spheres[at] = np.column_stack([centre, radius])
    skip[at], begin[at], end[at] = at + 1, leaf, leaf + 1
    for b in blocks:
        start = np.arange(0, n, b)
        stop = np.minimum(start + b, n)
        at = start + sum((start // c + (c > b) for c in blocks), np.zeros(len(start), np.int64))
        low = np.minimum.reduceat(centre - radius[:, None], start)
        high = np.maximum.reduceat(centre + radius[:, None], start)
        spheres[at] = np.column_stack([0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)])
        skip[at] = stop + sum((-(-stop // c) for c in blocks), np.zeros(len(stop), np.int64))
        begin[at], end[at] = start, stop
    return Layout(order, spheres, skip, begin, end)


def _blocks(n: int) -> list[int]:
    """How many items the nodes of each level hold."""
    sizes = []
    b = CHILDREN
    while b < CHILDREN * n:
        sizes.append(b)
        b *= CHILDREN
    return sizes


def morton(x: NDArray[np.float64]) -> NDArray[np.int64]:
    """Places (n, 3) along Morton's curve: near each other where they are near in space."""
    low = x.min(0)
    cells = ((x - low) / max(float(np.ptp(x, axis=0).max()), 1e-300) * (2**BITS - 1)).astype(np.int64)
    code = np.zeros(len(x), np.int64)
    for bit in range(BITS):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


def least_detour(frame: Frame, centre: Any, radius: Any) -> Any:
    """A lower bound of Δ over a sphere, below 0 where it may hold the ray."""
    x = centre - frame.foot
    h = dr.dot(x, frame.a)
    d2 = dr.maximum(dr.squared_norm(x) - h * h, 0)
    z2 = frame.z2 - h
    delta, along, inv = way(z2, d2)
    if not frame.plane:
        z1 = frame.z1 + h
        delta_r, along_r, inv_r = way(z1, d2)
        delta, along, inv = delta + delta_r, along - along_r, inv + inv_r
    return delta - radius * dr.sqrt(dr.fma(along, along, d2 * inv * inv))
