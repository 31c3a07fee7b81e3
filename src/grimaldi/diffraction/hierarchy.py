"""Spheres round what lies near each other, and round those, so that a receiver passes by what is far from its ray.

The nodes stand depth first: the next node is the first child, and `skip` leads past all that is inside (Smits, JGT
3(2), 1998). Δ = r + s - R is convex, so that over a sphere about C it is at least Δ(C) - |∇Δ(C)| times the radius.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import Types, on_device
from grimaldi.diffraction.frame import Frame

CHILDREN = 4
BITS = 10  # of each coordinate, by which neighbours are found


class Tree(NamedTuple):
    """Nodes as flat device buffers; `item` of a leaf is what it stands for."""

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

    def leaf(self, i: Any) -> tuple[Any, Any]:
        """Which item a node stands for, and whether it stands for one."""
        item = dr.gather(type(self.item), self.item, i)
        return item, item != NONE


NONE = 0xFFFFFFFF


def tree(centre: NDArray[np.float64], radius: NDArray[np.float64], types: Types, leaves_only: bool) -> Tree:
    """The hierarchy of items (n, 3) with radii (n,); `leaves_only`: the items alone, in their order."""
    n = len(centre)
    order = np.arange(n) if leaves_only else np.argsort(_morton(centre), kind="stable")
    centre, radius = centre[order], radius[order]
    blocks = [] if leaves_only else _blocks(n)
    total = n + sum(-(-n // b) for b in blocks)
    spheres = np.zeros((total, 4))
    skip, item = np.zeros(total, np.uint32), np.full(total, NONE, np.uint32)
    leaf = np.arange(n)
    at = leaf + sum((leaf // b + 1 for b in blocks), np.zeros(n, np.int64))
    spheres[at], skip[at], item[at] = np.column_stack([centre, radius]), at + 1, order
    for b in blocks:
        start = np.arange(0, n, b)
        end = np.minimum(start + b, n)
        at = start + sum((start // c + (c > b) for c in blocks), np.zeros(len(start), np.int64))
        low = np.minimum.reduceat(centre - radius[:, None], start)
        high = np.maximum.reduceat(centre + radius[:, None], start)
        spheres[at] = np.column_stack([0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)])
        skip[at] = end + sum((-(-end // c) for c in blocks), np.zeros(len(end), np.int64))
    index = dr.uint32_array_t(types.Float)
    return Tree(types.buffer(spheres), index(skip), index(item), on_device(index, total), types)


def _blocks(n: int) -> list[int]:
    """How many items the nodes of each level hold."""
    sizes = []
    b = CHILDREN
    while b < CHILDREN * n:
        sizes.append(b)
        b *= CHILDREN
    return sizes


def _morton(x: NDArray[np.float64]) -> NDArray[np.int64]:
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
    delta, along, inv = _way(z2, d2)
    if not frame.plane:
        z1 = frame.z1 + h
        delta_r, along_r, inv_r = _way(z1, d2)
        delta, along, inv = delta + delta_r, along - along_r, inv + inv_r
    return delta - radius * dr.sqrt(dr.fma(along, along, d2 * inv * inv))


def _way(z: Any, d2: Any) -> tuple[Any, Any, Any]:
    """√(z² + d²) - z, what of ∇ of it lies along the ray, and 1/√(z² + d²)."""
    length2 = dr.maximum(dr.fma(z, z, d2), 1e-30)
    inv = dr.rsqrt(length2)
    reach = length2 * inv + dr.abs(z)
    excess = dr.select(z > 0, d2 / reach, reach)
    return excess, excess * inv, inv
