"""Which outline pieces act on each block of receivers, found once for all of them (`lists`).

What corners of far runs send inside is left out and counted. A piece whose fringes are finer than pixels everywhere in
the block is on no list: it takes no part in means over pixels.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction.chirps import QUADRANTS, quadrant
from grimaldi.diffraction.corners import Corner, corner, slopes
from grimaldi.diffraction.edges import cut_off, sounds
from grimaldi.diffraction.fine import Fine, place
from grimaldi.diffraction.fine import corner as corner_place
from grimaldi.diffraction.frame import Frame, constant, frame
from grimaldi.diffraction.grazing import Near, near, other_than, worth
from grimaldi.diffraction.hierarchy import NONE, least_detour
from grimaldi.diffraction.lists import FINELY, INNER, List, Lists, Parts, Runs, places
from grimaldi.diffraction.model import ACROSS, LATTICE, Blocks, Receivers
from grimaldi.diffraction.search import Pairs, Search
from grimaldi.diffraction.table import Piece, Table
from grimaldi.diffraction.waves import Waves, sums, waves

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

FINEST = 1.0  # cycles a pixel of fringes, from which on a picture's mean over pixels does without them,
AVERAGED = 0.05  # at this tolerance and above; below, more in proportion
CORNER = 0.007  # of the tolerance: |M| of a corner that is left out
FINE = 1 << 16  # parts of its square, in which it is counted: sums of whole numbers are the same in any order
WEAK = 0.3  # of the tolerance: |M| of an end that grows evenly between corners of cells which it reaches or not
FAINT = 0.2  # and of one at all four corners of a cell
STRONG = 0.5  # and of one that grows evenly between INNER × INNER places of it, or corners on a curved block
REMOTE = 1.5  # radii of a block, that such a piece is away from it at least
ALL = (1 << ACROSS * ACROSS) - 1  # cells
EVERY = (1 << LATTICE * LATTICE) - 1  # corners
COARSE = sum(1 << (y * LATTICE + x) for y in range(0, LATTICE, 2) for x in range(0, LATTICE, 2))  # every other corner
UNTESTED = 0.1  # of the tolerance: |M| of an end that reaches a block or not as a whole, by what its middle says


class _Seen(NamedTuple):
    """Pieces from the middles of blocks."""

    open: Any  # whether it acts there
    idle: Any  # whether that makes no difference
    weak: Any  # whether a chain cut off on it leaves little everywhere in the block
    far: Any  # whether leading terms serve everywhere in the block
    inner2: Any  # sum of squares of what its inner corners send
    start: Any  # C φ'/ψ' at its ends
    stop: Any
    passes: Any  # whether the way to the block grazes another body's silhouette


class _Verdicts(NamedTuple):
    """Of pairs that are tested, a bit for each cell where to ask at every receiver, or where to look more finely; and
    for each corner of cells that they reach."""

    asked: Any
    finely: Any
    reached: Any

    @property
    def any(self) -> Any:
        """Which pairs are on some list of cells."""
        return (self.asked | self.finely | self.reached) != 0

    def but(self, pairs: Any) -> _Verdicts:
        """Those of others."""
        found = _Verdicts(*(dr.select(pairs, 0, bits) for bits in self))
        dr.eval(*found)
        return found


def lists(search: Search, blocks: Blocks) -> Lists:
    """What acts on each block."""
    tab, tolerance = search.tab, search.tolerance
    n, number = int(tab.n_pieces[0]), dr.width(blocks.p)
    frames = _frames(search, blocks.p)
    pairs = _pairs(search, blocks, frames, n)
    beside = _beside(search, blocks, frames)
    seen = _look(search, blocks, frames, pairs, beside)

    # where a piece reaches this block but not the next in the same plane, it may not reach all of it
    open_, closed = dr.zeros(mi.Bool, number * n), dr.zeros(mi.Bool, number * n)
    dr.scatter(open_, seen.open & ~seen.idle, pairs.index)
    dr.scatter(closed, ~seen.open, pairs.index)
    curved = dr.gather(mi.Float, blocks.bend, pairs.block) > 0
    changes = mi.Bool(curved)
    for side in blocks.beside:
        other = dr.gather(mi.UInt32, side, pairs.block) * n + pairs.piece
        changes |= dr.select(seen.open, dr.gather(mi.Bool, closed, other), dr.gather(mi.Bool, open_, other))
    limit = 2 * np.pi * tolerance
    faint = seen.far & (dr.maximum(dr.abs(seen.start), dr.abs(seen.stop)) < UNTESTED * limit)
    tested = ((curved | changes) & ~faint) | seen.passes
    dropped = seen.open & ~tested & (seen.idle | (seen.far & (seen.inner2 < dr.square(CORNER * limit))))
    kept = seen.open & ~tested & ~dropped
    dr.eval(tested, kept, dropped)

    # runs of neighbours
    before = dr.maximum(dr.arange(mi.UInt32, len(pairs.index)), 1) - 1
    follows = dr.gather(mi.Bool, tab.follows, pairs.piece) & (
        dr.gather(mi.UInt32, pairs.index, before) + 1 == pairs.index
    )
    turn = seen.start - dr.gather(mi.Float, seen.stop, before)
    joint = follows & dropped & dr.gather(mi.Bool, dropped, before) & (dr.abs(turn) < CORNER * limit)
    dr.eval(joint, follows)
    begins, stops = dropped & ~joint, dropped & ~_of_next(joint)
    strong = dr.abs(seen.start) >= CORNER * limit, dr.abs(seen.stop) >= CORNER * limit
    left2 = dr.select(dropped, seen.inner2, 0) + dr.select(joint, dr.square(turn), 0)
    left2 += dr.select(begins & ~strong[0], dr.square(seen.start), 0)
    left2 += dr.select(stops & ~strong[1], dr.square(seen.stop), 0)
    unit = (CORNER * limit) ** 2 / FINE
    first, end = tab.range(pairs.piece)
    finer = Fine.of(search, blocks)
    verdicts = _verdicts(search, blocks, finer, pairs, tested, seen)
    whole = (verdicts.asked == 0) & (verdicts.finely == 0) & (verdicts.reached == EVERY)
    kept |= whole
    verdicts = verdicts.but(whole)
    dr.eval(kept)
    found = waves(search, blocks, frames, finer.frames, pairs, kept | verdicts.any, kept)
    kept &= ~found.small & ~found.inside
    for i in range(QUADRANTS):
        chirp = dr.gather(mi.UInt32, found.index, QUADRANTS * dr.arange(mi.UInt32, len(kept)) + i, kept)
        told = kept & (chirp != NONE)
        left2 += dr.select(told, dr.gather(mi.Float, found.off2, chirp, told) / QUADRANTS, 0)
    left = sums(dr.ceil(left2 / unit), pairs.block, number)
    dr.eval(begins, stops, first, end, kept)
    runs, everywhere = _in_quadrants(tab, pairs, number, kept, follows, found)
    asked, asked_chirps, partly, chirped = _in_cells(search, blocks, finer, pairs, verdicts, found, seen.passes)
    return Lists(
        dr.opaque(mi.UInt32, number),
        asked,
        asked_chirps,
        partly,
        runs,
        found.chirps,
        chirped,
        everywhere,
        found.clear,
        found.receiver2,
        List.of(begins & strong[0], pairs.block, number, first),
        List.of(stops & strong[1], pairs.block, number, end - 1),
        dr.sqrt(mi.Float(left) * unit) / (2 * np.pi) + found.left,
        beside,
    )


def _of_next(flags: Any) -> Any:
    """The flag of the next one, evaluated before; False for the last."""
    at, last = dr.arange(mi.UInt32, len(flags)), len(flags) - 1
    return (at < last) & dr.gather(mi.Bool, flags, dr.minimum(at + 1, last))


def _runs(tab: Table, piece: Any, taken: Any, follows: Any, place: Any, number: int) -> Runs:
    """Runs of the pieces that are taken at each of `number` places; `follows`: whether a piece goes on from the one
    before."""
    first, end = tab.range(piece)
    of = partial(List.of, block=place, blocks=number)
    dr.eval(taken)
    before = dr.maximum(dr.arange(mi.UInt32, len(taken)), 1) - 1
    along = taken & follows & dr.gather(mi.Bool, taken, before)
    dr.eval(along)
    return Runs(of(taken & ~along, items=first), of(taken & ~_of_next(along), items=end - 1))


def _in_quadrants(tab: Table, pairs: Pairs, number: int, kept: Any, follows: Any, found: Waves) -> tuple[Runs, List]:
    """Those lists of quadrants of `number` blocks that `Lists` has, of the pairs that are kept."""
    own = places(kept)
    count = dr.opaque(mi.UInt32, len(own))
    index = dr.arange(mi.UInt32, QUADRANTS * len(own))
    of = index // count
    entry = index - of * count
    pair = dr.gather(mi.UInt32, own, entry)
    before = dr.gather(mi.UInt32, own, dr.maximum(entry, 1) - 1)
    follows = dr.gather(mi.Bool, follows, pair) & (before + 1 == pair)
    chirp = dr.gather(mi.UInt32, found.index, QUADRANTS * pair + of)
    there = dr.gather(mi.Bool, kept, pair)
    place = of * number + dr.gather(mi.UInt32, pairs.block, pair)
    told = there & (chirp != NONE)
    piece = dr.gather(mi.UInt32, pairs.piece, pair)
    dr.eval(told, chirp, place, follows, piece)
    runs = _runs(tab, piece, there & ~told, follows, place, QUADRANTS * number)
    return runs, List.of(told, place, QUADRANTS * number, chirp)


def _in_cells(
    search: Search, blocks: Blocks, fine: Fine, pairs: Pairs, verdicts: _Verdicts, found: Waves, passes: Any
) -> tuple[List, Any, Parts, Parts]:
    """Those lists of cells that `Lists` has, by what `_verdicts` says of pairs."""
    cells, number = ACROSS * ACROSS, dr.width(blocks.p)
    pair = places(verdicts.any & ~found.small)
    asked, finely, reached, block, piece = (
        dr.gather(mi.UInt32, v, pair) for v in (*verdicts, pairs.block, pairs.piece)
    )
    dr.eval(asked, finely, reached, block, piece)
    count = dr.opaque(mi.UInt32, len(pair))
    index = dr.arange(mi.UInt32, cells * len(pair))
    cell = index // count
    entry = index - cell * count
    bits = dr.gather(mi.UInt32, reached, entry) >> ((cell // ACROSS) * LATTICE + cell % ACROSS)
    corners = (bits & 3) | ((bits >> (LATTICE - 2)) & 12)
    asks = ((dr.gather(mi.UInt32, asked, entry) >> cell) & 1) != 0
    own = dr.gather(mi.UInt32, piece, entry)
    place = cell * dr.opaque(mi.UInt32, number) + dr.gather(mi.UInt32, block, entry)
    of = dr.gather(mi.UInt32, pair, entry)
    chirp = dr.gather(mi.UInt32, found.index, QUADRANTS * of + quadrant(cell))
    by_chirp = dr.select(dr.gather(mi.Bool, passes, of), NONE, chirp)  # what passes silhouettes is told apart by sides
    looks = ((dr.gather(mi.UInt32, finely, entry) >> cell) & 1) != 0
    reaches, told = ~asks & (looks | (corners > 0)), chirp != NONE
    dr.eval(corners, asks, chirp, by_chirp, reaches, told, place, own)
    some: Any = dr.compress(looks)
    if len(some):
        its_block, its_piece = (dr.gather(mi.UInt32, v, dr.gather(mi.UInt32, entry, some)) for v in (block, piece))
        bits = _finely(search, blocks, fine, its_block, its_piece, dr.gather(mi.UInt32, cell, some))
        dr.scatter(corners, bits, some)
        dr.eval(corners)

    def parts(chosen: Any, items: Any) -> Parts:
        return Parts(List.of(chosen, place, cells * number, items), dr.gather(mi.UInt32, corners, places(chosen)))

    return (
        List.of(asks, place, cells * number, own),
        dr.gather(mi.UInt32, by_chirp, places(asks)),
        parts(reaches & ~told, own),
        parts(reaches & told, chirp),
    )


def _finely(search: Search, blocks: Blocks, fine: Fine, block: Any, piece: Any, cell: Any) -> Any:
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
    tab, probe = search.tab, search.probe
    assert probe is not None
    whole = tab.piece(piece)
    acts = sounds(fine.frames.some(at), whole, tab.types.Vector(n))
    x = mi.Point3f(whole.middle + constant(tab.types.Vector, tab.centre))
    p = mi.Point3f(dr.gather(type(fine.p), fine.p, at))
    return acts & probe.reaches(x, whole, p + probe.epsilon(p) * n, acts)


def _frames(search: Search, p: Any) -> Frame:
    """Evaluated: once for each point, not once for each pair."""
    frames = frame(search.source, p, search.tab)
    dr.eval(*frames[:5])
    return frames


def _pairs(search: Search, blocks: Blocks, frames: Frame, n: int) -> Pairs:
    """Which of n pieces may act somewhere in a block: within the outlines' reach, and above some horizon."""
    tab, F = search.tab, search.tab.types.Float
    index = dr.arange(mi.UInt32, dr.width(blocks.p) * n)
    block = index // n
    middle, reach = tab.sphere(index - block * n)
    detour = least_detour(frames.some(block), middle, reach + F(dr.gather(mi.Float, blocks.radius, block)))
    found = places(dr.gather(mi.Bool, blocks.active, block) & (detour <= tab.far))

    block = found // n
    piece, fr = tab.piece(found - block * n), frames.some(block)
    radius, bend = (F(dr.gather(mi.Float, of, block)) for of in (blocks.radius, blocks.bend))
    normal = tab.types.Vector(dr.gather(type(blocks.n), blocks.n, block))
    d = fr.foot + fr.z2 * fr.a - piece.middle
    acts = dr.select(bend == 0, sounds(fr, piece, normal), dr.dot(normal, d) < radius + bend * dr.norm(d))
    acts &= _finest(fr, search.k, blocks, block, piece) <= FINEST * max(AVERAGED / search.tolerance, 1.0)
    found = dr.gather(mi.UInt32, found, places(acts))
    block = found // n
    dr.eval(found, block)
    return Pairs(block, found - block * n, found)


def _finest(fr: Frame, k: Any, blocks: Blocks, block: Any, piece: Piece) -> Any:
    """Cycles a pixel of a piece's fringes with the direct light, along rows or columns, where a block has the widest.

    ∇Δ at P is the direction X→P less that of S→P. Where it changes sign between corners fringes are wide somewhere.
    """
    V, corners = type(piece.middle), LATTICE * LATTICE
    P = fr.foot + fr.z2 * fr.a - piece.middle
    middle = dr.gather(type(blocks.p), blocks.p, block)
    slopes = []
    for i in (0, LATTICE - 1, corners // 2, corners - LATTICE, corners - 1):
        d = P + V(dr.gather(type(blocks.lattice), blocks.lattice, block * corners + i) - middle)
        slopes.append(d / dr.norm(d) - fr.a)
    finest = type(piece.reach)(0)
    for side in (blocks.right, blocks.down):
        along = V(dr.gather(type(side), side, block))
        cycles = [dr.dot(along, slope) for slope in slopes]
        low, high = cycles[0], cycles[0]
        for c in cycles:
            low, high = dr.minimum(low, c), dr.maximum(high, c)
        finest = dr.maximum(finest, dr.maximum(low, -high))
    return finest * k / (2 * np.pi)


def _beside(search: Search, blocks: Blocks, frames: Frame) -> Near | None:
    """The bodies whose silhouettes rays to each block pass closest by."""
    if search.grazing is None:
        return None
    middle = Receivers(blocks.p, blocks.n, blocks.active)
    found = near(frames, search.grazing, search.k, middle, search.tab.types.Float(blocks.radius))
    dr.eval(found.body, found.v2, found.next_body, found.next_v2)
    return found


def _look(search: Search, blocks: Blocks, frames: Frame, pairs: Pairs, beside: Near | None) -> _Seen:
    """Each piece from the middle of its block."""
    V = search.tab.types.Vector
    p = dr.gather(type(blocks.p), blocks.p, pairs.block)
    normal = dr.gather(type(blocks.n), blocks.n, pairs.block)
    radius = search.tab.types.Float(dr.gather(mi.Float, blocks.radius, pairs.block))
    x = mi.Point3f(p)
    if search.probe is not None:
        x = x + search.probe.epsilon(x) * normal
    by = None
    if beside is not None and search.grazing is not None:
        by = beside.of(pairs.block, mi.Bool(True), search.grazing)
    found = _from_middle(search, frames.some(pairs.block), pairs.piece, x, V(normal), radius, by)
    open_, idle, weak, far, inner2, start, stop, passes = found
    seen = _Seen(open_, idle, weak, far, mi.Float(inner2), mi.Float(start), mi.Float(stop), passes)
    dr.eval(*seen)
    return seen


@dr.syntax
def _from_middle(
    search: Search, fr: Frame, i: Any, p: Any, n: Any, radius: Any, beside: Near | None
) -> tuple[Any, ...]:
    """What is in `_Seen`, along pieces i, for receivers within `radius` of P."""
    tab, k, probe = search.tab, search.k, search.probe
    F = tab.types.Float
    piece = tab.piece(i)
    acts = sounds(fr, piece, n)
    clear = dr.mask_t(F)(acts)
    size = cut_off(fr, piece, k)
    far, inner2, start, stop = _along(search, fr, piece, radius)
    idle = far & _is_idle(inner2, start, stop, search.tolerance)
    if dr.hint(probe is not None, mode="scalar"):
        assert probe is not None
        tested = acts & (size > search.share) & ~idle
        if tested:
            x = mi.Point3f(piece.middle + constant(tab.types.Vector, tab.centre))
            clear = acts & probe.reaches(x, piece, p, tested)
    room = piece._replace(reach=piece.reach + radius)
    weak = (cut_off(fr, room, k) < WEAK * search.tolerance) & (
        dr.squared_norm(fr.foot + fr.z2 * fr.a - piece.middle) > dr.square(REMOTE * radius)
    )
    passes = dr.mask_t(F)(False)
    if dr.hint(beside is not None, mode="scalar"):
        assert beside is not None
        _, v2, close = other_than(beside, piece)
        if close:
            passes = worth(size, v2, search.tolerance)
    return clear, idle, weak, far, inner2, start, stop, passes


def _is_idle(inner2: Any, start: Any, stop: Any, tolerance: float) -> Any:
    """Whether nothing is asked of a far piece, whether it reaches a block or not: all its corners are left out."""
    limit = CORNER * 2 * np.pi * tolerance
    return (inner2 < limit * limit) & (dr.maximum(dr.abs(start), dr.abs(stop)) < limit)


@dr.syntax
def _along(search: Search, fr: Frame, piece: Piece, radius: Any) -> tuple[Any, ...]:
    """What is in `_Seen` of a piece's segments: `far`, `inner2`, `start` and `stop`."""
    tab, k, rule = search.tab, search.k, search.rule.corners
    assert rule is not None
    F = tab.types.Float
    far = dr.mask_t(F)(True)
    inner2, start, stop = F(0), F(0), F(0)
    j = dr.uint32_array_t(F)(piece.first)
    last = tuple(corner(fr, tab.corner(j, 0), k))
    while j < piece.end:
        a, b = Corner(*last), corner(fr, tab.corner(j, 1), k)
        at = slopes(fr.a, a, b, k)
        margin = k * radius * dr.sqrt(at.length2) * dr.rsqrt(dr.minimum(a.to_p2, b.to_p2))
        least = dr.minimum(dr.abs(at.a), dr.abs(at.b)) - margin
        far &= (at.a * at.b > 0) & (least > 0) & (dr.minimum(a.d2, b.d2) > 4 * dr.square(radius))
        far &= dr.square(least) > 2 * rule.far * k * at.length2 * dr.maximum(a.inv, b.inv)
        end_a, end_b = at.turn * a.C / (a.d2 * at.a), at.turn * b.C / (b.d2 * at.b)
        begins = j == piece.first
        inner2 += dr.select(begins, 0, dr.square(end_a - stop))
        start = dr.select(begins, end_a, start)
        stop = end_b
        last = tuple(b)
        j += 1
    return far, inner2, start, stop


def _verdicts(search: Search, blocks: Blocks, fine: Fine, pairs: Pairs, tested: Any, seen: _Seen) -> _Verdicts:
    """What is known of pieces that are `tested`, by a ray to each corner on the block's own surface.

    Where those nearest to a cell differ, a weak piece grows evenly between them; others are looked at more finely,
    or asked for at every receiver if they are strong or pass other silhouettes.
    """
    verdicts = _Verdicts(*(dr.zeros(mi.UInt32, len(tested)) for _ in range(3)))
    pair: Any = dr.compress(tested)
    if len(pair) == 0:
        return verdicts
    if search.probe is None:
        dr.scatter(verdicts.asked, mi.UInt32(ALL), pair)
        return verdicts
    members = dr.gather(mi.UInt32, blocks.members, dr.gather(mi.UInt32, pairs.block, pair))
    weak = dr.gather(mi.Bool, seen.weak, pair)
    first = members & dr.select(weak & ((members & COARSE) != 0), mi.UInt32(COARSE), EVERY)
    bits = _reached(search, blocks, fine, pairs, pair, first)
    told, reached = _between(bits, first)
    bits |= reached & members
    bits |= _reached(search, blocks, fine, pairs, pair, members & ~first & ~told)
    filled = _filled(bits, members)
    passes = dr.gather(mi.Bool, seen.passes, pair)
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


def _left(search: Search, frames: Frame, pairs: Pairs, pair: Any, some: Any) -> tuple[Any, Any]:
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


def _reached(search: Search, blocks: Blocks, fine: Fine, pairs: Pairs, pair: Any, asked: Any) -> Any:
    """Which of the `asked` corners of cells the pieces of pairs reach; a bit for each."""
    corners = LATTICE * LATTICE
    index = dr.arange(mi.UInt32, len(pair) * corners)
    of = index // corners
    some = places(((dr.gather(mi.UInt32, asked, of) >> (index - of * corners)) & 1) != 0)
    of = some // corners
    place, own = some - of * corners, dr.gather(mi.UInt32, pair, of)
    block = dr.gather(mi.UInt32, pairs.block, own)
    n = dr.gather(type(blocks.normals), blocks.normals, block * corners + place)
    acts = _reaches(search, fine, corner_place(block, place), n, dr.gather(mi.UInt32, pairs.piece, own))
    bits = dr.zeros(mi.UInt32, len(pair))
    dr.scatter_add(bits, dr.select(acts, mi.UInt32(1) << place, 0), of)
    dr.eval(bits)
    return bits & asked
