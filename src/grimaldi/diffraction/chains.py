"""What neighbouring segments of an outline send together, and where the ray S→P passes them (THEORY eq. 4-7).

A corner is looked at once, for both segments that meet there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr

from grimaldi.diffraction.corners import Corner, between, by_halves, corner
from grimaldi.diffraction.creeping import damped
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.segment import Corners, Line, Rule, Wave, line, segment_wave
from grimaldi.diffraction.table import Segment, Table
from grimaldi.syntax import syntax

NEVER = Corners(0.0, 0.0, float("inf"))  # for traces where corners are not asked


class Chain(NamedTuple):
    """What a few neighbouring segments send, and where the ray S→P passes them, n as in `planar_count`."""

    wave: Wave
    distance2: Any
    segment: Any
    receiver2: Any
    n: Any


class Passed(NamedTuple):
    """What a chain's wave is multiplied by on its way X→P: whether it reaches P, and eq. 11's factor, by sgn κ."""

    visible: Any
    real: Any
    imag: Any


def exact(fr: Frame, tab: Table, k: Any = None) -> tuple[Frame, Table, Any]:
    """A ray, the outlines and k in the precision that phases are told in."""
    return (fr, tab, k) if tab.exact is None else (fr.exact, tab.exact.table, tab.exact.k)


@syntax
def chain_wave(
    fr: Frame, tab: Table, first: Any, end: Any, k: Any, rule: Rule, active: Any, passed: Passed | None = None
) -> Chain:
    """Σ ∫ C e^{ikΔ} dφ over the segments first..end, neighbours of one another; each corner is looked at once."""
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    by_corners = rule.corners is not None
    forms = rule.corners or NEVER
    real, imag, err_real, err_imag, rounding2 = F(0), F(0), F(0), F(0), F(0)
    distance2, segment, receiver2, n = F(dr.inf), U(first), F(dr.inf), F(0)
    _, across = basis(fr.a)
    j = U(first)
    last = tuple(_corner(fr, tab, j, 0, k))  # a plain tuple: what Dr.Jit can carry from turn to turn
    while active & (j < end):
        a, b = Corner(*last), _corner(fr, tab, j, 1, k)
        ends = between(fr.a, a, b, k, forms)
        wave = ends.real, ends.imag, F(0), F(0), F(0)
        d2 = dr.minimum(a.on_ray2, b.on_ray2)
        p2 = dr.minimum(a.to_p2, b.to_p2)
        turn = F(ends.turn)
        whole = active & ~ends.serves
        if dr.hint(not by_corners, mode="scalar"):
            whole = dr.mask_t(F)(active)
        elif dr.hint(tab.exact is None, mode="scalar"):
            halved = dr.mask_t(F)(whole)
            if halved:
                re, im, serves = by_halves(fr, a, b, k, forms)
                whole &= ~serves
                wave = re, im, F(0), F(0), F(0)
        if whole:
            full, d2, p2, turn = _whole(fr, tab, j, k, rule, whole)
            wave = tuple(full)
        n += crossing(dr.dot(a.q, across), dr.dot(b.q, across), turn)
        if dr.hint(passed is not None, mode="scalar"):
            assert passed is not None
            wave = Wave(*wave).times(
                dr.select(passed.visible, 1, 0) + dr.mulsign(passed.real, turn), dr.mulsign(passed.imag, turn)
            )
        real, imag, err_real = real + wave[0], imag + wave[1], err_real + wave[2]
        err_imag, rounding2 = err_imag + wave[3], rounding2 + wave[4]
        segment = dr.select(d2 < distance2, j, segment)
        distance2 = dr.minimum(distance2, d2)
        receiver2 = dr.minimum(receiver2, p2)
        last = tuple(b)
        j += 1
    return Chain(Wave(real, imag, err_real, err_imag, rounding2), distance2, segment, receiver2, n)


def _corner(fr: Frame, tab: Table, j: Any, end: int, k: Any) -> Corner:
    """Where a segment begins (0) or ends (1)."""
    finer, there, k = exact(fr, tab, k)
    return corner(finer, there.corner(j, end), k, tab.types if tab.exact else None)


def _whole(fr: Frame, tab: Table, j: Any, k: Any, rule: Rule, active: Any) -> tuple[Wave, Any, Any, Any]:
    """A segment's wave by the whole integral, the squared distances of the ray and of P to it, and κ."""
    F = tab.types.Float
    fr, tab, k = exact(fr, tab, k)
    seg = tab.segment(j)
    ln = line(fr, seg.X0, seg.e)
    wave = segment_wave(fr, ln, seg.length, k, rule, active)
    if rule.damped:
        wave = damped(wave, fr, ln, seg.length, seg.radius, k)
    return Wave(*map(F, wave)), F(closest(fr, seg, ln)), F(to_receiver(fr, seg, ln)), F(ln.kappa)


def closest(fr: Frame, seg: Segment, ln: Line) -> Any:
    """Squared distance of the ray S→P to a segment, infinite outside of S..P."""
    t = dr.clip(ln.td, 0, seg.length)
    along = ln.h + t * ln.ea
    between = fr.z2 - along > 0
    if not fr.plane:
        between &= fr.z1 + along > 0
    return dr.select(between, ln.eqq * (dr.square(t - ln.td) + ln.w * ln.w), dr.inf)


def to_receiver(fr: Frame, seg: Segment, ln: Line) -> Any:
    """Squared distance of P to a segment."""
    h = ln.h - fr.z2
    t = dr.clip(ln.eqq * ln.td - h * ln.ea, 0, seg.length)
    return dr.squared_norm(ln.q0 + t * ln.eq) + dr.square(h + t * ln.ea)


def basis(a: Any) -> tuple[Any, Any]:
    """Two unit vectors across a (Duff et al., JCGT 6(1))."""
    V = type(a)
    sign = dr.copysign(type(a.x)(1), a.z)
    c = -1 / (sign + a.z)
    b = a.x * a.y * c
    return V(1 + sign * a.x * a.x * c, sign * b, -sign * a.x), V(b, sign + a.y * a.y * c, -a.y)


def crossing(c0: Any, c1: Any, kappa: Any) -> Any:
    """Whether a segment crosses the half-plane from which its corners are c0 and c1 ahead, as ±1 or 0.

    Summed over a closed loop this is (1/2π)∮dφ. The side of the ray comes from κ's sign bit, as in the boundary
    wave itself: on the edge, where κ is 0, both must take the same side.
    """
    one = type(c0)(1)
    ahead = dr.mulsign(one, c1 - c0)
    crosses = ((c0 > 0) != (c1 > 0)) & (ahead == dr.mulsign(one, kappa))
    return dr.select(crosses, ahead, 0)


def ahead(frame: Frame, seg: Segment, across: Any) -> tuple[Any, Any]:
    """How far a segment's corners are ahead of the half-plane that `across` is a quarter turn ahead of."""
    return dr.dot(seg.X0 - frame.foot, across), dr.dot(seg.X1 - frame.foot, across)
