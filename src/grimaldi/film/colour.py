"""From linear radiance to 8 bit sRGB, by one exposure factor that two pictures can share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def automatic_exposure(radiance: ArrayLike) -> float:
    """The factor that takes the 99th percentile of the lit values of `radiance` (any shape) to 0.9.

    Only values above zero count, so that a black surround changes nothing; 1 where all is black.
    """
    values = np.asarray(radiance, dtype=np.float64)
    lit = values[values > 0]
    return 0.9 / float(np.percentile(lit, 99)) if lit.size else 1.0


def encode_srgb(linear: ArrayLike) -> NDArray[np.float64]:
    """The sRGB transfer curve (IEC 61966-2-1) of linear values, clipped to 0..1."""
    x = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def decode_srgb(encoded: ArrayLike) -> NDArray[np.float64]:
    """The inverse of `encode_srgb`."""
    x = np.asarray(encoded, dtype=np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def to_bytes(encoded: ArrayLike) -> NDArray[np.uint8]:
    """Values in 0..1 as 8 bit, rounded to the nearest."""
    return np.rint(255 * np.asarray(encoded, dtype=np.float64)).astype(np.uint8)
