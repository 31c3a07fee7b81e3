"""Lists of what acts on each block of receivers, and the sum over what is on them; `listing` finds them.

A piece near the ray, or one that reaches part of the block, is asked for at every receiver. Of pieces that reach all of
it, neighbours in a chain make one run; far from the ray, where ψ = kΔ runs fast, a run is no more than the leading
terms of its two ends, C φ' e^{iψ}/(iψ').
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.corners import corner, leading
from grimaldi.diffraction.edges import Chain, Margins, Nearest, Sum, chain_wave, cut_off
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.grazing import Chords, Near
from grimaldi.diffraction.model import ACROSS, LATTICE, Receivers
from grimaldi.diffraction.segment import Rule
from grimaldi.diffraction.table import Piece, Table

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

WEAK_HERE = 0.2  # of the tolerance: |M| of an end at a receiver, of whatever piece, that takes no ray


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


class Lists(NamedTuple):
    """What acts on each block: pieces to be tested, runs of segments that reach it, ends of runs, |M| left out."""

    tested: List  # pieces
    asked: Any  # of each of those a bit for each cell where it is tested at every receiver
    reached: Any  # elsewhere it reaches corners of cells, a bit for each, and what lies between in part
    first: List  # segments where runs begin
    last: List  # and the last of each
    begins: List  # segments at whose start a far run begins
    stops: List  # and at whose end one stops
    left: Any
    beside: Near | None  # the bodies whose silhouettes pass closest by each

    def asks(self, i: Any, cell: Any) -> Any:
        """Whether a piece to be tested is asked for at each receiver in a cell."""
        return ((dr.gather(mi.UInt32, self.asked, i) >> cell) & 1) != 0

    def share(self, i: Any, receivers: Receivers) -> Any:
        """How much of a piece reaches receivers, by the corners of their cells: between them it grows evenly."""
        cell = receivers.cell
        bits = dr.gather(mi.UInt32, self.reached, i) >> ((cell // ACROSS) * LATTICE + cell % ACROSS)
        near, far = (
            dr.lerp(mi.Float((bits >> row) & 1), mi.Float((bits >> (row + 1)) & 1), receivers.u) for row in (0, LATTICE)
        )
        return dr.lerp(near, far, receivers.v)

    def near(self, receivers: Receivers, silhouettes: Chords | None) -> Near | None:
        """The bodies beside the receivers' blocks."""
        if self.beside is None or silhouettes is None:
            return None
        return self.beside.of(receivers.block, receivers.active, silhouettes)


class Listed(NamedTuple):
    """The pieces that reach part of the receivers' blocks, as a walk."""

    lists: Lists
    cell: Any  # of the receivers, in their blocks
    table: Table
    k: Any
    weak: Any  # |M| of an end, below which no ray is asked for

    def bounds(self, receivers: Receivers) -> tuple[Any, Any]:
        return self.lists.tested.bounds(receivers.block, receivers.active)

    @dr.syntax
    def asks(self, fr: Frame, i: Any) -> Any:
        """Whether the piece at a place takes a ray."""
        ask = self.lists.asks(i, self.cell)
        if ask:
            piece = self.table.piece(self.lists.tested.item(i))
            ask &= cut_off(fr, piece, self.k) >= self.weak
        return ask

    def visit(self, fr: Frame, i: Any) -> tuple[Any, Any, Any]:
        ask = self.asks(fr, i)
        return self.lists.tested.item(i), ask, ask

    def after(self, i: Any, inside: Any) -> Any:
        return i + 1

    def weight(self, fr: Frame, piece: Piece) -> Any:
        return type(fr.z2)(1)


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


@dr.syntax
def listed_sum(
    fr: Frame, walk: Listed, rule: Rule, tested: tuple[Sum, Nearest, Margins], receivers: Receivers
) -> tuple[Sum, Nearest, Margins]:
    """The sum over all that acts on the receivers' blocks; `tested`: what the pieces of the walk make of it."""
    found, tab, k = walk.lists, walk.table, walk.k
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    sums, nearest, margins = tested
    total = (*sums[:5], F(margins.receiver2), F(nearest.distance2), U(nearest.segment))
    active, block = receivers.active, receivers.block
    i, end = found.tested.bounds(block, active)
    while active & (i < end):
        share = F(found.share(i, receivers))
        known = active & (share > 0) & ~walk.asks(fr, i)
        if known:
            chain = chain_wave(fr, tab, *tab.range(found.tested.item(i)), k, rule, None, False, known)
            total = _with(total, chain, share)
        i += 1
    i, end = found.first.bounds(block, active)
    while active & (i < end):
        first, last = found.first.item(i), found.last.item(i)
        total = _with(total, chain_wave(fr, tab, first, last + 1, k, rule, None, False, active), F(1))
        i += 1
    real, imag, err_real, err_imag, rounding2, receiver2, nearest2, nearest_segment = total
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
