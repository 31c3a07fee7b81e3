"""Outlines packed for the kernel: segments, and the pieces of chain that share one visibility ray."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import Types, on_device
from grimaldi.diffraction.hierarchy import Tree, tree
from grimaldi.diffraction.model import Options
from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Source, Vector

LONGEST_PIECE = 8  # segments


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
    ranges: Any
    pieces: Any
    tree: Tree  # of the pieces
    far: Any  # what lies at a larger Δ adds nothing
    types: Types

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

    def first(self, i: Any) -> Any:
        """First segment of a piece."""
        return dr.gather(type(self.ranges), self.ranges, i)

    def piece(self, i: Any) -> Piece:
        P, V = self.types.Packet, self.types.Vector
        a, b, c, d, e = (dr.gather(P, self.pieces, 5 * i + j) for j in range(5))
        index = type(self.ranges)
        return Piece(
            dr.gather(index, self.ranges, i),
            dr.gather(index, self.ranges, i + 1),
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


def cut(outline: Outline) -> NDArray[np.int64]:
    """First segments of the pieces, and the number of segments: runs of a chain, at most a 64th of a body's extent."""
    extent = {b: np.linalg.norm(np.ptp(outline.start[outline.body == b], axis=0)) for b in np.unique(outline.body)}
    lengths = np.linalg.norm(outline.end - outline.start, axis=1)
    first, in_piece, total = [], 0, 0.0
    for i, (length, chain) in enumerate(zip(lengths, outline.chain, strict=True)):
        if (
            i == 0
            or chain != outline.chain[i - 1]
            or np.isfinite(outline.behind[i]) != np.isfinite(outline.behind[i - 1])
            or in_piece == LONGEST_PIECE
            or total + length > extent[outline.body[i]] / 64
        ):
            first.append(i)
            in_piece, total = 0, 0.0
        in_piece += 1
        total += length
    return np.array([*first, len(lengths)], np.int64)


def needs_double(outline: Outline, k: float, options: Options) -> bool:
    """Whether Float32 corners, n of them in an outline k·extent radians wide, leave too much of the tolerance.

    Each is off by some k·extent·2⁻²⁴ radians, and no two alike. Where receivers lie beside edges, `boundary` tells.
    """
    if options.precision == "double" or options.tolerance < 5e-4:
        return True
    extent = np.ptp(np.concatenate([outline.start, outline.end]), axis=0).max()
    return k * float(extent) * len(outline) ** 0.5 * 2.0**-24 > 3 * options.tolerance


def table(
    outline: Outline,
    source: Source,
    types: Types,
    ranges: NDArray[np.int64] | None = None,
) -> Table:
    """Pack what a source sees; its pieces begin at the segments `ranges`, the last of which is their number (`cut`)."""
    ends = np.concatenate([outline.start, outline.end])
    low, high = ends.min(0), ends.max(0)
    # on a coarse grid, so that differences to it are exact and points stay as near each other as they were
    grid = 2.0 ** np.floor(np.log2(max(float(np.ptp(ends, axis=0).max()), 1e-300)) - 2)
    centre = grid * np.round(0.5 * (low + high) / grid)
    ranges = cut(outline) if ranges is None else ranges
    X0, X1 = outline.start - centre, outline.end - centre
    length = np.linalg.norm(X1 - X0, axis=1, keepdims=True)
    zero = np.zeros_like(length)
    segments = np.concatenate([X0, length, X1, zero, (X1 - X0) / length, outline.radius[:, None]], 1)
    middle = (ranges[:-1] + ranges[1:]) // 2
    target = 0.5 * (X0[middle] + X1[middle])
    reach = 0.5 * np.add.reduceat(length[:, 0], ranges[:-1])[:, None]
    normals = outline.normals[middle]
    closed = (np.linalg.norm(normals[:, 1], axis=1) > 0).astype(float)[:, None]
    of = outline.body[middle].astype(float)[:, None]
    behind = np.minimum.reduceat(np.minimum(outline.behind, 1e30), ranges[:-1])[:, None]
    pieces = np.concatenate(
        [
            *(target, reach, normals[:, 0], closed, normals[:, 1], of, outline.outward[middle], behind),
            *((X1 - X0)[ranges[:-1]] / length[ranges[:-1]], zero[: len(middle)]),
        ],
        1,
    )
    index = dr.uint32_array_t(types.Float)
    return Table(
        centre,
        float(np.linalg.norm(np.concatenate([X0, X1]), axis=1).max()),
        np.inf if source.position is None else float(outline.distances(source.position).min()),
        on_device(index, len(outline)),
        on_device(index, len(middle)),
        types.buffer(segments),
        index(ranges.astype(np.uint32)),
        types.buffer(pieces),
        tree(target, reach[:, 0], types, leaves_only=not np.isfinite(outline.far)),
        on_device(types.Float, min(outline.far, 1e30)),
        types,
    )
