"""Edges in a source's view, cut into short pieces that can be found by their boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.candidate import Candidates
from grimaldi.outlines.model import Integers, Reals
from grimaldi.outlines.overlaps import Index
from grimaldi.outlines.view import View

LONGEST = 1 / 32  # of the view, of a piece
LONGER = 4.0  # times the mean edge, is what gets cut
TINY = 1e-12  # of the view's extent: rounding


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of edges, one edge's after the other's."""

    edge: Integers  # (p,) whose piece it is
    first: Integers  # (n,) of each edge
    count: Integers  # (n,) of each edge, equal steps of its parameter
    low: Reals  # (3, p) box in view
    high: Reals  # (3, p)
    normal: Reals  # (3, p) unit, in view: of the plane through the source and the edge, or across the edge; outwards
    offset: Reals  # (p,) of that plane
    ends: Reals  # (2, 3, p) the edge's ends in view
    margin: Reals  # (p,) how far beside it in view points of it may be asked for
    tiny: float  # rounding in view
    index: Index

    def __len__(self) -> int:
        return len(self.edge)

    @staticmethod
    def of(view: View, edges: Candidates, beside: float) -> Pieces:
        """Pieces of n >= 1 edges; points up to `beside` [scene units] from an edge count as its own."""
        a, b = np.ascontiguousarray(edges.start.T), np.ascontiguousarray(edges.end.T)
        ends = np.stack([view(a), view(b)])
        length = np.sqrt(((ends[1] - ends[0]) ** 2).sum(axis=0))
        extent = float(np.ptp(ends, axis=(0, 2)).max()) if view.source.is_plane else 1.0
        longest = max(min(LONGEST * extent, LONGER * float(length.mean())), TINY)
        count = np.maximum(np.ceil(length / longest), 1).astype(np.int64)
        edge = np.repeat(np.arange(len(edges)), count)
        first = np.cumsum(count) - count
        step = np.arange(len(edge)) - first[edge]
        low, high = step / count[edge], (step + 1) / count[edge]
        span = b - a
        margin = np.full(len(edge), beside)
        if view.source.position is not None:
            v = view.source.position[:, None] - a
            t = np.clip((v * span).sum(axis=0) / np.maximum((span * span).sum(axis=0), 1e-300), 0, 1)
            margin = np.minimum(2 * beside / np.maximum(np.sqrt(((v - t * span) ** 2).sum(axis=0)), 1e-300), 2.0)[edge]
            normal = np.cross(ends[1], ends[0], axis=0)
        else:
            normal = np.stack([ends[1, 1] - ends[0, 1], ends[0, 0] - ends[1, 0], np.zeros(len(edges))])
        size = np.sqrt((normal * normal).sum(axis=0))
        normal = np.divide(normal, size, out=np.zeros_like(normal), where=size > TINY * extent)
        offset = np.zeros(len(edges)) if view.source.position is not None else (normal * ends[0]).sum(axis=0)
        corners = (view(a[:, edge] + t * span[:, edge]) for t in (low, high))
        boxes = view.boxes(*corners, margin=margin)
        return Pieces(
            edge,
            first,
            count,
            *boxes,
            np.ascontiguousarray(normal[:, edge]),
            offset[edge],
            np.ascontiguousarray(ends[:, :, edge]),
            margin,
            TINY * max(float(np.abs(ends).max()), 1e-300),
            Index(*boxes),
        )

    def holding(self, edge: Integers, t: Reals) -> Integers:
        """The piece that parameter t (k,) of an edge (k,) lies on."""
        count = self.count[edge]
        return self.first[edge] + np.clip((t * count).astype(np.int64), 0, count - 1)

    def may_be_met(self, piece: Integers, corners: Sequence[Reals]) -> NDArray[np.bool_]:
        """Whether lines of sight to a piece, or to points beside it, can meet triangles, three corners (3, k).

        They do not meet those on the far side of a plane beside the edge, nor those on the edge's inner side that
        touch it at one end at most.
        """
        (nx, ny, nz), offset = self.normal.take(piece, axis=1), self.offset[piece]
        far = self.margin[piece] + self.tiny
        outer, inner = np.ones(len(piece), bool), np.ones(len(piece), bool)
        for corner in corners:
            height = nx * corner[0] + ny * corner[1] + nz * corner[2] - offset
            outer &= height > far
            below = height < -self.tiny
            touching = np.flatnonzero(~below & (height <= self.tiny) & inner)
            ends = self.ends.take(piece[touching], axis=2)
            below[touching] = (np.abs(ends - corner[:, touching]).max(axis=1) <= self.tiny).any(axis=0)
            inner &= below
        return ~(inner | outer)
