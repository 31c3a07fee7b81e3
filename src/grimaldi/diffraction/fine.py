"""Receivers between the corners of blocks' cells: where the film shows the plane of a flat block half a cell on."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.frame import Frames
from grimaldi.diffraction.model import ACROSS, LATTICE, Blocks
from grimaldi.diffraction.search import Search

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

FINE = 2 * LATTICE - 1  # of them across a block


class Fine(NamedTuple):
    """Those of each block, row by row: every other one of every other row is a corner of its lattice.

    Between the corners of a curved block they are no receivers.
    """

    p: Any  # Float64 (3)
    frames: Frames

    @staticmethod
    def of(search: Search, blocks: Blocks) -> Fine:
        """Those of blocks."""
        p = between(blocks)
        dr.schedule(p)  # in the same kernel
        return Fine(p, search.frames(p))


def place(block: Any, row: Any, column: Any) -> Any:
    """Where one stands among all."""
    return (block * FINE + row) * FINE + column


def corner(block: Any, i: Any) -> Any:
    """Where the i-th corner of a block's lattice stands among all."""
    row = i // LATTICE
    return place(block, 2 * row, 2 * (i - row * LATTICE))


def between(blocks: Blocks) -> Any:
    """Their points. The film sees planes at a slant: between corners, a quadratic tells them by the three about."""
    index = dr.arange(mi.UInt32, FINE * FINE * dr.width(blocks.p))
    block = index // (FINE * FINE)
    row = (index - block * (FINE * FINE)) // FINE
    column = index % FINE
    first, weights = [], []
    for i in (row, column):
        part = dr.minimum(i // ACROSS, 1)
        t = mi.Float64(i - ACROSS * part) / ACROSS
        first.append(2 * part)
        weights.append(((1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)))
    lattice = type(blocks.lattice)
    corner = block * (LATTICE * LATTICE) + first[0] * LATTICE + first[1]
    between = lattice(0)
    for n, of_row in enumerate(weights[0]):
        for m, of_column in enumerate(weights[1]):
            at = dr.gather(lattice, blocks.lattice, corner + n * LATTICE + m)
            between += of_row * of_column * at
    own = dr.gather(lattice, blocks.lattice, block * (LATTICE * LATTICE) + row // 2 * LATTICE + column // 2)
    return dr.select((row % 2 == 0) & (column % 2 == 0), own, between)
