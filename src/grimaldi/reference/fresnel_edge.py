"""The straight edge of a half plane in the Fresnel approximation (Born & Wolf §8.7.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import fresnel


def parameter(
    offset: ArrayLike, distance: float, wavelength: float, source_distance: float = np.inf
) -> NDArray[np.float64]:
    """Fresnel's v = h √(2/λL), 1/L = 1/z1 + 1/z2, positive in the shadow.

    `offset` h (...): how far the ray from source to receiver runs inside the half plane, measured in its
    plane; `distance` z2, `source_distance` z1: of that plane from receiver and source.
    """
    curvature = 1 / distance + 1 / source_distance
    return np.asarray(offset, float) * np.sqrt(2 * curvature / wavelength)


def factor(v: ArrayLike) -> NDArray[np.complex128]:
    """M = (1-i)/2 ∫_v^∞ e^{iπt²/2} dt at Fresnel parameter v (...), complex128 of the same shape.

    |M|² is 1/4 on the shadow boundary v = 0, 1.37044 in the first maximum v = -1.21720.
    """
    sine, cosine = fresnel(np.asarray(v, float))
    return 0.5 * (1 - 1j) * ((0.5 - cosine) + 1j * (0.5 - sine))
