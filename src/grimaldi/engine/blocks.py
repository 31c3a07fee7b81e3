"""The film cut into squares: what the camera sees in each is a block of receivers, or a few of different surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import buffer
from grimaldi.diffraction.model import ACROSS, LATTICE, OUTSIDE, Blocks, Boxes, Receivers

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

SIDE = 16  # pixels
MOST = 3  # blocks of a square
ROOM = 2.2  # times what the samples of a curved surface differ by
BULK = 0.2  # of the largest distance of a sample, that the box about them goes as far on either side at least
DEEPEST = 4.0  # times the distance of a sample, that its plane may be seen at within a square
FACE = 4  # samples of a plane, that have a block of their own: smaller facets are a curved surface together
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
    """Blocks for some rows of a film, `across` squares in a row; `further`: the second, … block of each square."""

    blocks: Blocks
    further: tuple[Any, ...]
    across: Any
    down: Any
    top: Any

    def placed(self, x: Any, y: Any, receivers: Receivers) -> Receivers:
        """Receivers seen at places of the film [pixels], with their blocks and cells."""
        u, v = x * (ACROSS / SIDE), (y - self.top) * (ACROSS / SIDE)
        x = dr.minimum(mi.UInt32(u), self.across * ACROSS - 1)
        y = dr.minimum(mi.UInt32(v), self.down * ACROSS - 1)
        square = (y // ACROSS) * self.across + x // ACROSS
        block = self.blocks.of(receivers, square)
        for index in self.further:
            other = self.blocks.of(receivers, dr.gather(mi.UInt32, index, square))
            block = dr.select(block == OUTSIDE, other, block)
        cell = (y % ACROSS) * ACROSS + x % ACROSS
        return receivers._replace(block=block, cell=cell, u=u - mi.Float(x), v=v - mi.Float(y))


MIDDLE = LATTICE * LATTICE // 2


class _Nodes(NamedTuple):
    """Samples at the corners of each square's cells, row by row: (squares, LATTICE², 3) and (squares, LATTICE²)."""

    o: Reals
    d: Reals
    p: Reals
    n: Reals
    shape: Integers
    lit: NDArray[np.bool_]

    def of(self, squares: Integers) -> _Nodes:
        o, d, p, n, shape, lit = self
        return _Nodes(o[squares], d[squares], p[squares], n[squares], shape[squares], lit[squares])


class _Group(NamedTuple):
    """A block of each square, about the surface that one of its samples lies on."""

    p: Reals  # (squares, 3)
    n: Reals
    radius: Reals  # (squares,)
    bend: Reals
    member: NDArray[np.bool_]  # (squares, LATTICE²): the samples that lie in it
    there: NDArray[np.bool_]  # (squares,): whether there is any
    lattice: Reals  # (squares, LATTICE², 3): where the samples' rays meet its plane, if it has one
    normals: Reals

    def and_those_of(self, other: _Group) -> _Group:
        """Both, one after the other."""
        joined: list[Any] = [np.concatenate(pair) for pair in zip(self, other, strict=True)]
        return _Group(*joined)


def squares(see: Callable[[Any, Any], Sight], width: int, top: int, rows: int) -> Squares:
    """The blocks of `rows` rows of a film `width` pixels wide, from row `top` on."""
    across, down = -(-width // SIDE), -(-rows // SIDE)
    nodes = _nodes(see, across, down, top)
    groups = _group(nodes, np.where(nodes.lit[:, MIDDLE], MIDDLE, nodes.lit.argmax(1)), nodes.lit)
    square = np.arange(across * down)
    left = nodes.lit & ~groups.member
    further: list[Integers] = []
    for _ in range(1, MOST):
        having = np.flatnonzero(left.any(1))
        more = _group(nodes.of(having), left[having].argmax(1), left[having])
        index = np.full(across * down, OUTSIDE)
        index[having] = len(square) + np.arange(len(having))
        left[having] &= ~more.member
        groups, square = groups.and_those_of(more), np.append(square, having)
        further.append(index)
    return Squares(
        _blocks(groups, _beside(groups, square, further, across, down)),
        tuple(buffer(mi.UInt32, index) for index in further),
        dr.opaque(mi.UInt32, across),
        dr.opaque(mi.UInt32, down),
        dr.opaque(mi.Float, top),
    )


def _nodes(see: Callable[[Any, Any], Sight], across: int, down: int, top: int) -> _Nodes:
    """What the camera sees at the corners of cells."""
    columns = ACROSS * across + 1
    y, x = (buffer(mi.Float, v) for v in np.mgrid[: ACROSS * down + 1, :columns] * (SIDE // ACROSS))
    sight = see(x, y + top)
    r = sight.receivers
    dr.eval(sight.ray.o, sight.ray.d, r.p, r.n, sight.shape, r.active)
    square = np.arange(across * down)
    corner = ACROSS * (square // across) * columns + ACROSS * (square % across)
    at = corner[:, None] + np.add.outer(np.arange(LATTICE) * columns, np.arange(LATTICE)).ravel()
    o, d, p, n = (np.array(v, np.float64).T for v in (sight.ray.o, sight.ray.d, r.p, r.n))
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)  # of Float32, PLANE is finer than that
    every: list[Any] = [
        np.broadcast_to(v, (len(x), *v.shape[1:]))[at]  # what is the same everywhere is there once
        for v in (o, d, p, n, sight.shape.numpy().astype(np.int64), r.active.numpy())
    ]
    return _Nodes(*every)


def _group(nodes: _Nodes, seed: Integers, candidates: NDArray[np.bool_]) -> _Group:
    """The block of the surface that sample `seed` of each square lies on, of samples that are `candidates`."""
    of = np.arange(len(seed)), seed
    P, N = nodes.p[of], nodes.n[of]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = _along(P[:, None] - nodes.o, N) / _along(nodes.d, N)
        plane = nodes.o + t[:, :, None] * nodes.d
    size = _length(plane - plane[:, MIDDLE : MIDDLE + 1]).max(1)
    off = np.abs(_along(nodes.p - P[:, None], N))
    along = _along(nodes.n, N) > 1 - PLANE**2
    coplanar = candidates & along & (off <= PLANE * size[:, None])
    flat = ((t > 0) & (t < DEEPEST * t[of][:, None])).all(1) & (np.count_nonzero(coplanar, axis=1) >= FACE)

    same = candidates & (nodes.shape == nodes.shape[of][:, None])
    away = np.where(same, _length(nodes.p - P[:, None]), 0).max(1)
    turned = np.where(same, _length(nodes.n - N[:, None]), 0).max(1)
    alone = np.count_nonzero(same, axis=1) == 1
    (single,) = np.nonzero(alone)
    distance = np.linalg.norm(P[single] - nodes.o[single, seed[single]], axis=1)
    away[single] = 0.5 * distance * np.ptp(nodes.d[single], axis=1).max(1)
    return _Group(
        np.where(flat[:, None], plane[:, MIDDLE], P),
        N,
        np.where(flat, 1.01 * size, ROOM * away),
        np.where(flat, 0.0, np.where(alone, 2.0, ROOM * turned)),
        np.where(flat[:, None], coplanar, same),
        np.any(candidates, axis=1),
        np.where(flat[:, None, None], plane, nodes.p),
        np.where(flat[:, None, None], N[:, None], nodes.n),
    )


def _along(v: Reals, n: Reals) -> Reals:
    """How far vectors (squares, m, 3) go along those of their squares (squares, 3); NumPy sums rows of three slowly."""
    return np.einsum("smi,si->sm", v, n)


def _length(v: Reals) -> Reals:
    """Of vectors (squares, m, 3)."""
    return np.sqrt(np.einsum("smi,smi->sm", v, v))


def _beside(group: _Group, square: Integers, further: list[Integers], across: int, down: int) -> list[Integers]:
    """For each block the blocks around it that lie in the same plane, itself where none does."""
    flat = group.there & (group.bend == 0)
    own = np.arange(len(square))
    x, y = square % across, square // across
    found = []
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1) if dy else (-1, 1):
            there = (x + dx >= 0) & (x + dx < across) & (y + dy >= 0) & (y + dy < down)
            beside = np.where(there, square + dy * across + dx, square)
            best = own.copy()
            for other in (beside, *(np.where(index[beside] == OUTSIDE, beside, index[beside]) for index in further)):
                off = np.abs(((group.p[other] - group.p) * group.n).sum(1))
                same = flat & flat[other] & ((group.n[other] * group.n).sum(1) > 1 - PLANE**2)
                best = np.where(same & there & (off <= 4 * PLANE * group.radius), other, best)
            found.append(best)
    return found


def _blocks(group: _Group, beside: list[Integers]) -> Blocks:
    """On the device."""
    single = np.float32
    right, down = _pixel(group)
    return Blocks(
        p=mi.Point3d(group.p.T),
        n=mi.Vector3f(group.n.T.astype(single)),
        radius=buffer(mi.Float, group.radius),
        bend=buffer(mi.Float, group.bend),
        active=buffer(mi.Bool, group.there),
        lattice=mi.Point3d(group.lattice.reshape(-1, 3).T),
        normals=mi.Vector3f(group.normals.reshape(-1, 3).T.astype(single)),
        right=mi.Vector3f(right.T.astype(single)),
        down=mi.Vector3f(down.T.astype(single)),
        members=_bits(group.member | (group.bend == 0)[:, None]),
        boxes=_boxes(group),
        beside=tuple(buffer(mi.UInt32, b) for b in beside),
    )


def _boxes(group: _Group) -> Boxes:
    """Those of curved blocks hold their samples, along the axes in which these are spread out most and least.

    A single sample that parallel rays see has a block, but no box.
    """
    curved = group.there & (group.bend > 0)
    x, member = group.lattice[curved], group.member[curved][:, :, None]
    d = x - group.p[curved][:, None]
    d -= ((d * member).sum(1) / member.sum(1))[:, None]
    axes = np.linalg.eigh(np.einsum("bsi,bsj->bij", d * member, d))[1].swapaxes(1, 2)
    along = np.einsum("bsi,bai->bsa", d, axes)
    low, high = np.where(member, along, np.inf).min(1), np.where(member, along, -np.inf).max(1)
    least = BULK * group.radius[curved, None] / ROOM
    half = np.maximum(0.5 * (high - low), least)
    middle, rows = group.p.copy(), np.zeros((len(group.p), 3, 4))
    middle[curved] = x[:, 0] - d[:, 0] + np.einsum("ba,bai->bi", 0.5 * (low + high), axes)
    rows[curved, :, :3] = axes * np.divide(1, half, out=np.zeros_like(half), where=half > 0)[:, :, None]
    return Boxes(mi.Point3d(middle.T), buffer(mi.Float, rows))


def _pixel(group: _Group) -> tuple[Reals, Reals]:
    """A pixel's way along rows and columns (squares, 3), on planes."""
    corner, right, down = (group.lattice[:, i] for i in (0, LATTICE - 1, LATTICE * (LATTICE - 1)))
    flat = (group.bend == 0)[:, None]
    return np.where(flat, (right - corner) / SIDE, 0), np.where(flat, (down - corner) / SIDE, 0)


def _bits(flags: NDArray[np.bool_]) -> Any:
    """Rows of flags (n, m) as numbers (n,)."""
    return buffer(mi.UInt32, (flags << np.arange(flags.shape[1])).sum(1))
