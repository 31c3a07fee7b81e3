"""Sums of boundary waves over outlines, and on which side of them a ray runs (THEORY eq. 4-6).

The sum and n take the side of an edge from the same κ, so that M runs smoothly through the shadow's rim.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from grimaldi.diffraction.arrays import on_device
from grimaldi.diffraction.creeping import damped
from grimaldi.diffraction.frame import Frame, constant
from grimaldi.diffraction.grazing import FAINT, Near, grazed, other_than
from grimaldi.diffraction.model import Receivers
from grimaldi.diffraction.occlusion import Rays
from grimaldi.diffraction.segment import Line, Rule, growth, line, path, segment_wave
from grimaldi.diffraction.table import Piece, Segment, Table


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
    piece: Any


class Margins(NamedTuple):
    """Squared distances of the ray S→P, and of P itself, to the outline nearest to each."""

    ray2: Any
    receiver2: Any


def to_receiver(fr: Frame, seg: Segment, ln: Line) -> Any:
    """Squared distance of P to a segment."""
    h = ln.h - fr.z2
    t = dr.clip(ln.eqq * ln.td - h * ln.ea, 0, seg.length)
    return dr.squared_norm(ln.q0 + t * ln.eq) + dr.square(h + t * ln.ea)


def _basis(a: Any) -> tuple[Any, Any]:
    """Two unit vectors across a (Duff et al., JCGT 6(1))."""
    V = type(a)
    sign = dr.copysign(type(a.x)(1), a.z)
    c = -1 / (sign + a.z)
    b = a.x * a.y * c
    return V(1 + sign * a.x * a.x * c, sign * b, -sign * a.x), V(b, sign + a.y * a.y * c, -a.y)


def _turn(frame: Frame, seg: Segment, across: Any, kappa: Any) -> tuple[Any, Any]:
    """Whether a segment crosses the half-plane that `across` is a quarter turn ahead of, as ±1 or 0, and how far out.

    Summed over a closed loop this is (1/2π)∮dφ. The side of the ray comes from κ's sign bit, as in the boundary
    wave itself: on the edge, where κ is 0, both must take the same side.
    """
    c0 = dr.dot(seg.X0 - frame.foot, across)
    c1 = dr.dot(seg.X1 - frame.foot, across)
    one = type(c0)(1)
    ahead = dr.mulsign(one, c1 - c0)
    crosses = ((c0 > 0) != (c1 > 0)) & (ahead == dr.mulsign(one, kappa))
    return dr.select(crosses, ahead, 0), dr.abs(kappa) * seg.length / dr.abs(c1 - c0)


# ---------------------------------------------------------------- planar holes and masks


@dr.syntax
def planar_sum(fr: Frame, tab: Table, k: Any, rule: Rule, active: Any) -> tuple[Sum, Any, Margins]:
    """The sum over whole planar loops, nothing in between, and n = (1/2π)∮dφ as an exact count."""
    F = tab.types.Float
    real, imag, err_real, err_imag = F(0), F(0), F(0), F(0)
    ray2, receiver2, rounding2 = F(dr.inf), F(dr.inf), F(0)
    n, j = F(0), dr.uint32_array_t(F)(0)
    _, across = _basis(fr.a)
    while active & (j < tab.size):
        seg = tab.segment(j)
        ln = line(fr, seg.X0, seg.e)
        wave = segment_wave(fr, ln, seg.length, k, rule, active)
        n += _turn(fr, seg, across, ln.kappa)[0]
        real, imag = real + wave.real, imag + wave.imag
        err_real, err_imag = err_real + wave.err_real, err_imag + wave.err_imag
        rounding2 += wave.rounding2
        ray2 = dr.minimum(ray2, closest(fr, seg, ln))
        receiver2 = dr.minimum(receiver2, to_receiver(fr, seg, ln))
        j += 1
    return Sum(real, imag, err_real, err_imag, rounding2, F(0)), n, Margins(ray2, receiver2)


@dr.syntax
def planar_count(fr: Frame, tab: Table, active: Any) -> Any:
    """n of `planar_sum` alone."""
    F = tab.types.Float
    n, j = F(0), dr.uint32_array_t(F)(0)
    _, across = _basis(fr.a)
    while active & (j < tab.size):
        seg = tab.segment(j)
        n += _turn(fr, seg, across, line(fr, seg.X0, seg.e).kappa)[0]
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
    above = free | (dr.dot(n, d) < -1e-4 * length)
    behind = (piece.closed > 0.5) | (dr.dot(piece.lit, d) < -1e-6 * length)
    return above & behind


def _cut_off(fr: Frame, piece: Piece, e: Any, k: Any) -> Any:
    """|M| that the chain's wave, cut off somewhere on this piece, would at most leave.

    The end of a chain sends |M| = √D / (4π (D + w) √w), D = kΔs at the stationary point, w = k(Δ - Δs).
    """
    st = path(fr, line(fr, piece.middle, e), k)
    D = dr.maximum(st.A, 0.01)
    w = dr.maximum(growth(fr, st, dr.copysign(dr.maximum(dr.abs(st.t) - piece.reach, 0), -st.t), k), 0.1)
    return dr.sqrt(D) / (4 * np.pi * (D + w) * dr.sqrt(w))


def closest(fr: Frame, seg: Segment, ln: Line) -> Any:
    """Squared distance of the ray S→P to a segment, infinite outside of S..P."""
    t = dr.clip(ln.td, 0, seg.length)
    along = ln.h + t * ln.ea
    between = fr.z2 - along > 0
    if not fr.plane:
        between &= fr.z1 + along > 0
    return dr.select(between, ln.eqq * (dr.square(t - ln.td) + ln.w * ln.w), dr.inf)


@dr.syntax
def body_sum(
    fr: Frame,
    tab: Table,
    k: Any,
    rule: Rule,
    share: float,
    probe: Rays | None,
    beside: Near | None,
    smooth: bool,
    receivers: Receivers,
) -> tuple[Sum, Nearest, Margins]:
    """The sum over the outlines of bodies, piece by piece, each as far as it reaches the receiver.

    What would add less than `share` of M goes unasked; without a probe all does. Without silhouettes
    near by a piece reaches the receiver or does not. `smooth` rims are those with a radius.
    """
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    n = tab.types.Vector(receivers.n)
    p = mi.Point3f(receivers.p)
    if dr.hint(probe is not None, mode="scalar"):
        assert probe is not None
        p = p + probe.epsilon(p) * receivers.n  # off its own surface
    real, imag, err_real, err_imag = F(0), F(0), F(0), F(0)
    nearest2, nearest_segment, nearest_piece = F(dr.inf), U(0), U(0)
    receiver2, rounding2, unasked = F(dr.inf), F(0), F(0)
    i = U(0)
    while receivers.active & (i < tab.n_pieces):
        piece = tab.piece(i)
        acts = sounds(fr, piece, n)
        visible = dr.mask_t(F)(acts)
        past_real, past_imag = F(0), F(0)
        if dr.hint(probe is not None, mode="scalar"):
            assert probe is not None
            left = _cut_off(fr, piece, tab.segment(piece.first).e, k)
            tested = acts & (left > share)
            unasked += dr.select(acts & ~tested, left, 0)
            if tested:
                x = mi.Point3f(piece.middle + constant(tab.types.Vector, tab.centre))
                visible = acts & probe.reaches(x, piece, p, tested)
            if dr.hint(beside is not None, mode="scalar"):
                assert beside is not None
                body, close = other_than(beside, piece)
                close &= tested & (left > FAINT)
                if close:
                    past_real, past_imag = grazed(fr, beside.silhouettes, piece, body, visible, k, close)
            acts = visible | (past_real != 0) | (past_imag != 0)
        j = U(piece.first)
        while acts & (j < piece.end):
            seg = tab.segment(j)
            ln = line(fr, seg.X0, seg.e)
            wave = segment_wave(fr, ln, seg.length, k, rule, acts)
            if dr.hint(smooth, mode="scalar"):
                wave = damped(wave, fr, ln, seg.length, seg.radius, k)
            if dr.hint(beside is not None, mode="scalar"):
                wave = wave.times(
                    dr.select(visible, 1, 0) + dr.mulsign(past_real, ln.kappa), dr.mulsign(past_imag, ln.kappa)
                )
            real, imag = real + wave.real, imag + wave.imag
            err_real, err_imag = err_real + wave.err_real, err_imag + wave.err_imag
            rounding2 += wave.rounding2
            receiver2 = dr.minimum(receiver2, to_receiver(fr, seg, ln))
            d2 = closest(fr, seg, ln)
            closer = visible & (d2 < nearest2)
            nearest2 = dr.select(closer, d2, nearest2)
            nearest_segment = dr.select(closer, j, nearest_segment)
            nearest_piece = dr.select(closer, i, nearest_piece)
            j += 1
        i += 1
    nearest = Nearest(nearest2, nearest_segment, nearest_piece)
    return Sum(real, imag, err_real, err_imag, rounding2, unasked), nearest, Margins(nearest2, receiver2)


@dr.syntax
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
    while active & (i < tab.n_pieces):
        piece = tab.piece(i)
        acts = sounds(fr, piece, n)
        j = U(piece.first)
        while acts & (j < piece.end):
            seg = tab.segment(j)
            ln = line(fr, seg.X0, seg.e)
            turn, out = _turn(fr, seg, across, ln.kappa)
            z = ln.h + ln.ea * dr.clip(ln.td, 0, seg.length)
            # the bent way is a triangle over the ray, `height` high where it bends
            top = (fr.z2 - z) / (fr.z2 - along)
            if not fr.plane:
                top = dr.minimum(top, (fr.z1 + z) / (fr.z1 + along))
            count += dr.select(out < height * dr.minimum(top, 1), turn, 0)
            j += 1
        i += 1
    return count


@dr.syntax
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
        piece = tab.piece(nearest.piece)
        ln = line(fr, seg.X0, seg.e)
        bend = seg.X0 + dr.clip(ln.td, 0, seg.length) * seg.e + 3 * rim * piece.outward
        x = mi.Point3f(bend + constant(V, tab.centre))
        free = probe.lit(x, near) & probe.clear(p, x, near)
        lit = dr.clip(dr.select(free, F(1), F(0)) - _crossings(fr, tab, bend, V(receivers.n), near), 0, 1)
    return lit
