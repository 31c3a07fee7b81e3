"""Sums of boundary waves over outlines, and on which side of them a ray runs (THEORY eq. 4-6).

The sum and n take the side of an edge from the same κ, so that M runs smoothly through the shadow's rim.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from grimaldi.diffraction.arrays import on_device
from grimaldi.diffraction.chains import Chain, Passed, ahead, basis, chain_wave, crossing, exact
from grimaldi.diffraction.frame import HORIZON, ROUNDINGS, Frame, constant
from grimaldi.diffraction.grazing import Near, grazed, other_than, worth
from grimaldi.diffraction.hierarchy import NONE, least_detour
from grimaldi.diffraction.model import Receivers
from grimaldi.diffraction.occlusion import Rays
from grimaldi.diffraction.segment import Rule, growth, line, path
from grimaldi.diffraction.table import Piece, Table
from grimaldi.syntax import syntax


class Sum(NamedTuple):
    """Σ ∫ C e^{ikΔ} dφ, its error estimate, the square of its ends' rounding, and |M| taken for visible unasked."""

    real: Any
    imag: Any
    err_real: Any
    err_imag: Any
    rounding2: Any
    unasked: Any


class Nearest(NamedTuple):
    """The outline that the ray S→P passes closest by."""

    distance2: Any
    segment: Any


class Margins(NamedTuple):
    """Squared distances of the ray S→P, and of P itself, to the outline nearest to each."""

    ray2: Any
    receiver2: Any


# ---------------------------------------------------------------- planar holes and masks


@syntax
def planar_sum(fr: Frame, tab: Table, k: Any, rule: Rule, active: Any) -> tuple[Sum, Any, Margins]:
    """The sum over whole planar loops, nothing in between, and n = (1/2π)∮dφ as an exact count."""
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    real, imag, err_real, err_imag = F(0), F(0), F(0), F(0)
    ray2, receiver2, rounding2 = F(dr.inf), F(dr.inf), F(0)
    n, i = F(0), U(0)
    while active & (i < tab.n_pieces):
        chain = chain_wave(fr, tab, *tab.range(i), k, rule, active)
        n += chain.n
        real, imag = real + chain.wave.real, imag + chain.wave.imag
        err_real, err_imag = err_real + chain.wave.err_real, err_imag + chain.wave.err_imag
        rounding2 += chain.wave.rounding2
        ray2 = dr.minimum(ray2, chain.distance2)
        receiver2 = dr.minimum(receiver2, chain.receiver2)
        i += 1
    return Sum(real, imag, err_real, err_imag, rounding2, F(0)), n, Margins(ray2, receiver2)


@syntax
def planar_count(fr: Frame, tab: Table, active: Any) -> Any:
    """n of `planar_sum` alone."""
    F = tab.types.Float
    n, j = F(0), dr.uint32_array_t(F)(0)
    _, across = basis(fr.a)
    while active & (j < tab.size):
        seg = tab.segment(j)
        n += crossing(*ahead(fr, seg, across), line(fr, seg.X0, seg.e).kappa)
        j += 1
    return n


# ---------------------------------------------------------------- bodies


def sounds(fr: Frame, piece: Piece, n: Any) -> Any:
    """Whether an outline piece can send a wave to a receiver at all (THEORY 2).

    A receiver on a surface, normal n, hears only what rises above its horizon: so a body's own outline does not
    act on its lit side, nor an edge that touches the receiver. The border of a sheet does not act on the side
    that the source lights.
    """
    d = fr.foot + fr.z2 * fr.a - piece.middle  # X→P
    length = dr.norm(d)
    free = dr.squared_norm(n) == 0
    aside = 2 * ROUNDINGS * dr.epsilon(length) * fr.lever  # by which the ray was moved, P with it
    above = free | (dr.dot(n, d) < -HORIZON * length - aside)
    behind = (piece.closed > 0.5) | (dr.dot(piece.lit, d) < -1e-6 * length)
    return above & behind


def cut_off(fr: Frame, piece: Piece, k: Any) -> Any:
    """|M| that the chain's wave, cut off somewhere on this piece, would at most leave.

    The end of a chain sends |M| = √D / (4π (D + w) √w), D = kΔs at the stationary point, w = k(Δ - Δs).
    """
    st = path(fr, line(fr, piece.middle, piece.e), k)
    D = dr.maximum(st.A, 0.01)
    w = dr.maximum(growth(fr, st, dr.copysign(dr.maximum(dr.abs(st.t) - piece.reach, 0), -st.t), k), 0.1)
    return dr.sqrt(D) / (4 * np.pi * (D + w) * dr.sqrt(w))


class Asked(NamedTuple):
    """What a walk makes of the ways X→P from pieces."""

    acts: Any  # those that are not known to be blocked
    tested: Any  # those of them that take a ray
    left: Any  # |M| that the others may be wrong by


class Told(Protocol):
    """What is known of ways X→P without a ray."""

    def reach(self, item: Any, left: Any) -> tuple[Any, Any]:
        """Which pieces are known to be blocked, and which to be free, where a chain cut off leaves |M| = left."""
        ...


class Walk(Protocol):
    """The pieces that receivers ask, one after the other."""

    def bounds(self, receivers: Receivers) -> tuple[Any, Any]:
        """Where to begin, and where to stop."""
        ...

    def visit(self, fr: Frame, i: Any) -> tuple[Any, Any, Any]:
        """The piece at a place, whether to take it, and whether to go into what the place stands for."""
        ...

    def after(self, i: Any, inside: Any) -> Any:
        """The next place."""
        ...

    def asked(self, fr: Frame, item: Any, piece: Piece, k: Any, acts: Any) -> Asked:
        """What to ask of the pieces that act."""
        ...

    def weight(self, fr: Frame, piece: Piece) -> Any:
        """What the wave of a piece counts."""
        ...

    def chain(self, fr: Frame, i: Any, piece: Piece, k: Any, rule: Rule, passed: Passed | None, active: Any) -> Chain:
        """What the piece at a place sends."""
        ...


def taper(x: Any) -> Any:
    """1 up to x = 1/2, going smoothly to 0 at 1: a sharp end would send a wave of its own."""
    t = dr.clip(2 - 2 * x, 0, 1)
    return t * t * (3 - 2 * t)


class Everywhere(NamedTuple):
    """All pieces that are near enough to matter, by the table's hierarchy."""

    table: Table
    least: float = 0.0
    told: Told | None = None

    def bounds(self, receivers: Receivers) -> tuple[Any, Any]:
        U = dr.uint32_array_t(self.table.types.Float)
        return U(0), self.table.tree.size

    def visit(self, fr: Frame, i: Any) -> tuple[Any, Any, Any]:
        """A run is taken as one where it subtends a small angle about the ray."""
        tab = self.table
        centre, radius = tab.tree.node(i)
        inside = least_detour(fr, centre, radius) <= tab.far
        item = tab.tree.item_of(i)
        x = centre - fr.foot
        d2 = dr.squared_norm(x) - dr.square(dr.dot(x, fr.a))
        whole = (item < tab.n_pieces) | ((item != NONE) & (dr.square(radius) < dr.square(tab.angle) * d2))
        return item, inside & whole, inside & ~whole

    def after(self, i: Any, inside: Any) -> Any:
        return self.table.tree.after(i, inside)

    def asked(self, fr: Frame, item: Any, piece: Piece, k: Any, acts: Any) -> Asked:
        """All but those that are known, or would leave less than `least` where a chain is cut off on them."""
        left = cut_off(fr, piece, k)
        worth = left > self.least
        unasked = dr.select(acts & ~worth, left, 0)
        if self.told is None:
            return Asked(acts, acts & worth, unasked)
        blocked, free = self.told.reach(item, left)
        acts &= ~blocked
        return Asked(acts, acts & worth & ~free, unasked)

    def weight(self, fr: Frame, piece: Piece) -> Any:
        """By how near the ray it lies."""
        return taper(least_detour(fr, piece.middle, 0) / self.table.far)

    def chain(self, fr: Frame, i: Any, piece: Piece, k: Any, rule: Rule, passed: Passed | None, active: Any) -> Chain:
        """By its segments."""
        return chain_wave(fr, self.table, piece.first, piece.end, k, rule, active, passed)


@syntax
def body_sum(
    fr: Frame,
    tab: Table,
    walk: Walk,
    k: Any,
    rule: Rule,
    tolerance: float,
    probe: Rays | None,
    beside: Near | None,
    receivers: Receivers,
) -> tuple[Sum, Nearest, Margins]:
    """The sum over the outlines of bodies, piece by piece of a walk, each as far as it reaches the receiver.

    Without a probe none takes a ray. Without silhouettes near by a piece reaches the receiver or does not.
    """
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    ray, there, _ = exact(fr, tab)
    n = there.types.Vector(receivers.n)
    p = mi.Point3f(receivers.p)
    if dr.hint(probe is not None, mode="scalar"):
        assert probe is not None
        p = p + probe.epsilon(p) * receivers.n  # off its own surface
    real, imag, err_real, err_imag = F(0), F(0), F(0), F(0)
    nearest2, nearest_segment = F(dr.inf), U(0)
    receiver2, rounding2, unasked = F(dr.inf), F(0), F(0)
    i, end = walk.bounds(receivers)
    while receivers.active & (i < end):
        item, taken, inside = walk.visit(fr, i)
        if receivers.active & taken:
            piece, finer = tab.piece(item), there.piece(item)
            acts = sounds(ray, finer, n)
            visible = dr.mask_t(F)(acts)
            past_real, past_imag = F(0), F(0)
            if dr.hint(probe is not None, mode="scalar"):
                assert probe is not None
                acts, tested, left = walk.asked(fr, item, piece, k, acts)
                visible = dr.mask_t(F)(acts)
                unasked += left
                if tested:
                    x = mi.Point3f(finer.middle + constant(there.types.Vector, tab.centre))
                    visible = acts & probe.reaches(x, piece, p, tested)
                if dr.hint(beside is not None, mode="scalar"):
                    assert beside is not None
                    body, v2, close = other_than(beside, piece)
                    close &= tested
                    if close:
                        close &= worth(cut_off(fr, piece, k), v2, tolerance)
                    if close:
                        past_real, past_imag = grazed(fr, beside.silhouettes, piece, body, visible, k, close)
                acts = visible | (past_real != 0) | (past_imag != 0)
            weight = walk.weight(fr, piece)
            acts &= weight > 0
            passed = Passed(visible, past_real, past_imag) if beside is not None else None
            chain = walk.chain(fr, i, piece, k, rule, passed, acts)
            real, imag = dr.fma(weight, chain.wave.real, real), dr.fma(weight, chain.wave.imag, imag)
            err_real, err_imag = err_real + chain.wave.err_real, err_imag + chain.wave.err_imag
            rounding2 += chain.wave.rounding2
            receiver2 = dr.minimum(receiver2, chain.receiver2)
            closer = visible & acts & (chain.distance2 < nearest2)
            nearest2 = dr.select(closer, chain.distance2, nearest2)
            nearest_segment = dr.select(closer, chain.segment, nearest_segment)
        i = walk.after(i, inside)
    nearest = Nearest(nearest2, nearest_segment)
    return Sum(real, imag, err_real, err_imag, rounding2, unasked), nearest, Margins(nearest2, receiver2)


@syntax
def _crossings(fr: Frame, tab: Table, bend: Any, n: Any, active: Any) -> Any:
    """Signed count of outlines between the straight way S→P and the bent one S→`bend`→P."""
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    x = bend - fr.foot
    along = dr.dot(x, fr.a)
    q = x - along * fr.a
    height = dr.norm(q)
    across = dr.cross(fr.a, q / height)
    count, i = F(0), U(0)
    while active & (i < tab.tree.size):
        centre, radius = tab.tree.node(i)
        c = centre - fr.foot
        inside = dr.squared_norm(c - dr.dot(c, fr.a) * fr.a) <= dr.square(radius + height)
        item = tab.tree.item_of(i)
        single = item < tab.n_pieces
        if active & inside & single:
            piece = tab.piece(item)
            acts = sounds(fr, piece, n)
            j = U(piece.first)
            while acts & (j < piece.end):
                seg = tab.segment(j)
                ln = line(fr, seg.X0, seg.e)
                c0, c1 = ahead(fr, seg, across)
                turn = crossing(c0, c1, ln.kappa)
                out = dr.abs(ln.kappa) * seg.length / dr.abs(c1 - c0)
                z = ln.h + ln.ea * dr.clip(ln.td, 0, seg.length)
                # the bent way is a triangle over the ray, `height` high where it bends
                top = (fr.z2 - z) / (fr.z2 - along)
                if not fr.plane:
                    top = dr.minimum(top, (fr.z1 + z) / (fr.z1 + along))
                count += dr.select(out < height * dr.minimum(top, 1), turn, 0)
                j += 1
        i = tab.tree.after(i, inside & ~single)
    return count


@syntax
def lit_share(fr: Frame, tab: Table, nearest: Nearest, probe: Rays, receivers: Receivers) -> Any:
    """1 - n: 1 where the ray S→P is free, 0 where it meets a lit surface.

    A traced ray settles it, but not at the rim, where Float32 rays and the outline disagree now and then: there
    a ray is traced that bends round the open side, and the outlines between the two are counted.
    """
    F = tab.types.Float
    V = tab.types.Vector
    p = mi.Point3f(receivers.p)
    epsilon = probe.epsilon(p)
    p = p + epsilon * receivers.n
    rim = F(4 * epsilon + 2 * on_device(mi.Float, probe.sag))
    lit = dr.select(probe.lit(p, receivers.active), F(1), F(0))
    near = receivers.active & (nearest.distance2 < rim * rim)
    if near:
        seg = tab.segment(nearest.segment)
        piece = tab.piece(tab.piece_at(nearest.segment))
        ln = line(fr, seg.X0, seg.e)
        bend = seg.X0 + dr.clip(ln.td, 0, seg.length) * seg.e + 3 * rim * piece.outward
        x = mi.Point3f(bend + constant(V, tab.centre))
        free = probe.lit(x, near) & probe.clear(p, x, near)
        lit = dr.clip(dr.select(free, F(1), F(0)) - _crossings(fr, tab, bend, V(receivers.n), near), 0, 1)
    return lit
