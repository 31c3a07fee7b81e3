"""How far pieces reach the blocks that they may reach in part: which corners of cells, and where that is not enough."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.edges import cut_off, sounds
from grimaldi.diffraction.fine import Fine, place
from grimaldi.diffraction.fine import corner as corner_place
from grimaldi.diffraction.frame import Frames
from grimaldi.diffraction.hierarchy import NONE
from grimaldi.diffraction.lists import FINELY, INNER, places
from grimaldi.diffraction.model import ACROSS, LATTICE, LEFT, UP, Blocks
from grimaldi.diffraction.search import Pairs, Search

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

FAINT = 0.1  # of the tolerance: |M| at all four corners of a cell of an end that grows evenly between them
STRONG = 0.5  # and of one that grows so between INNER × INNER places of it, or corners on a curved block
ALL = (1 << ACROSS * ACROSS) - 1  # cells
EVERY = (1 << LATTICE * LATTICE) - 1  # corners
FIRST_ROW = sum(1 << x for x in range(1, LATTICE))  # but for the very first corner, that only its own block asks for
FIRST_COLUMN = sum(1 << (y * LATTICE) for y in range(1, LATTICE))
LAST_ROW, LAST_COLUMN = (LATTICE - 1) * LATTICE, LATTICE - 1  # bits further on, that blocks beside have those
COARSE = sum(1 << (y * LATTICE + x) for y in range(0, LATTICE, 2) for x in range(0, LATTICE, 2))  # every other corner


class Verdicts(NamedTuple):
    """Of pairs that are tested, a bit for each cell where to ask at every receiver, or where to look more finely; and
    for each corner of cells that they reach."""

    asked: Any
    finely: Any
    reached: Any

    @property
    def any(self) -> Any:
        """Which pairs are on some list of cells."""
        return (self.asked | self.finely | self.reached) != 0

    def but(self, pairs: Any) -> Verdicts:
        """Those of others."""
        found = Verdicts(*(dr.select(pairs, 0, bits) for bits in self))
        dr.eval(*found)
        return found


def verdicts_of(
    search: Search, blocks: Blocks, fine: Fine, pairs: Pairs, tested: Any, weak: Any, passes: Any
) -> Verdicts:
    """What is known of pairs that are `tested`, by a ray to each corner on the block's own surface.

    Where those nearest to a cell differ, a weak piece grows evenly between them; others are looked at more finely,
    or asked for at every receiver if they are strong or pass other silhouettes.
    """
    verdicts = Verdicts(*(dr.zeros(mi.UInt32, len(tested)) for _ in range(3)))
    pair: Any = dr.compress(tested)
    if len(pair) == 0:
        return verdicts
    if search.probe is None:
        dr.scatter(verdicts.asked, mi.UInt32(ALL), pair)
        return verdicts
    members = dr.gather(mi.UInt32, blocks.members, dr.gather(mi.UInt32, pairs.block, pair))
    weak, passes = (dr.gather(mi.Bool, flags, pair) for flags in (weak, passes))
    first = members & dr.select(weak & ((members & COARSE) != 0), mi.UInt32(COARSE), EVERY)
    beside = _beside(search, blocks, pairs, pair)
    bits = _reached(search, blocks, fine, pairs, pair, beside, first)
    told, reached = _between(bits, first)
    bits |= reached & members
    bits |= _reached(search, blocks, fine, pairs, pair, beside, members & ~first & ~told)
    filled = _filled(bits, members)
    uniform = (bits == 0) | (bits == members)
    strong = ~weak & (~uniform | passes)
    left = _left(search, fine.frames, pairs, pair, strong)
    bends = dr.gather(mi.Float, blocks.bend, dr.gather(mi.UInt32, pairs.block, pair)) > 0
    faint = dr.select(weak, EVERY, dr.select(bends, left[1], left[0]))
    ask, finely = mi.UInt32(0), mi.UInt32(0)
    for y in range(ACROSS):
        for x in range(ACROSS):
            own = sum(1 << ((y + dy) * LATTICE + x + dx) for dy in (0, 1) for dx in (0, 1))
            same = ((filled & own) == own) | ((filled & own) == 0)
            clear = ~passes & same
            differs = ~(((faint & own) == own) | clear)
            tells = ~passes & ~bends & ((left[1] & own) == own)
            ask |= dr.select(differs & ~tells, 1 << (y * ACROSS + x), 0)
            finely |= dr.select(differs & tells, 1 << (y * ACROSS + x), 0)
    for verdict, of_pairs in zip(verdicts, (ask, finely, filled), strict=True):
        dr.scatter(verdict, of_pairs, pair)
    dr.eval(*verdicts)
    return verdicts


def _left(search: Search, frames: Frames, pairs: Pairs, pair: Any, some: Any) -> tuple[Any, Any]:
    """At which corners of cells a chain cut off on the pieces of some pairs leaves less than FAINT of the tolerance,
    and less than STRONG; a bit for each."""
    tab, corners = search.tab, LATTICE * LATTICE
    some = places(some)
    index = dr.arange(mi.UInt32, len(some) * corners)
    of = index // corners
    place, entry = index - of * corners, dr.gather(mi.UInt32, some, of)
    own = dr.gather(mi.UInt32, pair, entry)
    at = corner_place(dr.gather(mi.UInt32, pairs.block, own), place)
    left = cut_off(frames.some(at), tab.piece(dr.gather(mi.UInt32, pairs.piece, own)), search.k)
    found = dr.zeros(mi.UInt32, len(pair)), dr.zeros(mi.UInt32, len(pair))
    for bits, most in zip(found, (FAINT, STRONG), strict=True):
        dr.scatter_add(bits, dr.select(left < most * search.tolerance, mi.UInt32(1) << place, 0), entry)
    dr.eval(*found)
    return found


def _between(bits: Any, known: Any) -> tuple[Any, Any]:
    """Which corners of a lattice lie between others that are alike, of those known; and which of these are reached.

    In each quarter by its own four; everywhere if all known ones are alike.
    """
    alike, none = (bits == known) & (known != 0), bits == 0
    told, reached = dr.select(alike | none, mi.UInt32(EVERY), 0), dr.select(alike, mi.UInt32(EVERY), 0)
    half = ACROSS // 2
    for y in (0, half):
        for x in (0, half):
            own = sum(1 << ((y + dy) * LATTICE + x + dx) for dy in range(half + 1) for dx in range(half + 1))
            four = own & COARSE
            every, any_ = (bits & four) == four, (bits & four) != 0
            same = ((known & four) == four) & (every | ~any_)
            told |= dr.select(same, own, 0)
            reached |= dr.select(same & every, own, 0)
    return told, reached


def _filled(bits: Any, members: Any) -> Any:
    """Bits of a lattice's corners that are no members as those of the members nearest to them."""
    column = [sum(1 << (row * LATTICE + x) for row in range(LATTICE)) for x in range(LATTICE)]
    inner = ((1 << LATTICE * LATTICE) - 1) ^ column[0]

    def beside(flags: Any) -> Any:
        flags = flags | ((flags << 1) & inner) | ((flags >> 1) & (inner >> 1))
        return (flags | (flags << LATTICE) | (flags >> LATTICE)) & EVERY

    bits, known = bits & members, members
    for _ in range(ACROSS):
        bits |= beside(bits) & ~known
        known = beside(known)
    return bits


def _reached(
    search: Search,
    blocks: Blocks,
    fine: Fine,
    pairs: Pairs,
    pair: Any,
    beside: tuple[_Beside, _Beside],
    asked: Any,
) -> Any:
    """Which of the `asked` corners of cells the pieces of pairs reach; a bit for each.

    What the blocks above and to the left share with a block is asked for there, if it is.
    """
    corners = LATTICE * LATTICE
    above, left = beside
    shared = (above.at(asked) >> LAST_ROW) & FIRST_ROW, (left.at(asked) >> LAST_COLUMN) & FIRST_COLUMN
    own = asked & ~(shared[0] | shared[1])
    dr.eval(own)
    index = dr.arange(mi.UInt32, len(pair) * corners)
    of = index // corners
    some = places(((dr.gather(mi.UInt32, own, of) >> (index - of * corners)) & 1) != 0)
    of = some // corners
    place, at = some - of * corners, dr.gather(mi.UInt32, pair, of)
    block = dr.gather(mi.UInt32, pairs.block, at)
    n = dr.gather(type(blocks.normals), blocks.normals, block * corners + place)
    acts = _reaches(search, fine, corner_place(block, place), n, dr.gather(mi.UInt32, pairs.piece, at))
    bits = dr.zeros(mi.UInt32, len(pair))
    dr.scatter_add(bits, dr.select(acts, mi.UInt32(1) << place, 0), of)
    dr.eval(bits)
    bits |= ((above.at(bits) >> LAST_ROW) & shared[0]) | ((left.at(bits) >> LAST_COLUMN) & shared[1])
    dr.eval(bits)
    return bits & asked


class _Beside(NamedTuple):
    """For each of some pairs the one of the same piece and a block beside, if there is one."""

    index: Any
    there: Any

    def at(self, values: Any) -> Any:
        """What those have; 0 where there is none."""
        return dr.gather(mi.UInt32, values, self.index, self.there)


def _beside(search: Search, blocks: Blocks, pairs: Pairs, pair: Any) -> tuple[_Beside, _Beside]:
    """Above and to the left in the same plane."""
    n = int(search.tab.n_pieces[0])
    entries = dr.full(mi.UInt32, NONE, dr.width(blocks.p) * n)
    dr.scatter(entries, dr.arange(mi.UInt32, len(pair)), dr.gather(mi.UInt32, pairs.index, pair))
    block, piece = (dr.gather(mi.UInt32, v, pair) for v in (pairs.block, pairs.piece))
    found = []
    for side in (UP, LEFT):
        other = dr.gather(mi.UInt32, blocks.beside[side], block)
        entry = dr.gather(mi.UInt32, entries, other * n + piece)
        found.append(_Beside(entry, (other != block) & (entry != NONE)))
    return found[0], found[1]


def finely(search: Search, blocks: Blocks, fine: Fine, block: Any, piece: Any, cell: Any) -> Any:
    """What of cells of flat blocks pieces reach, by rays to INNER × INNER places of each, as in `Parts`."""
    found = dr.full(mi.UInt32, FINELY, len(cell))
    index = dr.arange(mi.UInt32, INNER * INNER * len(cell))
    of = index // (INNER * INNER)
    bit = index - INNER * INNER * of
    block, piece, cell = (dr.gather(mi.UInt32, v, of) for v in (block, piece, cell))
    y = cell // ACROSS
    at = place(block, 2 * y + bit // INNER, 2 * (cell - y * ACROSS) + bit % INNER)
    acts = _reaches(search, fine, at, dr.gather(type(blocks.n), blocks.n, block), piece)
    dr.scatter_add(found, dr.select(acts, mi.UInt32(1) << bit, 0), of)
    dr.eval(found)
    return found


def _reaches(search: Search, fine: Fine, at: Any, n: Any, piece: Any) -> Any:
    """Whether pieces reach some of the places, normals n."""
    whole = search.tab.piece(piece)
    acts = sounds(fine.frames.some(at), whole, search.tab.types.Vector(n))
    return acts & search.reaches(whole, dr.gather(type(fine.p), fine.p, at), n, acts)
