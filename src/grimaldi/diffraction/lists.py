"""Lists of what acts on each block of receivers, and the sum over what is on them; `listing` finds them.

A piece near the ray, or one that reaches part of the block, is asked for at every receiver. Of pieces that reach all of
it, neighbours in a chain make one run; far from the ray, where ψ = kΔ runs fast, a run is no more than the leading
terms of its two ends, C φ' e^{iψ}/(iψ').
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.chains import Chain, Passed, chain_wave
from grimaldi.diffraction.chirps import PLACES, SIDE, Chirps, place, quadrant
from grimaldi.diffraction.corners import corner, leading
from grimaldi.diffraction.edges import Asked, Margins, Nearest, Sum
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.grazing import Chords, Near
from grimaldi.diffraction.hierarchy import NONE
from grimaldi.diffraction.model import Boxes, Receivers
from grimaldi.diffraction.segment import Rule, Wave
from grimaldi.diffraction.table import Piece, Table
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for


class List(NamedTuple):
    """Items of each block, one block after the other."""

    begin: Any  # where each block's items begin, and where the last ends
    items: Any

    @staticmethod
    def of(chosen: Any, block: Any, blocks: int, items: Any) -> List:
        """The `chosen` of items, which lie in order of their blocks."""
        count = dr.zeros(mi.UInt32, blocks + 1)
        dr.scatter_add(count, mi.UInt32(1), block + 1, chosen)
        return List(dr.cumsum(count), dr.gather(type(items), items, places(chosen)))

    def item(self, i: Any) -> Any:
        """What stands at a place."""
        return dr.gather(type(self.items), self.items, i)

    def bounds(self, block: Any, active: Any) -> tuple[Any, Any]:
        """The first item of a block, and the one after its last."""
        return dr.gather(mi.UInt32, self.begin, block, active), dr.gather(mi.UInt32, self.begin, block + 1, active)


def places(flags: Any) -> Any:
    """Where flags are set; a place too many where none is."""
    found: Any = dr.compress(flags)
    # an array that nothing can be gathered from stops a kernel
    return found if len(found) else dr.zeros(mi.UInt32, 1)


class Runs(NamedTuple):
    """Segments that follow each other: where runs begin, and the last of each."""

    first: List
    last: List


BOXED = 1.3  # of half a box, that what is told there holds as far from its middle
INNER = 3  # places across a cell, and a mark of what is told by these
FINELY = 1 << INNER * INNER


class Parts(NamedTuple):
    """Pieces that reach cells in part: between places that they reach or not, what they send grows evenly.

    A bit for each corner of a cell, row by row; or, marked FINELY, for each of INNER × INNER places of it.
    """

    pieces: List
    corners: Any

    def share(self, i: Any, receivers: Receivers) -> Any:
        """How much of the piece at a place reaches receivers."""
        bits = dr.gather(mi.UInt32, self.corners, i)
        finely = bits >= FINELY
        parts, step = dr.select(finely, mi.UInt32(INNER - 1), 1), dr.select(finely, mi.UInt32(INNER), 2)
        u, v = receivers.u * mi.Float(parts), receivers.v * mi.Float(parts)
        column, row = (dr.minimum(mi.UInt32(x), parts - 1) for x in (u, v))
        bits = bits >> (row * step + column)
        u, v = u - mi.Float(column), v - mi.Float(row)
        near, far = (dr.lerp(mi.Float(b & 1), mi.Float((b >> 1) & 1), u) for b in (bits, bits >> step))
        return dr.lerp(near, far, v)


class Lists(NamedTuple):
    """What acts on each block, or on each cell: pieces, runs that reach it, ends of runs, |M| left out.

    Pieces whose waves are chirps over a quadrant of a block are on no other list of what reaches it than those of
    chirps. Cell c of block b has the place c · blocks + b in lists of cells, and so have quadrants.
    """

    blocks: Any  # how many
    asked: List  # of cells: pieces that each receiver asks for
    asked_chirps: Any  # of each of these, what tells its wave; NONE where its segments do
    partly: Parts  # of cells: pieces that reach it, or a part of it, but not all of the block as far as is known
    partly_solids: Any  # of each of these, the solid that tells its wave in the block's box; NONE where there is none
    solids: Chirps
    boxes: Boxes
    runs: Runs  # of quadrants
    chirps: Chirps
    chirped: Parts  # of cells: those that reach it
    everywhere: List  # of quadrants: those that reach the block
    clear: Any  # least distance from what sends chirps: of the rays to PLACES of each block
    receiver2: Any  # and of those places themselves, squared
    begins: List  # of blocks: segments at whose start a far run begins
    stops: List  # and at whose end one stops
    left: Any
    beside: Near | None  # the bodies whose silhouettes pass closest by each

    def cell(self, receivers: Receivers) -> Any:
        """The places of receivers' cells."""
        return receivers.cell * self.blocks + receivers.block

    def quadrant(self, receivers: Receivers) -> Any:
        """The places of receivers' quadrants."""
        return quadrant(receivers.cell) * self.blocks + receivers.block

    def near(self, receivers: Receivers, silhouettes: Chords | None) -> Near | None:
        """The bodies beside the receivers' blocks."""
        if self.beside is None or silhouettes is None:
            return None
        return self.beside.of(receivers.block, receivers.active, silhouettes)


class Listed(NamedTuple):
    """The pieces that receivers ask for, as a walk."""

    lists: Lists
    table: Table
    receivers: Receivers

    def bounds(self, receivers: Receivers) -> tuple[Any, Any]:
        return self.lists.asked.bounds(self.lists.cell(receivers), receivers.active)

    def visit(self, fr: Frame, i: Any) -> tuple[Any, Any, Any]:
        always = dr.mask_t(fr.z2)(True)
        return self.lists.asked.item(i), always, always

    def after(self, i: Any, inside: Any) -> Any:
        return i + 1

    def asked(self, fr: Frame, item: Any, piece: Piece, k: Any, acts: Any) -> Asked:
        """A ray of all: others are on no such list."""
        return Asked(acts, acts, 0)

    def weight(self, fr: Frame, piece: Piece) -> Any:
        return 1

    @syntax
    def chain(self, fr: Frame, i: Any, piece: Piece, k: Any, rule: Rule, passed: Passed | None, active: Any) -> Chain:
        """By its chirp, or by its segments where it has none."""
        index = dr.gather(mi.UInt32, self.lists.asked_chirps, i, active)
        told = active & (index != NONE)
        whole = chain_wave(fr, self.table, piece.first, piece.end, k, rule, active & ~told, passed)
        real, imag, *rest = whole.wave
        if told:
            re, im = self.lists.chirps.at(index, place(self.receivers))
            real, imag = type(real)(re), type(imag)(im)
        return whole._replace(wave=Wave(real, imag, *rest))


def _with(total: tuple[Any, ...], chain: Chain, share: Any) -> tuple[Any, ...]:
    """A share of a chain added to the five of a sum, the least distances² to P and to the ray, and the segment there.

    A plain tuple: what Dr.Jit can carry from turn to turn.
    """
    *sums, receiver2, nearest2, segment = total
    return (
        *(dr.fma(share, wave, s) for s, wave in zip(sums, chain.wave, strict=True)),
        dr.minimum(receiver2, chain.receiver2),
        dr.minimum(nearest2, chain.distance2),
        dr.select(chain.distance2 < nearest2, chain.segment, segment),
    )


Tell = Callable[[Any, Any, Any], Chain]
"""tell(first, end, active): what neighbouring segments send."""


@syntax
def _of_parts(total: tuple[Any, ...], found: Lists, tab: Table, tell: Tell, receivers: Receivers, at: Any) -> Any:
    """The total, as in `_with`, with the pieces at some place of lists as far as they reach."""
    F = type(total[0])
    parts = found.partly
    i, end = parts.pieces.bounds(at, receivers.active)
    where = found.boxes.place(receivers.p, receivers.block, i < end)
    boxed = dr.maximum(dr.maximum(dr.abs(where[0]), dr.abs(where[1])), dr.abs(where[2])) <= BOXED
    while receivers.active & (i < end):
        weight = F(parts.share(i, receivers))
        reached = receivers.active & (weight > 0)
        solid = dr.gather(mi.UInt32, found.partly_solids, i, reached & boxed)
        told = reached & boxed & (solid != NONE)
        if told:
            re, im = found.solids.at(solid, where)
            total = dr.fma(weight, F(re), total[0]), dr.fma(weight, F(im), total[1]), *total[2:]
        if reached & ~told:
            total = _with(total, tell(*tab.range(parts.pieces.item(i)), reached & ~told), weight)
        i += 1
    return total


@syntax
def _of_runs(total: tuple[Any, ...], runs: Runs, tell: Tell, active: Any, at: Any) -> Any:
    """The same with the runs at some place of lists."""
    F = type(total[0])
    i, end = runs.first.bounds(at, active)
    while active & (i < end):
        total = _with(total, tell(runs.first.item(i), runs.last.item(i) + 1, active), F(1))
        i += 1
    return total


@syntax
def _of_chirps(found: Lists, receivers: Receivers, at: Any) -> tuple[Any, Any]:
    """What is told by chirps, of the receivers' blocks and of their cells at places of lists."""
    at_place, active = place(receivers), receivers.active
    F = found.chirps.types.Float
    real, imag = F(0), F(0)
    i, end = found.everywhere.bounds(found.quadrant(receivers), active)
    while active & (i < end):
        re, im = found.chirps.at(found.everywhere.item(i), at_place)
        real, imag = real + re, imag + im
        i += 1
    i, end = found.chirped.pieces.bounds(at, active)
    while active & (i < end):
        weight = F(found.chirped.share(i, receivers))
        re, im = found.chirps.at(found.chirped.pieces.item(i), at_place)
        real, imag = dr.fma(weight, re, real), dr.fma(weight, im, imag)
        i += 1
    return real, imag


def _margins(found: Lists, receivers: Receivers) -> Margins:
    """Squared distances to what sends chirps, by what they are at PLACES of blocks."""
    u, v = (0.5 * (SIDE - 1) * (x + 1) for x in place(receivers))
    column, row = (dr.minimum(mi.UInt32(x), SIDE - 2) for x in (u, v))
    first = receivers.block * PLACES + row * SIDE + column

    def near(values: Any) -> list[Any]:
        return [dr.gather(mi.Float, values, first + i, receivers.active) for i in (0, 1, SIDE, SIDE + 1)]

    a, b, c, d = near(found.clear)
    clear = dr.lerp(dr.lerp(a, b, u - column), dr.lerp(c, d, u - column), v - row)
    a, b, c, d = near(found.receiver2)
    return Margins(dr.square(clear), dr.minimum(dr.minimum(a, b), dr.minimum(c, d)))


@syntax
def _of_ends(fr: Frame, tab: Table, k: Any, ends: List, stop: int, active: Any, at: Any) -> tuple[Any, Any]:
    """What far runs send from where they begin, or less the same where they `stop` (0 or 1), at some place of lists."""
    F = tab.types.Float
    real, imag = F(0), F(0)
    i, end = ends.bounds(at, active)
    while active & (i < end):
        seg = tab.segment(ends.item(i))
        re, im = leading(fr.a, corner(fr, (seg.X0, seg.X1)[stop], k), seg.e, k)
        real, imag = real + re, imag + im
        i += 1
    sign = 1 - 2 * stop
    return sign * real, sign * imag


def listed_sum(
    fr: Frame,
    found: Lists,
    tab: Table,
    k: Any,
    rule: Rule,
    asked: tuple[Sum, Nearest, Margins],
    receivers: Receivers,
) -> tuple[Sum, Nearest, Margins]:
    """The sum over all that acts on the receivers' blocks; `asked`: what the pieces that `Listed` walks make of it."""
    F = tab.types.Float
    sums, nearest, margins = asked
    active, block, cell = receivers.active, receivers.block, found.cell(receivers)

    def tell(first: Any, end: Any, active: Any) -> Chain:
        return chain_wave(fr, tab, first, end, k, rule, active)

    total: tuple[Any, ...] = (*sums[:5], F(margins.receiver2), F(nearest.distance2), nearest.segment)
    total = _of_parts(total, found, tab, tell, receivers, cell)
    total = _of_runs(total, found.runs, tell, active, found.quadrant(receivers))
    real, imag, err_real, err_imag, rounding2, receiver2, nearest2, segment = total
    for ends, stop in ((found.begins, 0), (found.stops, 1)):
        re, im = _of_ends(fr, tab, k, ends, stop, active, block)
        real, imag = real + re, imag + im
    re, im = _of_chirps(found, receivers, cell)
    real, imag = real + F(re), imag + F(im)
    chirps = _margins(found, receivers)
    ray2, receiver2 = dr.minimum(nearest2, F(chirps.ray2)), dr.minimum(receiver2, F(chirps.receiver2))
    left = F(dr.gather(type(found.left), found.left, block, active))
    return (
        Sum(real, imag, err_real, err_imag, rounding2, sums.unasked + left),
        Nearest(nearest2, segment),
        Margins(ray2, receiver2),
    )
