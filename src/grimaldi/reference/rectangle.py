"""A rectangular hole in the Fresnel approximation (Born & Wolf §8.7, Goodman §4.5.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grimaldi.reference import slit


def factor(
    width: float,
    height: float,
    x: ArrayLike,
    y: ArrayLike,
    distance: float,
    wavelength: float,
    source_distance: float = np.inf,
) -> NDArray[np.complex128]:
    """M of a hole |x| <= width/2, |y| <= height/2: two slits multiplied, each the difference of two edges.

    `x`, `y` (...): where the ray from source to receiver crosses the hole's plane, from its middle;
    `distance` z2, `source_distance` z1: of that plane from receiver and source. Leaves out phases of
    order k b⁴ (1/z1³ + 1/z2³)/8, b being the distance of the rim from the ray.
    """
    return slit.factor(width, x, distance, wavelength, source_distance) * slit.factor(
        height, y, distance, wavelength, source_distance
    )
