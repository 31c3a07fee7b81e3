"""Faint pieces, whose ways X→P are not asked for at each receiver: marks say which corners of blocks' cells they reach.

A piece is faint where the wave of a chain that is cut off on it would be a small share of the tolerance. One that
reaches all four corners of a cell, or none, is taken to do so between them: thin shadows may be missed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.chains import exact
from grimaldi.diffraction.edges import Everywhere, cut_off, sounds
from grimaldi.diffraction.frame import Frame, frame
from grimaldi.diffraction.model import ACROSS, LATTICE, OUTSIDE, Blocks, Receivers
from grimaldi.diffraction.search import Search
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

FAINT = 0.03  # of the tolerance
FIRST = 1 | 2 | 1 << LATTICE | 2 << LATTICE  # corners of a block's first cell


class Marks(NamedTuple):
    """Of each block, and of each piece or run of pieces: the corners of cells that it is known not to reach, and those
    that it reaches; a bit for each corner."""

    corners: Any  # UInt32: two numbers for each
    items: Any  # how many pieces and runs
    faint: float  # |M| of a chain cut off on what is marked

    def at(self, receivers: Receivers) -> Marked:
        """What is known at receivers in blocks."""
        row = receivers.cell // ACROSS
        corner = row * LATTICE + (receivers.cell - row * ACROSS)
        return Marked(self, receivers.block != OUTSIDE, receivers.block * self.items, corner)


class Marked(NamedTuple):
    """What marks say of the cells in which receivers lie."""

    marks: Marks
    inside: Any  # whether a receiver lies in a block
    first: Any  # where that begins
    corner: Any  # the first one of its cell

    def reach(self, item: Any, left: Any) -> tuple[Any, Any]:
        """Which items are known not to reach receivers, and which to reach them, of those that leave |M| = left."""
        known = self.inside & (left < self.marks.faint)
        words = dr.gather(mi.Vector2u, self.marks.corners, self.first + item, known)
        hidden, reached = (((word >> self.corner) & FIRST) == FIRST for word in words)
        return known & hidden, known & reached


def marks(search: Search, blocks: Blocks) -> Marks:
    """Marks of all faint pieces, by a ray from each corner of cells that lies on its block's own surface."""
    number, items = dr.width(blocks.p), dr.width(search.tab.ranges) // 2
    found = Marks(dr.zeros(mi.UInt32, 2 * number * items), dr.opaque(mi.UInt32, items), FAINT * search.tolerance)
    index = dr.arange(mi.UInt32, LATTICE * LATTICE * number)
    block = index // (LATTICE * LATTICE)
    place = index - LATTICE * LATTICE * block
    active = dr.gather(mi.Bool, blocks.active, block)
    active &= ((dr.gather(mi.UInt32, blocks.members, block) >> place) & 1) != 0
    corners = Receivers(blocks.lattice, blocks.normals, active)
    dr.eval(corners)
    _mark(found, frame(search.source, blocks.lattice, search.tab), search, block * items, 1 << place, corners)
    dr.eval(found.corners)
    return found


@syntax
def _mark(found: Marks, fr: Frame, search: Search, first: Any, bit: Any, receivers: Receivers) -> None:
    """Walk as receivers do, and write down what faint items do there."""
    tab, walk = search.tab, Everywhere(search.tab)
    ray, there, _ = exact(fr, tab)
    n = there.types.Vector(receivers.n)
    i, end = walk.bounds(receivers)
    while receivers.active & (i < end):
        item, taken, inside = walk.visit(fr, i)
        if receivers.active & taken:
            piece = there.piece(item)
            left = cut_off(fr, tab.piece(item), search.k)
            asked = sounds(ray, piece, n) & (left > search.share) & (left < found.faint)
            if asked:
                reached = search.reaches(piece, receivers.p, receivers.n, asked)
                dr.scatter_add(found.corners, bit, 2 * (first + item) + dr.select(reached, mi.UInt32(1), 0), asked)
        i = walk.after(i, inside)
