"""The boundary wave of one straight outline segment: ∫ C e^{ikΔ} dφ (THEORY eq. 4-7), at a cost free of λ.

A segment X(t) = X0 + t e is cut at most three ways. Around its stationary point (Δ' = 0) and the foot of
the ray, Gauss-Legendre panels in v, with t - t_d = w sinh v, so that dφ = ±dv/cosh v however close the rim
is. Beyond a phase distance K from the stationary point, the ends' asymptotic series alone, whose third term
comes from the integrand's two known poles:

    ∫ f e^{ikΔ} dt = B(t1) - B(t0),   B = (g/k) e^{ikΔ} (-i + ρ + i ρ₂),   f = C κ/d²,   g = f/Δ'
    ρ = L/k,   L = (f'/f - Δ''/Δ')/Δ',   ρ₂ = ρ² + 2 (ρ + 1/kΔ)² + 1/(kΔ)²

ρ₂ is exact in the paraxial limit, where g ~ w^{-1/2} (Δs+w)^{-1} with w = Δ - Δs.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from grimaldi.diffraction.creeping import Creeping, creeping
from grimaldi.diffraction.frame import Frame


class Rule(NamedTuple):
    """How finely a segment is integrated for a tolerance: eq. numbers in the module's docstring.

    K [rad] is where the asymptotic series takes over; a panel has `nodes`, `weights` on 0..1 and spans at
    most `phase` radians of kΔ and `stretch` in v; `share` is the error that one end may add to M.
    """

    K: float
    phase: float
    stretch: float
    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    share: float

    @staticmethod
    def of(tolerance: float) -> Rule:
        share = 0.1 * tolerance
        K = max(10.0, 1.5 * (0.5 / share) ** 0.25)  # the series' next term is about 0.5 K⁻⁴; ends add up
        n, phase, stretch = 4, 3.0, 1.5
        if tolerance < 5e-4:
            n, phase, stretch = 8, 4.0, 1.5
        if tolerance < 1e-6:
            n, phase, stretch = 16, 8.0, 1.6
        x, w = np.polynomial.legendre.leggauss(n)
        return Rule(K, phase, stretch, tuple((0.5 * (x + 1)).tolist()), tuple((0.5 * w).tolist()), share)


class Line(NamedTuple):
    """A segment's line relative to a ray; q = q0 + t eq is the part across, d² = eqq ((t-td)² + w²)."""

    q0: Any
    h: Any  # along the ray, from the foot to X0
    ea: Any
    eqq: Any
    td: Any
    w: Any
    kappa: Any


def line(frame: Frame, X0: Any, e: Any) -> Line:
    """The line through X0 along e (unit), X0 relative to the outlines' centre."""
    x = X0 - frame.foot
    h = dr.dot(x, frame.a)
    q0 = x - h * frame.a
    ea = dr.dot(e, frame.a)
    eq = e - ea * frame.a
    kappa = dr.dot(frame.a, dr.cross(q0, eq))
    eqq = dr.maximum(dr.squared_norm(eq), 1e-20)
    td = -dr.dot(q0, eq) / eqq
    # on the rim itself w is 0: keep it above the rounding of t, far below what any tolerance sees
    w = dr.maximum(dr.abs(kappa) / eqq, 8 * dr.epsilon(kappa) * (dr.abs(td) + dr.norm(q0)) + 1e-30)
    return Line(q0, h, ea, eqq, td, w, kappa)


def detour(frame: Frame, ln: Line, t: Any, d2: Any) -> tuple[Any, Any, Any, Any]:
    """Δ and C at t without cancellation, with 1/r (0 for a plane wave) and 1/s."""
    z2 = frame.z2 - ln.h - t * ln.ea
    s = dr.sqrt(dr.fma(z2, z2, d2))
    delta = dr.select(z2 > 0, d2 / (s + dr.abs(z2)), s + dr.abs(z2))
    inv_s = dr.rcp(s)
    if frame.plane:
        return delta, 0.5 + 0.5 * z2 * inv_s, type(s)(0), inv_s
    z1 = frame.z1 + ln.h + t * ln.ea
    r = dr.sqrt(dr.fma(z1, z1, d2))
    delta += dr.select(z1 > 0, d2 / (r + dr.abs(z1)), r + dr.abs(z1))
    inv_r = dr.rcp(r)
    return delta, 0.5 + 0.5 * (z1 * z2 - d2) * inv_r * inv_s, inv_r, inv_s


def end_wave(frame: Frame, ln: Line, t: Any, k: float, creep: Creeping | None = None) -> tuple[Any, Any, Any, Any, Any]:
    """B(t) (real, imaginary), the series' next term (real, imaginary) and kΔ'."""
    u = t - ln.td
    b = ln.eqq * u  # q·eq
    d2 = ln.eqq * dr.fma(u, u, ln.w * ln.w)
    delta, C, inv_r, inv_s = detour(frame, ln, t, d2)
    ds = (b - (frame.z2 - ln.h - t * ln.ea) * ln.ea) * inv_s
    dd = (1 - ds * ds) * inv_s
    cos = 2 * C - 1
    if frame.plane:
        dr_ = ln.ea
        dcos = -(dr_ + cos * ds) * inv_s
    else:
        dr_ = ((frame.z1 + ln.h + t * ln.ea) * ln.ea + b) * inv_r
        dd += (1 - dr_ * dr_) * inv_r
        dcos = -(ds + cos * dr_) * inv_r - (dr_ + cos * ds) * inv_s
    slope = dr_ + ds
    slope = dr.select(dr.abs(slope) > 1e-30, slope, 1e-30)
    g = C * ln.kappa / (d2 * slope * k)
    rho = (0.5 * dcos / dr.maximum(C, 1e-12) - 2 * b / d2 - dd / slope) / (slope * k)
    pole = 1 / (k * delta)
    rho2 = rho * rho + 2 * dr.square(rho + pole) + pole * pole
    if creep is not None:  # f W: ρ grows by δ = (ln W)'/kΔ', ρ₂ by 2ρδ + δ² + δ'/kΔ', but for (ln W)''
        g *= creep.damping(C, inv_s)
        more = creep.slope(C, inv_s, ds, dcos) / (slope * k)
        rho2 += more * (2 * rho + more - dd / (slope * slope * k))
        rho += more
    sin, cos_ = sincos(k * delta)
    real, imag = g * rho, g * (rho2 - 1)
    last = 5 * g * rho * rho2  # |g₃/g₀| is 4 to 5 ρ ρ₂ between the two limits
    return (
        real * cos_ - imag * sin,
        real * sin + imag * cos_,
        last * cos_,
        last * sin,
        slope * k,
    )


class Stationary(NamedTuple):
    """The stationary point t_s of Δ along a line and 1/Δ'' there (r+s is convex: there is one)."""

    t: Any
    radius: Any
    from_source: Any  # the line's distance from S; 0 for a plane wave

    def reach(self, y: Any) -> Any:
        """How far from t_s Δ has grown by y at the latest."""
        return dr.sqrt(y * (y + 2 * self.radius))

    def growth(self, x: Any) -> Any:
        """Inverse of `reach`."""
        return x * x / (self.radius + dr.sqrt(dr.fma(self.radius, self.radius, x * x)))


def stationary(frame: Frame, ln: Line, eq_q0: tuple[Any, Any]) -> Stationary:
    """By unfolding S and P into one plane through the line, at distances ρ1 and ρ2 from it."""
    eq, q0 = eq_q0
    z2 = frame.z2 - ln.h
    b0 = -ln.eqq * ln.td
    k2 = ln.kappa * ln.kappa
    rho2 = dr.sqrt(dr.squared_norm(z2 * eq + ln.ea * q0) + k2)
    t2 = z2 * ln.ea - b0
    if frame.plane:
        sin = dr.sqrt(ln.eqq)
        return Stationary(t2 - ln.ea * rho2 / sin, rho2 / (sin * ln.eqq), 0 * rho2)
    z1 = frame.z1 + ln.h
    rho1 = dr.sqrt(dr.squared_norm(z1 * eq - ln.ea * q0) + k2)
    t1 = -(z1 * ln.ea + b0)
    total = rho1 + rho2
    path = dr.sqrt(total * total + dr.square(t1 - t2))
    sin2 = dr.square(total / path)
    share = rho2 / total
    # r and s there are path·ρ1/total and path·ρ2/total
    return Stationary(t2 + (t1 - t2) * share, path * share * (1 - share) / sin2, rho1)


def sincos(x: Any) -> tuple[Any, Any]:
    """Sine and cosine with the argument reduced first: Dr.Jit's own run away beyond 1e6 or so."""
    return dr.sincos(x - 2 * np.pi * dr.round(x * (0.5 / np.pi)))


def _asinh(x: Any) -> Any:
    m = dr.abs(x)
    root = dr.select(m < 1e9, dr.sqrt(dr.fma(m, m, 1)), m)  # squares run over in Float32
    return dr.copysign(dr.log(m + root), x)


@dr.syntax
def _direct(
    frame: Frame, ln: Line, st: Stationary, lo: Any, hi: Any, k: float, rule: Rule, creep: Creeping | None
) -> Any:
    """∫ C e^{ikΔ} dφ over lo..hi by panels, marched so that each spans little phase and little v."""
    Float = type(lo)
    Bool = dr.mask_t(Float)
    real, imag, t = Float(0), Float(0), Float(lo)
    active = Bool(lo < hi)
    while active:
        x = t - st.t
        phase = dr.copysign(st.growth(x), x) + rule.phase / k
        by_phase = st.t + dr.copysign(st.reach(dr.abs(phase)), phase)
        v0 = _asinh((t - ln.td) / ln.w)
        ev = dr.exp(v0 + rule.stretch)
        by_stretch = ln.td + 0.5 * ln.w * (ev - dr.rcp(ev))
        end = dr.minimum(hi, dr.minimum(by_phase, by_stretch))
        end = dr.select(end > t, end, hi)
        dv = _asinh((end - ln.td) / ln.w) - v0
        for x_j, w_j in zip(rule.nodes, rule.weights, strict=True):
            ev = dr.exp(dr.fma(dv, x_j, v0))
            inv = dr.rcp(ev)
            cosh = 0.5 * (ev + inv)
            delta, C, _, inv_s = detour(frame, ln, ln.td + 0.5 * ln.w * (ev - inv), ln.eqq * dr.square(ln.w * cosh))
            sin, cos = sincos(k * delta)
            amplitude = w_j * dv * C / cosh
            if dr.hint(creep is not None, mode="scalar"):
                assert creep is not None
                amplitude *= creep.damping(C, inv_s)
            real = dr.fma(amplitude, cos, real)
            imag = dr.fma(amplitude, sin, imag)
        t = end
        active = t < hi
    return dr.mulsign(real, ln.kappa), dr.mulsign(imag, ln.kappa)


@dr.syntax
def segment_wave(
    frame: Frame, X0: Any, e: Any, length: Any, k: float, rule: Rule, active: Any, radius: Any = None
) -> tuple[Any, Any, Any, Any, Any]:
    """∫ C e^{ikΔ} dφ over X0 + t e, 0 <= t <= length; damped as at a smooth rim where its radius ρ is given.

    X0 (3), e (3) unit, length, radius: arrays of one precision, X0 relative to the outlines' centre; k: wavenumber.
    Returns its real and imaginary part, the same of the error estimate, and κ = a·(q0×e).
    """
    Float = type(length)
    ln = line(frame, X0, e)
    st = stationary(frame, ln, (e - ln.ea * frame.a, ln.q0))
    creep = None
    if dr.hint(radius is not None, mode="scalar"):
        creep = creeping(frame, ln.kappa, ln.eqq, st.from_source, radius, k)
    half = st.reach(Float(rule.K / k))
    # between the stationary point and the foot neither series nor its poles are far: keep both inside
    lo = dr.clip(dr.minimum(st.t, ln.td) - half, 0, length)
    hi = dr.clip(dr.maximum(st.t, ln.td) + half, 0, length)
    # outside, one series serves the whole segment
    left, right = lo > 0, hi < length
    t0 = dr.select(left, Float(0), hi)
    t1 = dr.select(right, length, lo)
    r0, i0, er0, ei0, _ = end_wave(frame, ln, t0, k, creep)
    r1, i1, er1, ei1, _ = end_wave(frame, ln, t1, k, creep)
    series = left | right
    real = dr.select(series, r1 - r0, 0)
    imag = dr.select(series, i1 - i0, 0)
    err_r = dr.select(series, er1 - er0, 0)
    err_i = dr.select(series, ei1 - ei0, 0)
    if active & (hi > lo):
        dre, dim = _direct(frame, ln, st, lo, hi, k, rule, creep)
        real = real + dre
        imag = imag + dim
        # a segment that sticks out on both sides: take the series' jump over the middle back out
        if left & right:
            rl, il, erl, eil, _ = end_wave(frame, ln, lo, k, creep)
            rh, ih, erh, eih, _ = end_wave(frame, ln, hi, k, creep)
            real = real - (rh - rl)
            imag = imag - (ih - il)
            err_r = err_r - (erh - erl)
            err_i = err_i - (eih - eil)
    return real, imag, err_r, err_i, ln.kappa
