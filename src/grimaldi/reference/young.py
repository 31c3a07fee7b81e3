"""Young's two coherent sources of equal strength (Born & Wolf §7.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def fringe_spacing(wavelength: float, distance: float, separation: float) -> float:
    """λL/s: between bright fringes on a screen at L, for sources s apart beside its axis."""
    return wavelength * distance / separation


def intensity(
    x: ArrayLike, wavelength: float, distance: float, separation: float, phase: float = 0.0
) -> NDArray[np.float64]:
    """I/I_one = 4 cos²(π x s/λL + φ/2) at x (...) along the line of the sources, near the axis.

    `phase` φ [rad]: by which the source at -s/2 is ahead of the one at +s/2.
    """
    spacing = fringe_spacing(wavelength, distance, separation)
    return 4 * np.cos(np.pi * np.asarray(x, float) / spacing + phase / 2) ** 2
