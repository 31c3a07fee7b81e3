"""Slits in the Fresnel approximation, and many of them far away (Born & Wolf §8.7.3 and §8.6.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grimaldi.reference import fresnel_edge


def factor(
    width: float, x: ArrayLike, distance: float, wavelength: float, source_distance: float = np.inf
) -> NDArray[np.complex128]:
    """M behind a slit |x| <= width/2: the difference of two edges.

    `x` (...): where the ray from source to receiver crosses the slit's plane, from its middle; `distance` z2,
    `source_distance` z1: of that plane from receiver and source.
    """
    x = np.asarray(x, float)
    sides = (fresnel_edge.parameter(side * width / 2 - x, distance, wavelength, source_distance) for side in (-1, 1))
    left, right = (fresnel_edge.factor(v) for v in sides)
    return left - right


def several(
    count: int,
    width: float,
    spacing: float,
    x: ArrayLike,
    distance: float,
    wavelength: float,
    source_distance: float = np.inf,
) -> NDArray[np.complex128]:
    """M behind `count` slits whose middles are `spacing` apart, the row's middle at x = 0: the sum of each."""
    x = np.asarray(x, float)
    middles = spacing * (np.arange(count) - (count - 1) / 2)
    return np.sum([factor(width, x - c, distance, wavelength, source_distance) for c in middles], axis=0)


def fraunhofer(count: int, width: float, spacing: float, sine: ArrayLike, wavelength: float) -> NDArray[np.float64]:
    """Intensity over that of the axis, far behind: (sin β/β)² (sin Nα/(N sin α))², α = π d sinθ/λ, β = π w sinθ/λ.

    `sine` (...): sinθ of the direction to the receiver for a plane wave along the axis.
    """
    cycles = np.asarray(sine, float) * spacing / wavelength
    near = np.pi * (cycles - np.round(cycles))  # α but for whole turns, which leave the square alone
    return (
        np.sinc(np.asarray(sine, float) * width / wavelength) ** 2
        * (np.sinc(count * near / np.pi) / np.sinc(near / np.pi)) ** 2
    )
