"""Which outline pieces act on each block of receivers, found once for all of them.

A piece near the ray, or one that reaches part of the block, is asked for at every receiver. Of pieces that reach all of
it, neighbours in a chain make one run; far from the ray, where ψ = kΔ runs fast, a run is no more than the leading
terms of its two ends, C φ' e^{iψ}/(iψ'), and what its corners inside send is left out and counted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction.corners import Corner, corner, leading, slopes
from grimaldi.diffraction.edges import Margins, Nearest, Sum, chain_wave, cut_off, sounds
from grimaldi.diffraction.frame import Frame, constant, frame
from grimaldi.diffraction.grazing import Chords, Near, near, other_than, worth
from grimaldi.diffraction.hierarchy import least_detour
from grimaldi.diffraction.model import ACROSS, Blocks, Receivers
from grimaldi.diffraction.occlusion import Rays
from grimaldi.diffraction.segment import Corners, Rule
from grimaldi.diffraction.table import Piece, Table
from grimaldi.scene.model import Source

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

CORNER = 0.02  # of the tolerance: |M| of a corner that is left out
CELLS = ACROSS * ACROSS
ALL = ((1 << CELLS) - 1) << CELLS  # every cell to be tested
UNTESTED = 0.1  # of the tolerance: |M| of an end that reaches a block or not as a whole, by what its middle says


class List(NamedTuple):
    """Items of each block, one block after the other."""

    begin: Any  # where each block's items begin, and where the last ends
    items: Any

    @staticmethod
    def of(chosen: Any, items: Any, each: int) -> List:
        """The items of those that are `chosen`, `each` a block."""
        index = dr.compress(chosen)
        if len(index) == 0:
            index = dr.zeros(mi.UInt32, 1)  # an array that nothing can be gathered from stops a kernel
        count = dr.block_sum(dr.select(chosen, mi.UInt32(1), 0), each)
        begin = dr.zeros(mi.UInt32, len(count) + 1)
        dr.scatter(begin, dr.cumsum(count), dr.arange(mi.UInt32, len(count)) + 1)
        return List(begin, dr.gather(type(items), items, index))

    def item(self, i: Any) -> Any:
        """What stands at a place."""
        return dr.gather(type(self.items), self.items, i)

    def bounds(self, block: Any, active: Any) -> tuple[Any, Any]:
        """The first item of a block, and the one after its last."""
        return dr.gather(mi.UInt32, self.begin, block, active), dr.gather(mi.UInt32, self.begin, block + 1, active)


class Lists(NamedTuple):
    """What acts on each block: pieces to be tested, runs of segments that reach it, ends of runs, |M| left out."""

    tested: List  # pieces
    verdicts: Any  # on each of those: CELLS bits of the cells it reaches whole, and CELLS of those where to test it
    first: List  # segments where runs begin
    last: List  # and the last of each
    begins: List  # segments at whose start a far run begins
    stops: List  # and at whose end one stops
    left: Any
    beside: Near | None  # the bodies whose silhouettes pass closest by each

    def verdict(self, i: Any, bit: Any) -> Any:
        """A bit of what is known of a piece to be tested."""
        return ((dr.gather(mi.UInt32, self.verdicts, i) >> bit) & 1) != 0

    def near(self, receivers: Receivers, silhouettes: Chords | None) -> Near | None:
        """The bodies beside the receivers' blocks."""
        if self.beside is None or silhouettes is None:
            return None
        return self.beside.of(receivers.block, receivers.active, silhouettes)


class Listed(NamedTuple):
    """The pieces that reach part of the receivers' blocks, as a walk."""

    lists: Lists
    cell: Any  # of the receivers, in their blocks

    def bounds(self, receivers: Receivers) -> tuple[Any, Any]:
        return self.lists.tested.bounds(receivers.block, receivers.active)

    def visit(self, fr: Frame, i: Any) -> tuple[Any, Any, Any]:  # noqa: ARG002
        ask = self.lists.verdict(i, self.cell + CELLS)
        return self.lists.tested.item(i), ask, ask

    def after(self, i: Any, inside: Any) -> Any:  # noqa: ARG002
        return i + 1

    def weight(self, fr: Frame, piece: Piece) -> Any:  # noqa: ARG002
        return type(fr.z2)(1)


class _Seen(NamedTuple):
    """A piece from the middle of a block."""

    sounds: Any
    clear: Any
    near: Any  # whether it may act somewhere in the block
    far: Any  # whether leading terms serve everywhere in the block
    inner2: Any  # sum of squares of what its inner corners send
    start: Any  # C φ'/ψ' at its ends
    stop: Any
    grazed: Any  # whether the way to the block passes another body's silhouette


@dr.syntax
def _seen(
    fr: Frame, tab: Table, i: Any, k: Any, rule: Corners, share: float, probe: Rays | None, p: Any, n: Any, radius: Any, bend: Any,
    beside: Near | None, tolerance: float
) -> tuple[Any, ...]:
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    piece = tab.piece(i)
    near = least_detour(fr, piece.middle, piece.reach + radius) <= tab.far
    d = fr.foot + fr.z2 * fr.a - piece.middle
    near &= (bend == 0) | (dr.dot(n, d) < radius + bend * dr.norm(d))  # what may rise above a receiver's horizon
    acts = near & sounds(fr, piece, n)
    clear = dr.mask_t(F)(acts)
    if dr.hint(probe is not None, mode="scalar"):
        assert probe is not None
        tested = acts & (cut_off(fr, piece, k) > share)
        if tested:
            x = mi.Point3f(piece.middle + constant(tab.types.Vector, tab.centre))
            clear = acts & probe.reaches(x, piece, p, tested)
    far = dr.mask_t(F)(near)
    inner2, start, stop = F(0), F(0), F(0)
    j = U(piece.first)
    last = tuple(corner(fr, tab.corner(j, 0), k))
    while near & (j < piece.end):
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
    passes = dr.mask_t(F)(False)
    if dr.hint(beside is not None, mode="scalar"):
        assert beside is not None
        _, v2, close = other_than(beside, piece)
        if near & close:
            passes = worth(cut_off(fr, piece, k), v2, tolerance)
    return acts, clear, near, far, inner2, start, stop, passes


def lists(
    source: Source, tab: Table, k: Any, rule: Corners, tolerance: float, share: float, probe: Rays | None, grazing: Chords | None, blocks: Blocks
) -> Lists:
    """What acts on each block.

    share: |M| below which a piece reaches all without a test; probe: rays X→P, None where nothing blocks them.
    """
    n = int(tab.n_pieces[0])
    each = dr.opaque(mi.UInt32, n)
    index = dr.arange(mi.UInt32, dr.width(blocks.p) * n)
    block = index // each
    i = index - block * each
    p = dr.gather(type(blocks.p), blocks.p, block)
    normal = dr.gather(type(blocks.n), blocks.n, block)
    radius = tab.types.Float(dr.gather(type(blocks.radius), blocks.radius, block))
    bend = dr.gather(type(blocks.bend), blocks.bend, block)
    active = dr.gather(type(blocks.active), blocks.active, block)
    x = mi.Point3f(p)
    if probe is not None:
        x = x + probe.epsilon(x) * normal
    fr = frame(source, p, tab)
    beside = None
    if grazing is not None:
        r = tab.types.Float(blocks.radius)
        middle = Receivers(blocks.p, blocks.n, blocks.active)
        beside = near(frame(source, blocks.p, tab), grazing, k, middle, r)
        dr.eval(beside.body, beside.v2, beside.next_body, beside.next_v2)
    seen = _Seen(
        *_seen(
            fr, tab, i, k, rule, share, probe, x, tab.types.Vector(normal), radius,
            tab.types.Float(bend), None if beside is None or grazing is None else beside.of(block, active, grazing), tolerance
        )
    )
    limit = 2 * np.pi * tolerance
    inner2 = mi.Float(seen.inner2)
    start, stop = mi.Float(seen.start), mi.Float(seen.stop)
    open_ = active & seen.sounds & seen.clear
    heard = active & seen.near
    far = heard & seen.far
    passes = heard & seen.grazed
    dr.eval(open_, heard, far, inner2, start, stop, bend, passes)

    changes = bend > 0
    for side in blocks.beside:
        other = dr.gather(mi.UInt32, side, block) * each + i
        changes |= dr.gather(mi.Bool, open_, other) != open_
    faint = far & (dr.maximum(dr.abs(start), dr.abs(stop)) < UNTESTED * limit)
    tested = heard & (changes & ~faint | passes)
    open_ = open_ & ~tested
    dropped = open_ & far & (inner2 < dr.square(CORNER * limit))
    kept = open_ & ~dropped
    dr.eval(tested, kept, dropped)

    follows = dr.gather(mi.Bool, tab.follows, i)
    before = dr.maximum(index, 1) - 1
    corner_ = start - dr.gather(mi.Float, stop, before)
    joint = follows & dropped & dr.gather(mi.Bool, dropped, before) & (dr.abs(corner_) < CORNER * limit)
    along = follows & kept & dr.gather(mi.Bool, kept, before)
    dr.eval(joint, along)
    after = dr.minimum(index + 1, dr.width(index) - 1)
    ends = index + 1 < dr.width(index)
    joint_after = ends & dr.gather(mi.Bool, joint, after)
    along_after = ends & dr.gather(mi.Bool, along, after)
    begins, stops = dropped & ~joint, dropped & ~joint_after
    out_start, out_stop = dr.abs(start) < CORNER * limit, dr.abs(stop) < CORNER * limit
    left2 = dr.select(dropped, inner2, 0) + dr.select(joint, dr.square(corner_), 0)
    left2 += dr.select(begins & out_start, dr.square(start), 0) + dr.select(stops & out_stop, dr.square(stop), 0)
    first = dr.gather(mi.UInt32, tab.ranges, 2 * i)
    last = dr.gather(mi.UInt32, tab.ranges, 2 * i + 1) - 1
    left = dr.sqrt(dr.block_sum(left2, n)) / (2 * np.pi)
    dr.eval(begins, stops, left, first, last)
    verdicts = _verdicts(source, tab, probe, blocks, tested, passes, n)
    reaches = verdicts != 0
    return Lists(
        List.of(reaches, i, n),
        List.of(reaches, verdicts, n).items,
        List.of(kept & ~along, first, n),
        List.of(kept & ~along_after, last, n),
        List.of(begins & ~out_start, first, n),
        List.of(stops & ~out_stop, last, n),
        left,
        beside,
    )


def _verdicts(
    source: Source, tab: Table, probe: Rays | None, blocks: Blocks, tested: Any, passes: Any, n: int
) -> Any:
    """Which cells of blocks pieces reach, of those that are `tested`: by a ray to each corner of the cells.

    Where corners differ, or lie on another surface, the cell is to be asked, and all of them for what `passes` others.
    """
    found = dr.zeros(mi.UInt32, len(tested))
    pair = dr.compress(tested)
    if probe is None or len(pair) == 0:
        dr.scatter(found, mi.UInt32(ALL), pair)
        return found
    side = ACROSS + 1
    index = dr.arange(mi.UInt32, len(pair) * side * side)
    entry = index // (side * side)
    place = index - entry * (side * side)
    of = dr.gather(mi.UInt32, pair, entry)
    reached = _reached(source, tab, probe, blocks, of // n, place, of % n)
    bits = dr.block_sum(dr.select(reached, mi.UInt32(1) << place, 0), side * side)
    members = dr.gather(mi.UInt32, blocks.members, pair // n)
    whole, none = mi.UInt32(0), mi.UInt32(0)
    for y in range(ACROSS):
        for x in range(ACROSS):
            corners = sum(1 << ((y + dy) * side + x + dx) for dy in (0, 1) for dx in (0, 1))
            cell = 1 << (y * ACROSS + x)
            of = members & corners
            whole |= dr.select((of != 0) & ((bits & of) == of), cell, 0)
            none |= dr.select((of != 0) & ((bits & of) == 0), cell, 0)
    verdict = whole | ((~(whole | none) & (ALL >> CELLS)) << CELLS)
    dr.scatter(found, dr.select(dr.gather(mi.Bool, passes, pair), ALL, verdict), pair)
    dr.eval(found)
    return found


def _reached(source: Source, tab: Table, probe: Rays, blocks: Blocks, of: Any, place: Any, i: Any) -> Any:
    """Whether pieces reach corners of cells of blocks."""
    at = of * (ACROSS + 1) ** 2 + place
    p = dr.gather(type(blocks.lattice), blocks.lattice, at)
    n = dr.gather(type(blocks.normals), blocks.normals, at)
    piece = tab.piece(i)
    acts = sounds(frame(source, p, tab), piece, tab.types.Vector(n))
    x = mi.Point3f(piece.middle + constant(tab.types.Vector, tab.centre))
    q = mi.Point3f(p)
    return acts & probe.reaches(x, piece, q + probe.epsilon(q) * n, acts)


@dr.syntax
def listed_sum(
    fr: Frame, tab: Table, found: Lists, k: Any, rule: Rule, tested: tuple[Sum, Nearest, Margins], receivers: Receivers
) -> tuple[Sum, Nearest, Margins]:
    """The sum over all that acts on the receivers' blocks; `tested`: what their pieces to be tested make of it."""
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    sums, nearest, margins = tested
    real, imag, err_real, err_imag, rounding2 = sums[:5]
    nearest2, nearest_segment, receiver2 = F(nearest.distance2), U(nearest.segment), F(margins.receiver2)
    active, block = receivers.active, receivers.block
    i, end = found.tested.bounds(block, active)
    while active & (i < end):
        whole = active & found.verdict(i, receivers.cell)
        if whole:
            chain = chain_wave(fr, tab, *tab.range(found.tested.item(i)), k, rule, None, False, whole)
            real, imag = real + chain.wave.real, imag + chain.wave.imag
            err_real, err_imag = err_real + chain.wave.err_real, err_imag + chain.wave.err_imag
            rounding2 += chain.wave.rounding2
            receiver2 = dr.minimum(receiver2, chain.receiver2)
            nearest_segment = dr.select(chain.distance2 < nearest2, chain.segment, nearest_segment)
            nearest2 = dr.minimum(nearest2, chain.distance2)
        i += 1
    i, end = found.first.bounds(block, active)
    while active & (i < end):
        chain = chain_wave(fr, tab, found.first.item(i), found.last.item(i) + 1, k, rule, None, False, active)
        real, imag = real + chain.wave.real, imag + chain.wave.imag
        err_real, err_imag = err_real + chain.wave.err_real, err_imag + chain.wave.err_imag
        rounding2 += chain.wave.rounding2
        receiver2 = dr.minimum(receiver2, chain.receiver2)
        nearest_segment = dr.select(chain.distance2 < nearest2, chain.segment, nearest_segment)
        nearest2 = dr.minimum(nearest2, chain.distance2)
        i += 1
    i, end = found.begins.bounds(block, active)
    while active & (i < end):
        seg = tab.segment(found.begins.item(i))
        re, im = leading(fr.a, corner(fr, seg.X0, k), seg.e, k)
        real, imag = real + re, imag + im
        i += 1
    i, end = found.stops.bounds(block, active)
    while active & (i < end):
        seg = tab.segment(found.stops.item(i))
        re, im = leading(fr.a, corner(fr, seg.X1, k), seg.e, k)
        real, imag = real - re, imag - im
        i += 1
    left = F(dr.gather(type(found.left), found.left, block, active))
    return (
        Sum(real, imag, err_real, err_imag, rounding2, sums.unasked + left),
        Nearest(nearest2, nearest_segment),
        Margins(nearest2, receiver2),
    )
