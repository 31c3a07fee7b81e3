"""Outline pieces from the middles of blocks: what they send there, whether they reach it, and how that may change."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction.corners import Corner, corner, slopes
from grimaldi.diffraction.edges import cut_off, sounds
from grimaldi.diffraction.frame import Frame, Frames
from grimaldi.diffraction.grazing import Near, other_than, worth
from grimaldi.diffraction.model import LEFT, RIGHT, Blocks
from grimaldi.diffraction.search import Pairs, Search
from grimaldi.diffraction.table import Piece
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

CORNER = 0.0035  # of the tolerance: |M| of a corner that is left out
WEAK = 0.35  # of the tolerance: |M| of an end that grows evenly between corners of cells which it reaches or not
REMOTE = 1.5  # radii of a block, that such a piece is away from it at least


class Seen(NamedTuple):
    """Pieces from the middles of blocks."""

    open: Any  # whether it acts there
    idle: Any  # whether that makes no difference
    weak: Any  # whether a chain cut off on it leaves little everywhere in the block
    far: Any  # whether leading terms serve everywhere in the block
    inner2: Any  # sum of squares of what its inner corners send
    start: Any  # C φ'/ψ' at its ends
    stop: Any
    passes: Any  # whether the way to the block grazes another body's silhouette


def seen_from_middles(search: Search, blocks: Blocks, frames: Frames, pairs: Pairs, beside: Near | None) -> Seen:
    """Each piece from the middle of its block."""
    found, tested = _unhindered(search, blocks, frames, pairs, beside)
    if search.probe is not None:
        _hide(found.open, tested, search, blocks, pairs)
    return found


def _unhindered(search: Search, blocks: Blocks, frames: Frames, pairs: Pairs, beside: Near | None) -> tuple[Seen, Any]:
    """The same if nothing stood between; and which of the pieces are worth a ray."""
    tab, k, tolerance = search.tab, search.k, search.tolerance
    fr, piece = frames.some(pairs.block), tab.piece(pairs.piece)
    radius = tab.types.Float(dr.gather(mi.Float, blocks.radius, pairs.block))
    acts = sounds(fr, piece, tab.types.Vector(dr.gather(type(blocks.n), blocks.n, pairs.block)))
    size = cut_off(fr, piece, k)
    far, inner2, start, stop = _along(search, fr, piece, radius)
    idle = far & _is_idle(inner2, start, stop, tolerance)
    room = piece._replace(reach=piece.reach + radius)
    weak = (cut_off(fr, room, k) < WEAK * tolerance) & (
        dr.squared_norm(fr.foot + fr.z2 * fr.a - piece.middle) > dr.square(REMOTE * radius)
    )
    passes = dr.full(mi.Bool, False, len(pairs.index))
    if beside is not None and search.grazing is not None:
        _, v2, close = other_than(beside.of(pairs.block, mi.Bool(True), search.grazing), piece)
        passes = close & worth(size, v2, tolerance)
    tested = acts & (size > search.share) & ~idle
    seen = Seen(acts, idle, weak, far, mi.Float(inner2), mi.Float(start), mi.Float(stop), passes)
    dr.eval(*seen, tested)
    return seen, tested


def _hide(opens: Any, tested: Any, search: Search, blocks: Blocks, pairs: Pairs) -> None:
    """Take out of `opens` those tested pairs whose pieces do not reach the middles of their blocks.

    Every other block of a plane is told by those beside it where they all say the same.
    """
    number, n = dr.width(blocks.p), int(search.tab.n_pieces[0])
    later = tested & ((pairs.block & 1) != 0)
    for side in (LEFT, RIGHT):
        later &= dr.gather(mi.UInt32, blocks.beside[side], pairs.block) != pairs.block
    dr.eval(later)
    _test(opens, tested & ~later, search, blocks, pairs)
    some: Any = dr.compress(later)
    if len(some) == 0:
        return
    reach, miss = dr.zeros(mi.Bool, number * n), dr.zeros(mi.Bool, number * n)
    dr.scatter(reach, opens & ~later, pairs.index)
    dr.scatter(miss, ~opens & ~later, pairs.index)
    block, piece = (dr.gather(mi.UInt32, v, some) for v in (pairs.block, pairs.piece))
    all_reach, all_miss = mi.Bool(True), mi.Bool(True)
    for i, side in enumerate(blocks.beside):
        other = dr.gather(mi.UInt32, side, block) * n + piece
        reaches, misses = dr.gather(mi.Bool, reach, other), dr.gather(mi.Bool, miss, other)
        all_reach &= reaches if i in (LEFT, RIGHT) else ~misses
        all_miss &= misses if i in (LEFT, RIGHT) else ~reaches
    dr.scatter(later, ~all_reach & ~all_miss, some)
    dr.scatter(opens, ~all_miss, some)
    dr.eval(later, opens)
    _test(opens, later, search, blocks, pairs)


def _test(opens: Any, tested: Any, search: Search, blocks: Blocks, pairs: Pairs) -> None:
    """Whether pieces reach the middles of blocks, for the tested pairs, by a ray each."""
    some: Any = dr.compress(tested)
    if len(some) == 0:
        return
    block, piece = (dr.gather(mi.UInt32, v, some) for v in (pairs.block, pairs.piece))
    p, n = (dr.gather(type(v), v, block) for v in (blocks.p, blocks.n))
    dr.scatter(opens, search.reaches(search.tab.piece(piece), p, n, mi.Bool(True)), some)
    dr.eval(opens)


def _is_idle(inner2: Any, start: Any, stop: Any, tolerance: float) -> Any:
    """Whether nothing is asked of a far piece, whether it reaches a block or not: all its corners are left out."""
    limit = CORNER * 2 * np.pi * tolerance
    return (inner2 < limit * limit) & (dr.maximum(dr.abs(start), dr.abs(stop)) < limit)


@syntax
def _along(search: Search, fr: Frame, piece: Piece, radius: Any) -> tuple[Any, ...]:
    """What is in `Seen` of a piece's segments: `far`, `inner2`, `start` and `stop`."""
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
