"""The boundary wave of one straight outline segment, ∫ C e^{ikΔ} dφ (THEORY eq. 7), at a cost free of λ.

Along the segment's line the path length σ = r + s grows on both sides of a stationary point, where it is σs. By
Y = k(σ - σs) each side is an integral without any reference to the line (THEORY eq. 9):

    sgn κ e^{iA} ∫ √A F(Y) e^{iY} dY / (2 √Y (Y + A)),      A = k(σs - R),
    F = sin(ψ/2) · 2R/(R + σs + Y/k) · √( kb/(kb + Y) · (σs + R)/(2σs + Y/k) · (σs + σm)/(σs + σm + Y/k) )

ψ is the angle between the half planes from the line to S and to P, σm the path that the same S and P would have on
one side of the line, b = σs - σm >= A/k. All singularities lie at Y <= 0. So Y = A sinh² v makes the integrand analytic
for |Im v| < π/2 whatever the geometry, on the rim and beside S and P too: Gauss-Legendre panels of one width serve
there. Beyond Y = K the path turns off to Y + iτ, where Gauss-Laguerre with few nodes serves all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.sines import sincos
from grimaldi.syntax import syntax


class Corners(NamedTuple):
    """Which segments need no more than their corners (`corners.between`).

    Short ones, along which kΔ bends by less than `bend` and whose length² is below `near2` of the distance² of the
    ray; and far ones, with more than `far` to the next stationary point, in units of kΔ.
    """

    bend: float
    near2: float
    far: float

    @staticmethod
    def of(tolerance: float) -> Corners:
        """What leaves a segment within a tenth of its share (benchmarks/segment_rules.py)."""
        root = tolerance**0.5
        return Corners(2.5 * root, 0.36 * root, 2 / root)


class Rule(NamedTuple):
    """How finely a segment is integrated for a tolerance.

    Up to Y = K by panels of width `stretch` in v with `nodes`, `weights` on 0..1, up to v = `cut`, beyond which nothing
    is left; beyond K by `tail_nodes`, `tail_weights` on 0..∞, to the relative error `tail_error` at K or less. `share`
    is the error that panels may add to M. `corners` is None where no segment is left to its corners. `damped`: whether
    what turns into a smooth body's shadow creeps round it (`creeping`), which whole segments do alone.
    """

    K: float
    stretch: float
    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    tail_nodes: tuple[float, ...]
    tail_weights: tuple[float, ...]
    tail_error: float
    cut: float
    share: float
    corners: Corners | None
    damped: bool = False

    @staticmethod
    def of(tolerance: float) -> Rule:
        """The cheapest of the measured rules whose errors are within a tenth of the tolerance."""
        K, n, stretch, tails, error = next(rule for least, *rule in RULES if tolerance >= least)
        x, w = np.polynomial.legendre.leggauss(int(n))
        tail_x, tail_w = np.polynomial.laguerre.laggauss(int(tails))
        share = 0.1 * tolerance
        return Rule(
            K,
            stretch,
            tuple((0.5 * (x + 1)).tolist()),
            tuple((0.5 * w).tolist()),
            tuple(tail_x.tolist()),
            tuple(tail_w.tolist()),
            error,
            float(np.log(100 / tolerance)),
            share,
            Corners.of(tolerance) if tolerance >= 5e-7 else None,
        )


# Least tolerance, K, nodes a panel, its width, nodes of a tail, and the median of a tail's error relative to it at K
# over random geometries; the largest errors (benchmarks/segment_rules.py) are below a tenth of the tolerance.
RULES = (
    (5e-2, 2.0, 3, 2.5, 2, 1.2e-1),
    (5e-3, 3.0, 4, 1.2, 3, 2e-2),
    (5e-4, 4.0, 5, 1.2, 4, 2e-3),
    (5e-5, 5.0, 8, 1.4, 5, 1e-4),
    (5e-7, 6.0, 10, 1.0, 8, 1e-6),
    (5e-9, 8.0, 14, 1.0, 10, 1e-8),
    (5e-11, 8.0, 16, 1.0, 14, 9e-11),
    (0.0, 12.0, 20, 1.0, 14, 4e-13),
)


class Line(NamedTuple):
    """A segment's line relative to a ray; q = q0 + t eq is the part across, d² = eqq ((t-td)² + w²)."""

    q0: Any
    h: Any  # along the ray, from the foot to X0
    ea: Any
    eq: Any  # e - (e·a) a
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
    return Line(q0, h, ea, eq, eqq, td, w, kappa)


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


class Path(NamedTuple):
    """How the path length grows along a line on both sides of its stationary point, in units of 1/k.

    A and B are kΔ and k(σ - σm) there; u1, u2, u3 are 1/(R + σs), 1/2σs, 1/(σs + σm), 0 for a plane wave; `front` is
    F at Y = 0.
    """

    t: Any  # the stationary point
    r0: Any  # r and s there, and the line's share of the way: cosine and sine of its angle with the unfolded path
    s0: Any
    cos: Any
    sin: Any
    A: Any
    B: Any
    u1: Any
    u2: Any
    u3: Any
    front: Any


def path(frame: Frame, ln: Line, k: Any) -> Path:
    """By unfolding S and P into one plane through the line, at distances ρ1 and ρ2 from it."""
    Float = type(ln.w)
    tiny = 1e-30
    z2 = frame.z2 - ln.h
    b0 = -ln.eqq * ln.td
    k2 = ln.kappa * ln.kappa
    c2 = ln.ea * ln.ea * dr.squared_norm(ln.q0) + k2
    m2 = -z2 * ln.eq - ln.ea * ln.q0
    rho2 = dr.maximum(dr.sqrt(dr.squared_norm(m2) + k2), tiny)
    t2 = z2 * ln.ea - b0
    if frame.plane:
        sine = dr.sqrt(ln.eqq)
        cos_psi = dr.dot(ln.eq, m2) / (sine * rho2)
        sin_psi = dr.abs(ln.kappa) / (sine * rho2)
        s0 = rho2 / sine
        b = 2 * rho2 * sine
        cos2, sin_half = _half(cos_psi, sin_psi)
        zero = Float(0)
        # t2 - (e·a) s0, where z2 is large, without that difference
        lever = -(2 * z2 * ln.ea * b0 + c2) / (ln.eqq * (z2 + s0))
        t = dr.select(z2 > 0, ln.ea * lever - b0, t2 - ln.ea * s0)
        return Path(t, zero, s0, ln.ea, sine, k * b * cos2 + tiny, k * b, zero, zero, zero, sin_half)
    z1 = frame.z1 + ln.h
    R = frame.z1 + frame.z2
    m1 = z1 * ln.eq - ln.ea * ln.q0
    rho1 = dr.maximum(dr.sqrt(dr.squared_norm(m1) + k2), tiny)
    t1 = -(z1 * ln.ea + b0)
    total = rho1 + rho2
    way = t2 - t1
    straight = dr.sqrt(dr.fma(total, total, way * way))
    folded = dr.sqrt(dr.square(rho1 - rho2) + way * way)
    cos2, sin_half = _half((k2 + dr.dot(m1, m2)) / (rho1 * rho2), dr.abs(ln.kappa) * R / (rho1 * rho2))
    b = 4 * (rho1 / (straight + folded)) * rho2
    a = b * cos2 * (straight + folded) / (straight + R)
    # likewise (t2 ρ1 + t1 ρ2)/total
    lever = (c2 * (z2 - z1) - 2 * z1 * z2 * ln.ea * b0) / (total * (z2 * rho1 + z1 * rho2))
    outside = dr.select(rho1 < rho2, t1 + way * (rho1 / total), t2 - way * (rho2 / total))
    t = dr.select((z1 > 0) & (z2 > 0), ln.ea * R * lever - b0, outside)
    return Path(
        t,
        rho1 * straight / total,
        rho2 * straight / total,
        way / straight,
        total / straight,
        k * a + tiny,
        k * b + tiny,
        dr.rcp(k * (R + straight)),
        dr.rcp(2 * k * straight),
        dr.rcp(k * (straight + folded)),
        sin_half * 2 * R / (R + straight) * dr.sqrt((straight + R) / (2 * straight)),
    )


def _half(cos_psi: Any, sin_psi: Any) -> tuple[Any, Any]:
    """cos²(ψ/2) and sin(ψ/2), each from what does not cancel: ψ is π on the rim."""
    far = cos_psi < 0
    large = 0.5 * (1 + dr.abs(cos_psi))
    small = sin_psi * sin_psi / (4 * large)
    return dr.select(far, small, large), dr.sqrt(dr.select(far, large, small))


def growth(frame: Frame, st: Path, x: Any, k: Any) -> Any:
    """Y = k(σ - σs) at the distance x along the line from the stationary point: a detour, without cancellation."""
    d2 = dr.square(x * st.sin)
    along = x * st.cos
    result = _excess(st.s0 - along, d2)
    if not frame.plane:
        result += _excess(st.r0 + along, d2)
    return k * result


def _excess(z: Any, d2: Any) -> Any:
    """√(z² + d²) - z."""
    root = dr.sqrt(dr.fma(z, z, d2))
    return dr.select(z > 0, d2 / (root + dr.abs(z)), root + dr.abs(z))


def _asinh(x: Any) -> Any:
    m = dr.abs(x)
    root = dr.select(m < 1e9, dr.sqrt(dr.fma(m, m, 1)), m)  # squares run over in Float32
    return dr.copysign(dr.log(m + root), x)


@syntax
def _panels(st: Path, first: Any, middle: Any, last: Any, rule: Rule) -> Any:
    """∫ F e^{iY} dv / cosh v over first..last in v, twice over what lies before `middle`, over F(0)."""
    Float = type(first)
    real, imag, v = Float(0), Float(0), Float(first)
    inv_B = dr.rcp(st.B)
    active = v < last
    while active:
        twice = v < middle
        end = dr.minimum(v + rule.stretch, dr.select(twice, middle, last))
        width = end - v
        weight = dr.select(twice, 2 * width, width)
        for x_j, w_j in zip(rule.nodes, rule.weights, strict=True):
            ev = dr.exp(dr.fma(width, x_j, v))
            inv = dr.rcp(ev)
            Y = st.A * dr.square(0.5 * (ev - inv))
            near = dr.fma(Y, inv_B, 1) * dr.fma(Y, st.u2, 1) * dr.fma(Y, st.u3, 1)
            amplitude = (w_j * weight) * dr.rsqrt(near) * dr.rcp(0.5 * (ev + inv) * dr.fma(Y, st.u1, 1))
            sin, cos = dr.sincos(Y)
            real = dr.fma(amplitude, cos, real)
            imag = dr.fma(amplitude, sin, imag)
        v = end
        active = v < last
    return real, imag


def _root(a: Any, b: Any, tau: float) -> tuple[Any, Any]:
    """√((1 + iaτ)(1 + ibτ)) for a, b >= 0."""
    re, im = 1 - a * b * (tau * tau), (a + b) * tau
    large = dr.sqrt(0.5 * (dr.sqrt(dr.fma(re, re, im * im)) + dr.abs(re)))
    small = 0.5 * im / large
    return dr.select(re > 0, large, small), dr.select(re > 0, small, large)


def _tail(frame: Frame, st: Path, Y: Any, rule: Rule) -> tuple[Any, Any]:
    """What lies beyond Y on one side, over F(0), without the phase e^{iA}."""
    a, b, c = dr.rcp(Y), dr.rcp(Y + st.B), dr.rcp(Y + st.A)
    real, imag = 0 * Y, 0 * Y
    q1, q2, q3 = (u * dr.rcp(dr.fma(u, Y, 1)) for u in (st.u1, st.u2, st.u3))
    for tau, w in zip(rule.tail_nodes, rule.tail_weights, strict=True):
        x, y = _root(a, b, tau)
        x, y = x - y * (c * tau), dr.fma(x, c * tau, y)
        if not frame.plane:
            u, v = _root(q2, q3, tau)
            x, y = x * u - y * v, x * v + y * u
            x, y = x - y * (q1 * tau), dr.fma(x, q1 * tau, y)
        inv = w * dr.rcp(dr.fma(x, x, y * y))
        real = dr.fma(x, inv, real)
        imag = dr.fma(y, inv, imag)
    scale = 0.5 * c * dr.sqrt(st.A * a * st.B * b)
    scale *= dr.rcp(dr.fma(st.u1, Y, 1)) * dr.rsqrt(dr.fma(st.u2, Y, 1) * dr.fma(st.u3, Y, 1))
    # i (real - i imag) e^{iY}
    sin, cos = sincos(Y)
    return scale * (imag * cos - real * sin), scale * (real * cos + imag * sin)


def _tail_error(Y: Any, rule: Rule) -> Any:
    """What the rule leaves of a tail from Y on, relative to it."""
    return rule.tail_error * dr.square(dr.square(rule.K / Y))


def _rounded(st: Path, Y: Any, re: Any, im: Any) -> Any:
    """The square of what the rounding of its phase does to a tail (re, im): of no two ends the same."""
    return (re * re + im * im) * dr.square(4 * dr.epsilon(Y) * (Y + st.A))


class Wave(NamedTuple):
    """A segment's wave, real and imaginary part, the same of its error, and the square of its ends' rounding."""

    real: Any
    imag: Any
    err_real: Any
    err_imag: Any
    rounding2: Any

    def times(self, real: Any, imag: Any) -> Wave:
        """By a complex factor."""
        return Wave(
            real * self.real - imag * self.imag,
            real * self.imag + imag * self.real,
            real * self.err_real - imag * self.err_imag,
            real * self.err_imag + imag * self.err_real,
            self.rounding2,
        )


@syntax
def segment_wave(frame: Frame, ln: Line, length: Any, k: Any, rule: Rule, active: Any) -> Wave:
    """∫ C e^{ikΔ} dφ over X0 + t e, 0 <= t <= length, and its error; k: wavenumber; all of one precision."""
    Float = type(length)
    st = path(frame, ln, k)
    x0, x1 = -st.t, length - st.t
    Y0, Y1 = growth(frame, st, x0, k), growth(frame, st, x1, k)
    both = (x0 < 0) & (x1 > 0)
    near, far = dr.minimum(Y0, Y1), dr.maximum(Y0, Y1)
    K = Float(rule.K)
    real, imag, err_r, err_i, rounding2 = Float(0), Float(0), Float(0), Float(0), Float(0)
    if active & (far > K):
        # out of the far end
        re, im = _tail(frame, st, far, rule)
        real, imag = real - re, imag - im
        rounding2 += _rounded(st, far, re, im)
        left = _tail_error(far, rule)
        err_r, err_i = err_r - left * re, err_i - left * im
    if active & (near > K):
        re, im = _tail(frame, st, near, rule)
        flip = dr.select(both, Float(-1), Float(1))
        real, imag = dr.fma(flip, re, real), dr.fma(flip, im, imag)
        rounding2 += _rounded(st, near, re, im)
        left = flip * _tail_error(near, rule)
        err_r, err_i = dr.fma(left, re, err_r), dr.fma(left, im, err_i)
    inside = both | (near <= K)
    if active & inside:
        first = dr.select(both, Float(0), _reach(st, near, rule))
        middle = dr.select(both, _reach(st, dr.minimum(near, K), rule), first)
        last = _reach(st, dr.minimum(far, K), rule)
        re, im = _panels(st, first, middle, last, rule)
        real, imag = real + re, imag + im
        if far > K:
            # both sides, or one, go on beyond K
            re, im = _tail(frame, st, K, rule)
            count = dr.select(both & (near > K), Float(2), Float(1))
            real, imag = dr.fma(count, re, real), dr.fma(count, im, imag)
            err_r, err_i = dr.fma(count * rule.tail_error, re, err_r), dr.fma(count * rule.tail_error, im, err_i)
    sin, cos = sincos(st.A)
    scale = dr.mulsign(st.front, ln.kappa)
    wave = Wave(real, imag, err_r, err_i, dr.square(st.front) * rounding2)
    return wave.times(scale * cos, scale * sin)


def _reach(st: Path, Y: Any, rule: Rule) -> Any:
    """v where A sinh² v is Y, at most `rule.cut`."""
    return dr.minimum(_asinh(dr.sqrt(Y / st.A)), rule.cut)
