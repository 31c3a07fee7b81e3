"""Edge waves that creep round smooth bodies (THEORY 2, "How good a black screen is for a thick smooth body").

A ray that touches a smooth body goes on along its surface, shedding light on the way; over an angle γ it is damped by
exp(-const (kρ)^{1/3} γ), ρ the radius of curvature along it (Keller, IRE Trans. Antennas Propag. 4, 312 (1956); Franz,
Z. Naturforsch. 9a, 705 (1954)). The edge wave of a black screen that turns into the body's shadow is damped likewise.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.segment import Line, Wave, detour, growth, path

DAMPING = 0.75  # fitted to absorbing spheres


def damped(wave: Wave, frame: Frame, ln: Line, length: Any, radius: Any, k: Any) -> Wave:
    """A segment's wave times exp(-0.75 (kρ)^{1/3} γ) for ways into the body; radius ρ, 0 where the rim is sharp.

    γ is that across the plane of S and the line, taken where the segment's wave comes from: at its stationary point if
    both ends are a fringe away from it, or else in its middle, which is of second order in its length. What it changes
    along the segment counts as error.
    """
    height = _height(frame, ln)
    strength = dr.select(ln.kappa > 0, DAMPING * dr.cbrt(k * radius), 0)

    def damping(t: Any) -> Any:
        _, C, _, inv_s = detour(frame, ln, t, ln.eqq * (dr.square(t - ln.td) + ln.w * ln.w))
        return dr.exp(-strength * dr.atan2(height * inv_s, 2 * C - 1))

    st = path(frame, ln, k)
    t, zero = st.t, 0 * st.t
    ends = dr.minimum(growth(frame, st, -t, k), growth(frame, st, length - t, k))
    first, last = damping(zero), damping(length)
    middle = damping(dr.select((t > 0) & (t < length) & (ends > np.pi), t, 0.5 * length))
    spread = 0.25 * dr.abs(first - last)
    return Wave(
        middle * wave.real,
        middle * wave.imag,
        dr.fma(middle, wave.err_real, spread * wave.real),
        dr.fma(middle, wave.err_imag, spread * wave.imag),
        wave.rounding2,
    )


def _height(frame: Frame, ln: Line) -> Any:
    """P's distance from the plane through S and the line: s sin γ."""
    if frame.plane:
        return dr.abs(ln.kappa) * dr.rsqrt(ln.eqq)
    from_source = dr.squared_norm((frame.z1 + ln.h) * ln.eq - ln.ea * ln.q0) + ln.kappa * ln.kappa
    return dr.abs(ln.kappa) * (frame.z1 + frame.z2) * dr.rsqrt(from_source)
