"""Poisson's spot, also called Arago's: the axis of an opaque disc (THEORY 5; Born & Wolf §8.9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def kirchhoff(
    radius: float, distance: ArrayLike, wavelength: float, source_distance: float = np.inf
) -> NDArray[np.complex128]:
    """M = C e^{ikΔ} of the disc's rim: eq. 5 with n = 1, exactly the Kirchhoff integral on the axis.

    `distance` z2 (...) and `source_distance` z1: of the disc's plane from receiver and source, both on
    its axis. For a plane wave C = (1 + z2/s)/2 and Δ = s - z2.
    """
    z2 = np.asarray(distance, float)
    s = np.hypot(z2, radius)
    cosine, detour = z2 / s, radius**2 / (s + z2)
    if np.isfinite(source_distance):
        z1, r = source_distance, np.hypot(source_distance, radius)
        cosine = (z1 * z2 - radius**2) / (r * s)
        detour = detour + radius**2 / (r + z1)
    phase = 2 * np.pi / wavelength * detour
    return np.asarray(0.5 * (1 + cosine) * np.exp(1j * phase), np.complex128)


def rayleigh_sommerfeld(radius: float, distance: ArrayLike) -> NDArray[np.float64]:
    """|M|² = z²/(z² + a²) behind a disc in a plane wave by the first Rayleigh-Sommerfeld integral."""
    squared = np.square(np.asarray(distance, float))
    return squared / (squared + radius**2)


def tangent_circle(radius: float, source_distance: float) -> tuple[float, float]:
    """The outline of a sphere: radius of the circle where rays touch it, and its offset towards the source.

    `source_distance`: of the sphere's centre.
    """
    if np.isinf(source_distance):
        return radius, 0.0
    offset = radius**2 / source_distance
    return float(np.sqrt(radius**2 - offset**2)), offset
