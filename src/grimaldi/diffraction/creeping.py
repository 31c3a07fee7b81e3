"""Edge waves that creep round smooth bodies (THEORY 2, "How good a black screen is for a thick smooth body").

A ray that touches a smooth body goes on along its surface, shedding light on the way; over an angle γ it is damped by
exp(-const (kρ)^{1/3} γ), ρ the radius of curvature along it (Keller, IRE Trans. Antennas Propag. 4, 312 (1956); Franz,
Z. Naturforsch. 9a, 705 (1954)). The edge wave of a black screen that turns into the body's shadow is damped likewise.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr

from grimaldi.diffraction.frame import Frame

DAMPING = 0.75  # fitted to absorbing spheres


class Creeping(NamedTuple):
    """The damping W = exp(-strength γ) along one segment's line."""

    strength: Any  # 0.75 (kρ)^{1/3} for ways into the body, else 0
    height: Any  # distance of P from the plane through S and the line: s sin γ

    def damping(self, C: Any, inv_s: Any) -> Any:
        """W where the obliquity is C = (1 + cos γ)/2, at 1/s from P."""
        return dr.exp(-self.strength * dr.atan2(self.height * inv_s, 2 * C - 1))

    def slope(self, C: Any, inv_s: Any, ds: Any, dcos: Any) -> Any:
        """(ln W)' from the slopes of s and cos γ along the line."""
        x, y = 2 * C - 1, self.height * inv_s
        return self.strength * y * (x * ds * inv_s + dcos) / (x * x + y * y)


def creeping(frame: Frame, kappa: Any, eqq: Any, distance: Any, radius: Any, k: float) -> Creeping:
    """Of a line with κ and |e - (e·a) a|² at `distance` from S (unused for a plane wave); radius ρ, 0 where sharp."""
    height = dr.abs(kappa)
    height *= dr.rsqrt(eqq) if frame.plane else (frame.z1 + frame.z2) / distance
    return Creeping(dr.select(kappa > 0, DAMPING * dr.cbrt(k * radius), 0), height)
