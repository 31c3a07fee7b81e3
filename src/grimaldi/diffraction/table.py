"""Outlines packed for the kernel: segments, and the pieces of chain that share one visibility ray."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import Types, buffer, on_device
from grimaldi.diffraction.hierarchy import NONE, Layout, Tree, flat, layout
from grimaldi.diffraction.model import Options
from grimaldi.outlines.model import Outline, Reals
from grimaldi.scene.model import Source, Vector

LONGEST_PIECE = 8  # segments
SINGLE = 5e-4  # tolerance from which on Float32 serves
MANY = 2048  # pieces, that a hierarchy pays for: receivers beside each other go different ways through it


class Segment(NamedTuple):
    X0: Any
    X1: Any
    e: Any
    length: Any
    radius: Any  # of curvature of the surface along the ray, 0 where the rim is sharp


class Piece(NamedTuple):
    """A few neighbouring segments; the middle of its middle segment stands for all in the tests of what blocks X→P."""

    first: Any
    end: Any
    middle: Any
    reach: Any  # half its length
    lit: Any  # normals of the faces at the middle, towards the source first
    dark: Any
    body: Any  # of the scene; below 0 for planar outlines
    closed: Any  # 1 where two faces meet, 0 at the border of a sheet
    outward: Any
    behind: Any  # how far behind it its own body comes next
    e: Any  # along its first segment


class Table(NamedTuple):
    """An outline about its centre (3,) in Float64, as flat device buffers."""

    centre: Vector
    reach: float  # from the centre to the furthest corner
    from_source: float  # from the source to the nearest segment, infinite for a plane wave
    size: Any  # segments
    n_pieces: Any
    segments: Any
    ranges: Any  # first segment and the one after the last, of pieces and then of longer runs
    pieces: Any
    piece_of: Any  # of each segment
    follows: Any  # of each piece: whether it begins where the one before it ends
    tree: Tree  # of pieces and runs
    far: Any  # what lies at a larger Δ adds nothing
    angle: Any  # half of what a run of pieces subtends at most about the ray, to reach the receiver or not as one [rad]
    types: Types
    exact: Exact | None = None  # what tells phases, where numbers of these types are not enough

    def device(self, number: float) -> Any:
        """A number that is no part of the kernel."""
        return on_device(self.types.Float, number)

    def segment(self, i: Any) -> Segment:
        P, V = self.types.Packet, self.types.Vector
        a, b, c = (dr.gather(P, self.segments, 3 * i + j) for j in range(3))
        return Segment(V(a.x, a.y, a.z), V(b.x, b.y, b.z), V(c.x, c.y, c.z), a.w, c.w)

    def corner(self, i: Any, end: int) -> Any:
        """Where a segment begins (0) or ends (1)."""
        a = dr.gather(self.types.Packet, self.segments, 3 * i + end)
        return self.types.Vector(a.x, a.y, a.z)

    def range(self, i: Any) -> tuple[Any, Any]:
        """First segment of a piece, and the one after its last."""
        index = type(self.ranges)
        return dr.gather(index, self.ranges, 2 * i), dr.gather(index, self.ranges, 2 * i + 1)

    def piece_at(self, segment: Any) -> Any:
        """The piece that a segment is part of."""
        return dr.gather(type(self.piece_of), self.piece_of, segment)

    def sphere(self, i: Any) -> tuple[Any, Any]:
        """Middle and reach of a piece."""
        a = dr.gather(self.types.Packet, self.pieces, 5 * i)
        return self.types.Vector(a.x, a.y, a.z), a.w

    def piece(self, i: Any) -> Piece:
        P, V = self.types.Packet, self.types.Vector
        a, b, c, d, e = (dr.gather(P, self.pieces, 5 * i + j) for j in range(5))
        return Piece(
            *self.range(i),
            V(a.x, a.y, a.z),
            a.w,
            V(b.x, b.y, b.z),
            V(c.x, c.y, c.z),
            c.w,
            b.w,
            V(d.x, d.y, d.z),
            d.w,
            V(e.x, e.y, e.z),
        )


class Exact(NamedTuple):
    """A table, and k, in the precision of phases."""

    table: Table
    k: Any


def cut(outline: Outline) -> NDArray[np.int64]:
    """First segments of the pieces, and the number of segments: runs of a chain, a 64th of a body's extent or less."""
    bodies, of = np.unique(outline.body, return_inverse=True)
    low, high = (np.full((len(bodies), 3), sign * np.inf) for sign in (1, -1))
    np.minimum.at(low, of, outline.start)
    np.maximum.at(high, of, outline.start)
    most = (1 / 64 * np.linalg.norm(high - low, axis=1))[of]
    n = len(outline)
    along = np.append(0, np.cumsum(np.linalg.norm(outline.end - outline.start, axis=1)))
    inner = np.isfinite(outline.behind)
    new = np.append(True, (outline.chain[1:] != outline.chain[:-1]) | (inner[1:] != inner[:-1]))[:n]
    begin = np.flatnonzero(new)
    stop = np.repeat(np.append(begin[1:], n), np.diff(np.append(begin, n)))
    # where a piece that begins at each segment would end: all chains walk on at once
    index = np.arange(n)
    end = np.searchsorted(along, along[:-1] + most, side="right") - 1
    end = np.minimum(np.clip(end, index + 1, index + LONGEST_PIECE), stop)
    first = np.zeros(n + 1, bool)
    first[n] = True
    while len(begin):
        first[begin] = True
        begin = end[begin[end[begin] < stop[begin]]]
    return np.flatnonzero(first)


def may_be_single(options: Options) -> bool:
    """Whether Float32 tells enough of all but phases."""
    return options.precision == "auto" and options.tolerance >= SINGLE


def needs_double(outline: Outline, k: float, options: Options) -> bool:
    """Whether Float32 corners, n of them in an outline k·extent radians wide, leave too much of the tolerance.

    Each is off by some k·extent·2⁻²⁴ radians, and no two alike. Where receivers lie beside edges, `boundary` tells.
    """
    if not may_be_single(options):
        return True
    extent = np.ptp(np.concatenate([outline.start, outline.end]), axis=0).max()
    return k * float(extent) * len(outline) ** 0.5 * 2.0**-24 > 3 * options.tolerance


class Packed(NamedTuple):
    """An outline about its centre as rows of numbers, for tables in either precision."""

    centre: Vector
    reach: float
    from_source: float
    segments: Reals  # (n, 12)
    runs: NDArray[np.int64]  # (m, 2) first segment and the one after the last, of pieces and then of longer runs
    pieces: Reals  # (m, 20)
    ranges: NDArray[np.int64]
    follows: NDArray[np.bool_]
    plan: Layout
    item: NDArray[np.int64]
    far: float

    def on(self, types: Types, angle: float = 0.0, k: float = 0.0) -> Table:
        """The table in some precision; angle as in `Table`, k needed where phases have a precision of their own."""
        exact = None
        if types.phases is not None:
            table = self.on(types.phases, angle)
            exact = Exact(table, table.device(k))
        index = dr.uint32_array_t(types.Float)
        return Table(
            centre=self.centre,
            reach=self.reach,
            from_source=self.from_source,
            size=on_device(index, len(self.segments)),
            n_pieces=on_device(index, len(self.plan.order)),
            segments=types.buffer(self.segments),
            ranges=buffer(index, self.runs),
            pieces=types.buffer(self.pieces),
            piece_of=buffer(index, np.repeat(np.arange(len(self.ranges) - 1), np.diff(self.ranges))),
            follows=buffer(dr.mask_t(types.Float), self.follows),
            tree=self.plan.tree(self.item, types),
            far=on_device(types.Float, min(self.far, 1e30)),
            angle=on_device(types.Float, angle),
            types=types,
            exact=exact,
        )


def packed(outline: Outline, source: Source, ranges: NDArray[np.int64] | None = None) -> Packed:
    """Pack what a source sees; its pieces begin at the segments `ranges`, the last of which is their number (`cut`)."""
    ends = np.concatenate([outline.start, outline.end])
    low, high = ends.min(0), ends.max(0)
    # on a coarse grid, so that differences to it are exact and points stay as near each other as they were
    grid = 2.0 ** np.floor(np.log2(max(float(np.ptp(ends, axis=0).max()), 1e-300)) - 2)
    centre = grid * np.round(0.5 * (low + high) / grid)
    X0, X1 = outline.start - centre, outline.end - centre
    length = np.linalg.norm(X1 - X0, axis=1, keepdims=True)
    zero = np.zeros_like(length)
    segments = np.concatenate([X0, length, X1, zero, (X1 - X0) / length, outline.radius[:, None]], 1)
    if ranges is None:
        ranges = cut(outline)
    plan, runs, item = (_plan if np.isfinite(outline.far) else _pieces_alone)(outline, X0, X1, ranges)
    first, end = runs.T
    middle = (first + end) // 2
    target = 0.5 * (X0[middle] + X1[middle])
    walked = np.append(0, np.cumsum(length))
    reach = 0.5 * (walked[end] - walked[first])[:, None]
    normals = outline.normals[middle]
    closed = (np.linalg.norm(normals[:, 1], axis=1) > 0).astype(float)[:, None]
    of = outline.body[middle].astype(float)[:, None]
    far_behind = np.append(np.minimum(outline.behind, 1e30), 1e30)
    behind = np.minimum.reduceat(far_behind, runs.ravel())[::2, None]  # over first..end: every other of the slices
    pieces = np.concatenate(
        [
            *(target, reach, normals[:, 0], closed, normals[:, 1], of, outline.outward[middle], behind),
            *((X1 - X0)[first] / length[first], np.zeros((len(middle), 1))),
        ],
        1,
    )
    return Packed(
        centre,
        float(np.linalg.norm(np.concatenate([X0, X1]), axis=1).max()),
        np.inf if source.position is None else float(outline.distances(source.position).min()),
        segments,
        runs,
        pieces,
        ranges,
        np.append(False, outline.chain[ranges[1:-1]] == outline.chain[ranges[1:-1] - 1]),
        plan,
        item,
        outline.far,
    )


def _spheres(X0: Reals, X1: Reals, ranges: NDArray[np.int64]) -> tuple[Reals, Reals]:
    """Centre and radius round the segments of each piece."""
    low = np.minimum.reduceat(np.minimum(X0, X1), ranges[:-1])
    high = np.maximum.reduceat(np.maximum(X0, X1), ranges[:-1])
    return 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)


def _pieces_alone(
    _: Outline, X0: Reals, X1: Reals, ranges: NDArray[np.int64]
) -> tuple[Layout, NDArray[np.int64], NDArray[np.int64]]:
    """Pieces one after the other: their layout, the segments of each, and what the nodes stand for."""
    plan = flat(*_spheres(X0, X1, ranges))
    return plan, np.stack([ranges[:-1], ranges[1:]], axis=1), plan.begin


def _plan(
    outline: Outline, X0: Reals, X1: Reals, ranges: NDArray[np.int64]
) -> tuple[Layout, NDArray[np.int64], NDArray[np.int64]]:
    """The same as a hierarchy, whose nodes stand for runs of pieces where these follow each other in a chain."""
    first = ranges[:-1]
    plan = layout(*_spheres(X0, X1, ranges), outline.body[first])
    a, b = plan.order[plan.begin], plan.order[plan.end - 1]
    inner = np.isfinite(outline.behind)
    same = (outline.chain[first[a]] == outline.chain[first[b]]) & (b - a == plan.end - plan.begin - 1)
    changes = np.append(0, np.cumsum(inner[1:] != inner[:-1]))
    same &= changes[first[a]] == changes[first[b]]
    long = np.flatnonzero(same & (b > a))
    item = np.where(b == a, a, NONE)
    item[long] = len(first) + np.arange(len(long))
    runs = np.stack([np.append(first, first[a[long]]), np.append(ranges[1:], ranges[b[long] + 1])], axis=1)
    return plan, runs, item
