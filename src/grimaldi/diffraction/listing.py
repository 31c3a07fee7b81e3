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

from grimaldi.diffraction.arrays import Types
from grimaldi.diffraction.chirps import QUADRANTS, quadrant
from grimaldi.diffraction.edges import sounds
from grimaldi.diffraction.fine import Fine
from grimaldi.diffraction.frame import Frame, Frames
from grimaldi.diffraction.grazing import Near, near
from grimaldi.diffraction.hierarchy import NONE, least_detour
from grimaldi.diffraction.lists import List, Lists, Parts, Runs, places
from grimaldi.diffraction.middles import CORNER, Seen, seen_from_middles
from grimaldi.diffraction.model import ACROSS, LATTICE, Blocks, Receivers
from grimaldi.diffraction.search import Pairs, Search, sums
from grimaldi.diffraction.table import Piece, Table
from grimaldi.diffraction.verdicts import EVERY, Verdicts, finely, verdicts_of
from grimaldi.diffraction.waves import Waves, waves

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

FINEST = 1.0  # cycles a pixel of fringes, from which on a picture's mean over pixels does without them,
AVERAGED = 0.05  # at this tolerance and above; below, more in proportion
SQUARES = 1 << 16  # parts of its square, in which it is counted: sums of whole numbers are the same in any order
SPANS = (0, LATTICE - 1, LATTICE * LATTICE // 2, LATTICE * (LATTICE - 1), LATTICE * LATTICE - 1)  # corners of a block
UNTESTED = 0.1  # of the tolerance: |M| of an end that reaches a block or not as a whole, by what its middle says
ACTS, HIDDEN = 1, 2  # whether a piece acts in a block, or is known not to reach it


def lists(search: Search, blocks: Blocks) -> Lists:
    """What acts on each block."""
    tab, tolerance = search.tab, search.tolerance
    n, number = int(tab.n_pieces[0]), dr.width(blocks.p)
    frames = search.frames(blocks.p)
    pairs = _pairs(search, blocks, frames, n)
    beside = _beside(search, blocks, frames)
    seen = seen_from_middles(search, blocks, frames, pairs, beside)

    curved = dr.gather(mi.Float, blocks.bend, pairs.block) > 0
    changes = curved | _changes(blocks, pairs, seen, n)
    limit = 2 * np.pi * tolerance
    faint = seen.far & (dr.maximum(dr.abs(seen.start), dr.abs(seen.stop)) < UNTESTED * limit)
    tested = (changes & ~faint) | seen.passes
    dropped = seen.open & ~tested & (seen.idle | (seen.far & (seen.inner2 < dr.square(CORNER * limit))))
    kept = seen.open & ~tested & ~dropped
    dr.eval(tested, kept, dropped)

    far = _far_runs(tab, pairs, seen, dropped, CORNER * limit)
    left2, unit = far.left2, (CORNER * limit) ** 2 / SQUARES
    first, end = tab.range(pairs.piece)
    finer = Fine.of(search, blocks)
    verdicts = verdicts_of(search, blocks, finer, pairs, tested, seen.weak, seen.passes)
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
    dr.eval(first, end, kept)
    runs, everywhere = _in_quadrants(tab, pairs, number, kept, far.follows, found)
    asked, asked_chirps, partly, partly_solids, chirped = _in_cells(
        search, blocks, finer, pairs, verdicts, found, seen.passes
    )
    return Lists(
        blocks=dr.opaque(mi.UInt32, number),
        asked=asked,
        asked_chirps=asked_chirps,
        partly=partly,
        partly_solids=partly_solids,
        solids=found.solids,
        boxes=blocks.boxes,
        runs=runs,
        chirps=found.chirps,
        chirped=chirped,
        everywhere=everywhere,
        clear=found.clear,
        receiver2=found.receiver2,
        begins=List.of(far.begins, pairs.block, number, first),
        stops=List.of(far.stops, pairs.block, number, end - 1),
        left=dr.sqrt(mi.Float(left) * unit) / (2 * np.pi) + found.left,
        beside=beside,
    )


class _Far(NamedTuple):
    """Runs of pairs of which a list has no more than the ends: which begin and stop one that sends something there,
    the square of what is left out of M at each pair, and which follow the pair before."""

    begins: Any
    stops: Any
    left2: Any
    follows: Any


def _far_runs(tab: Table, pairs: Pairs, seen: Seen, dropped: Any, least: float) -> _Far:
    """Those of the pairs that are dropped; ends and corners that send less than `least` are left out."""
    before = dr.maximum(dr.arange(mi.UInt32, len(pairs.index)), 1) - 1
    follows = dr.gather(mi.Bool, tab.follows, pairs.piece) & (
        dr.gather(mi.UInt32, pairs.index, before) + 1 == pairs.index
    )
    turn = seen.start - dr.gather(mi.Float, seen.stop, before)
    joint = follows & dropped & dr.gather(mi.Bool, dropped, before) & (dr.abs(turn) < least)
    dr.eval(joint, follows)
    begins, stops = dropped & ~joint, dropped & ~_of_next(joint)
    left2 = dr.select(dropped, seen.inner2, 0) + dr.select(joint, dr.square(turn), 0)
    strong = [dr.abs(end) >= least for end in (seen.start, seen.stop)]
    left2 += dr.select(begins & ~strong[0], dr.square(seen.start), 0)
    left2 += dr.select(stops & ~strong[1], dr.square(seen.stop), 0)
    begins, stops = begins & strong[0], stops & strong[1]
    dr.eval(begins, stops)
    return _Far(begins, stops, left2, follows)


def _changes(blocks: Blocks, pairs: Pairs, seen: Seen, n: int) -> Any:
    """Of which pairs the piece reaches the block but not the next in its plane: it may not reach all of it. Or not the
    block but the next."""
    states = dr.zeros(mi.UInt32, dr.width(blocks.p) * n)
    dr.scatter(states, dr.select(seen.open, dr.select(seen.idle, mi.UInt32(0), ACTS), HIDDEN), pairs.index)
    changes = mi.Bool(False)
    other_state = dr.select(seen.open, mi.UInt32(HIDDEN), ACTS)
    for side in blocks.beside:
        other = dr.gather(mi.UInt32, side, pairs.block) * n + pairs.piece
        changes |= dr.gather(mi.UInt32, states, other) == other_state
    dr.eval(changes)
    return changes


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
    search: Search, blocks: Blocks, fine: Fine, pairs: Pairs, verdicts: Verdicts, found: Waves, passes: Any
) -> tuple[List, Any, Parts, Any, Parts]:
    """Those lists of cells that `Lists` has, by the verdicts on pairs."""
    cells, number = ACROSS * ACROSS, dr.width(blocks.p)
    pair = places(verdicts.any & ~found.small)
    asked, looked_at, reached, block, piece = (
        dr.gather(mi.UInt32, v, pair) for v in (*verdicts, pairs.block, pairs.piece)
    )
    dr.eval(asked, looked_at, reached, block, piece)
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
    curved = dr.gather(mi.Float, blocks.bend, dr.gather(mi.UInt32, block, entry)) > 0
    by_sides = dr.gather(mi.Bool, passes, of)  # what passes silhouettes is told apart by their sides
    by_chirp = dr.select(curved | by_sides, NONE, chirp)
    looks = ((dr.gather(mi.UInt32, looked_at, entry) >> cell) & 1) != 0
    reaches, told = ~asks & (looks | (corners > 0)), ~curved & (chirp != NONE)
    solid = dr.select(curved, chirp, NONE)
    dr.eval(corners, asks, chirp, by_chirp, reaches, told, solid, place, own)
    some: Any = dr.compress(looks)
    if len(some):
        its_block, its_piece = (dr.gather(mi.UInt32, v, dr.gather(mi.UInt32, entry, some)) for v in (block, piece))
        bits = finely(search, blocks, fine, its_block, its_piece, dr.gather(mi.UInt32, cell, some))
        dr.scatter(corners, bits, some)
        dr.eval(corners)

    def parts(chosen: Any, items: Any) -> Parts:
        return Parts(List.of(chosen, place, cells * number, items), dr.gather(mi.UInt32, corners, places(chosen)))

    return (
        List.of(asks, place, cells * number, own),
        dr.gather(mi.UInt32, by_chirp, places(asks)),
        parts(reaches & ~told, own),
        dr.gather(mi.UInt32, solid, places(reaches & ~told)),
        parts(reaches & told, chirp),
    )


def _pairs(search: Search, blocks: Blocks, frames: Frames, n: int) -> Pairs:
    """Which of n pieces may act somewhere in a block: within the outlines' reach, and above some horizon."""
    tab, F = search.tab, search.tab.types.Float
    index = dr.arange(mi.UInt32, dr.width(blocks.p) * n)
    block = index // n
    middle, reach = tab.sphere(index - block * n)
    detour = least_detour(frames.some(block), middle, reach + F(dr.gather(mi.Float, blocks.radius, block)))
    found = places(dr.gather(mi.Bool, blocks.active, block) & (detour <= tab.far))

    spans = _spans(blocks, tab.types)
    block = found // n
    piece, fr = tab.piece(found - block * n), frames.some(block)
    radius, bend = (F(dr.gather(mi.Float, of, block)) for of in (blocks.radius, blocks.bend))
    normal = tab.types.Vector(dr.gather(type(blocks.n), blocks.n, block))
    d = fr.foot + fr.z2 * fr.a - piece.middle
    acts = dr.select(bend == 0, sounds(fr, piece, normal), dr.dot(normal, d) < radius + bend * dr.norm(d))
    acts &= _finest(fr, search.k, spans, tab.types, block, piece) <= FINEST * max(AVERAGED / search.tolerance, 1.0)
    found = dr.gather(mi.UInt32, found, places(acts))
    block = found // n
    dr.eval(found, block)
    return Pairs(block, found - block * n, found)


def _spans(blocks: Blocks, types: Types) -> Any:
    """From the middle of each block to SPANS, and a pixel's way along rows and columns, as packets; evaluated."""
    number = dr.width(blocks.p)
    index = dr.arange(mi.UInt32, number)
    corners = (dr.gather(type(blocks.lattice), blocks.lattice, LATTICE * LATTICE * index + i) for i in SPANS)
    vectors = *(corner - blocks.p for corner in corners), blocks.right, blocks.down
    packets = dr.zeros(types.Float, 4 * len(vectors) * number)
    for j, v in enumerate(vectors):
        dr.scatter(packets, types.Packet(*types.Vector(v), 0), len(vectors) * index + j)
    dr.eval(packets)
    return packets


def _finest(fr: Frame, k: Any, spans: Any, types: Types, block: Any, piece: Piece) -> Any:
    """Cycles a pixel of a piece's fringes with the direct light, along rows or columns, where a block has the widest.

    ∇Δ at P is the direction X→P less that of S→P. Where it changes sign between corners fringes are wide somewhere.
    """
    count = len(SPANS) + 2
    rows = (dr.gather(types.Packet, spans, count * block + j) for j in range(count))
    *corners, right, down = (types.Vector(row.x, row.y, row.z) for row in rows)
    P = fr.foot + fr.z2 * fr.a - piece.middle
    slopes = []
    for corner in corners:
        d = P + corner
        slopes.append(d / dr.norm(d) - fr.a)
    finest = type(piece.reach)(0)
    for along in (right, down):
        cycles = [dr.dot(along, slope) for slope in slopes]
        low, high = cycles[0], cycles[0]
        for c in cycles:
            low, high = dr.minimum(low, c), dr.maximum(high, c)
        finest = dr.maximum(finest, dr.maximum(low, -high))
    return finest * k / (2 * np.pi)


def _beside(search: Search, blocks: Blocks, frames: Frames) -> Near | None:
    """The bodies whose silhouettes rays to each block pass closest by."""
    if search.grazing is None:
        return None
    middle = Receivers(blocks.p, blocks.n, blocks.active)
    every = frames.some(dr.arange(mi.UInt32, dr.width(blocks.p)))
    found = near(every, search.grazing, search.k, middle, search.tab.types.Float(blocks.radius))
    dr.eval(found.body, found.v2, found.next_body, found.next_v2)
    return found
