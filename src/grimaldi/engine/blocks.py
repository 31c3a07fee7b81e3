"""The film cut into squares: what the camera sees in each is a block of receivers, or two of different surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.model import OUTSIDE, Blocks, Receivers

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

SIDE = 16  # pixels
ROOM = 1.5  # times what the samples of a curved surface differ by
DEEPEST = 4.0  # times the distance of a sample, that its plane may be seen at within a square
PLANE = 1e-4  # what a point may lie off a plane, of the block's radius; and a normal off another


class Sight(NamedTuple):
    """Rays of a camera, the receivers that they meet, active where those scatter the sources' light, and their shape.

    From `see(x, y)`, x and y places of the film [pixels].
    """

    ray: Any
    receivers: Receivers
    shape: Any  # 0 where none is lit


@dataclass(frozen=True, eq=False)
class Squares:
    """Blocks for some rows of a film, `across` squares in a row; `second`: the second block of each square."""

    blocks: Blocks
    second: Any
    across: Any
    down: Any
    top: Any

    def at(self, x: Any, y: Any, receivers: Receivers) -> Any:
        """The blocks of receivers seen at places of the film [pixels]; OUTSIDE where they lie in none."""
        i = dr.minimum(mi.UInt32(x) // SIDE, self.across - 1)
        j = dr.minimum(mi.UInt32(y - self.top) // SIDE, self.down - 1)
        square = j * self.across + i
        first = self.blocks.of(receivers, square)
        second = self.blocks.of(receivers, dr.gather(mi.UInt32, self.second, square))
        return dr.select(first == OUTSIDE, second, first)


class _Nodes(NamedTuple):
    """3 × 3 samples of each square, row by row: (squares, 9, 3) and (squares, 9)."""

    o: Reals
    d: Reals
    p: Reals
    n: Reals
    shape: Integers
    lit: NDArray[np.bool_]

    def of(self, squares: Integers) -> _Nodes:
        return _Nodes(*(x[squares] for x in self))


class _Group(NamedTuple):
    """A block of each square, about the surface that one of its samples lies on."""

    p: Reals  # (squares, 3)
    n: Reals
    radius: Reals  # (squares,)
    bend: Reals
    member: NDArray[np.bool_]  # (squares, 9): the samples that lie in it
    there: NDArray[np.bool_]  # (squares,): whether there is any


def squares(see: Callable[[Any, Any], Sight], width: int, top: int, rows: int) -> Squares:
    """The blocks of `rows` rows of a film `width` pixels wide, from row `top` on."""
    across, down = -(-width // SIDE), -(-rows // SIDE)
    nodes = _nodes(see, across, down, top)
    first = _group(nodes, np.where(nodes.lit[:, 4], 4, nodes.lit.argmax(1)), nodes.lit)
    left = nodes.lit & ~first.member
    having = np.flatnonzero(left.any(1))
    second = _group(nodes.of(having), left[having].argmax(1), left[having])
    index = np.full(across * down, OUTSIDE, np.uint32)
    index[having] = across * down + np.arange(len(having))
    both = _Group(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))
    square = np.append(np.arange(across * down), having)
    return Squares(
        _blocks(both, nodes.of(square), _beside(both, square, index, across, down)),
        mi.UInt32(index),
        dr.opaque(mi.UInt32, across),
        dr.opaque(mi.UInt32, down),
        dr.opaque(mi.Float, top),
    )


def _nodes(see: Callable[[Any, Any], Sight], across: int, down: int, top: int) -> _Nodes:
    """What the camera sees at the corners, sides and middles of squares."""
    columns = 2 * across + 1
    y, x = (mi.Float(v.ravel()) for v in np.mgrid[: 2 * down + 1, :columns].astype(np.float32) * (SIDE // 2))
    sight = see(x, y + top)
    r = sight.receivers
    dr.eval(sight.ray.o, sight.ray.d, r.p, r.n, sight.shape, r.active)
    square = np.arange(across * down)
    corner = 2 * (square // across) * columns + 2 * (square % across)
    at = corner[:, None] + np.add.outer(np.arange(3) * columns, np.arange(3)).ravel()
    vectors = (np.array(v, np.float64).T[at] for v in (sight.ray.o, sight.ray.d, r.p, r.n))
    return _Nodes(*vectors, sight.shape.numpy()[at].astype(np.int64), r.active.numpy()[at])


def _group(nodes: _Nodes, seed: Integers, candidates: NDArray[np.bool_]) -> _Group:
    """The block of the surface that sample `seed` of each square lies on, of samples that are `candidates`."""
    of = np.arange(len(seed)), seed
    P, N = nodes.p[of], nodes.n[of]
    slant = (nodes.d * N[:, None]).sum(2)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((P[:, None] - nodes.o) * N[:, None]).sum(2) / slant
        plane = nodes.o + t[:, :, None] * nodes.d
    size = np.linalg.norm(plane - plane[:, 4:5], axis=2).max(1)
    off = np.abs(((nodes.p - P[:, None]) * N[:, None]).sum(2))
    along = (nodes.n * N[:, None]).sum(2) > 1 - PLANE**2
    coplanar = candidates & along & (off <= PLANE * size[:, None])
    flat = ((t > 0) & (t < DEEPEST * t[of][:, None])).all(1) & (coplanar.sum(1) > 1)

    same = candidates & (nodes.shape == nodes.shape[of][:, None])
    away = np.where(same, np.linalg.norm(nodes.p - P[:, None], axis=2), 0).max(1)
    turned = np.where(same, np.linalg.norm(nodes.n - N[:, None], axis=2), 0).max(1)
    alone = same.sum(1) == 1
    away = np.where(alone, 0.5 * np.linalg.norm(nodes.p - nodes.o, axis=2)[of] * np.ptp(nodes.d, axis=1).max(1), away)
    return _Group(
        np.where(flat[:, None], plane[:, 4], P),
        N,
        np.where(flat, 1.01 * size, ROOM * away),
        np.where(flat, 0.0, np.where(alone, 2.0, ROOM * turned)),
        np.where(flat[:, None], coplanar, same),
        candidates.any(1),
    )


def _beside(group: _Group, square: Integers, second: NDArray[np.uint32], across: int, down: int) -> list[Integers]:
    """For each block the blocks around it that lie in the same plane, itself where none does."""
    flat = group.there & (group.bend == 0)
    own = np.arange(len(square))
    x, y = square % across, square // across
    found = []
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            there = (x + dx >= 0) & (x + dx < across) & (y + dy >= 0) & (y + dy < down) & (dx | dy != 0)
            beside = np.where(there, square + dy * across + dx, square)
            best = own.copy()
            for other in (beside, np.where(second[beside] == OUTSIDE, beside, second[beside]).astype(np.int64)):
                off = np.abs(((group.p[other] - group.p) * group.n).sum(1))
                same = flat & flat[other] & ((group.n[other] * group.n).sum(1) > 1 - PLANE**2)
                best = np.where(same & there & (off <= 4 * PLANE * group.radius), other, best)
            found.append(best)
    return found


def _blocks(group: _Group, nodes: _Nodes, beside: list[Integers]) -> Blocks:
    """On the device, with the samples on curved surfaces as blocks of their own, beside those that they are part of."""
    of, sample = np.nonzero(group.member & (group.there & (group.bend > 0))[:, None])
    n = len(group.p)
    around = np.stack(beside, axis=1)
    around[of, sample] = n + np.arange(len(of))
    around = np.concatenate([around, np.repeat(n + np.arange(len(of))[:, None], 9, axis=1)])
    zero = np.zeros(len(of))
    single = np.float32
    return Blocks(
        mi.Point3d(np.concatenate([group.p, nodes.p[of, sample]]).T),
        mi.Vector3f(np.concatenate([group.n, nodes.n[of, sample]]).T.astype(single)),
        mi.Float(np.append(group.radius, zero).astype(single)),
        mi.Float(np.append(group.bend, zero).astype(single)),
        mi.Bool(np.append(group.there, zero == 0)),
        mi.Bool(np.append(group.there, zero == 1)),
        tuple(mi.UInt32(b.astype(np.uint32)) for b in around.T),
    )
