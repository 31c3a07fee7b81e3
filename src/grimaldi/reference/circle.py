"""The axis of a circular hole (THEORY 5; Born & Wolf §8.8, Goodman §4.5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grimaldi.reference import arago


def kirchhoff(
    radius: float, distance: ArrayLike, wavelength: float, source_distance: float = np.inf
) -> NDArray[np.complex128]:
    """M = 1 - C e^{ikΔ}: for a plane wave U = e^{ikz} - C e^{ik√(z²+a²)}, C = (1 + z/√(z²+a²))/2.

    `distance` z2 (...) and `source_distance` z1: of the hole's plane from receiver and source.
    """
    return 1 - arago.kirchhoff(radius, distance, wavelength, source_distance)


def fresnel(
    radius: float, distance: ArrayLike, wavelength: float, source_distance: float = np.inf
) -> NDArray[np.complex128]:
    """M = 1 - e^{iπN}, N = a²(1/z1 + 1/z2)/λ, so that |M|² = 4 sin²(πN/2)."""
    number = radius**2 * (1 / np.asarray(distance, float) + 1 / source_distance) / wavelength
    return 1 - np.exp(1j * np.pi * number)
