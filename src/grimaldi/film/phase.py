"""Colours for the phase of a complex field."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

RED = (1.0, 0.0, 0.0)
BLUE = (0.0, 0.0, 1.0)


def two_colours(field: ArrayLike) -> NDArray[np.float64]:
    """sRGB colours in 0..1 (..., 3) of `field` (...): red for phases 0..π, blue for π..2π.

    The map of Johnston and Tarjan's report (figure 1 c). Black where the field is zero.
    """
    values = np.asarray(field)
    colours = np.where((_turns(values) < 0.5)[..., None], RED, BLUE)
    return np.where((values == 0)[..., None], 0.0, colours)


def cyclic(field: ArrayLike) -> NDArray[np.float64]:
    """sRGB colours in 0..1 (..., 3) of `field` (...), by colorcet's CET-C6, whose steps look even.

    Phase 0 is red; yellow, green, cyan, blue and magenta follow as the phase grows, and 2π meets 0
    without a step. Black where the field is zero. Source: P. Kovesi, arXiv:1509.03700.
    """
    values = np.asarray(field)
    table = _cet_c6()
    position = _turns(values) * len(table)
    low = np.floor(position).astype(np.int64)
    weight = (position - low)[..., None]
    colours = (1 - weight) * table[low % len(table)] + weight * table[(low + 1) % len(table)]
    return np.where((values == 0)[..., None], 0.0, colours)


def _turns(field: NDArray[np.generic]) -> NDArray[np.float64]:
    """The phase in turns, 0 <= turns < 1."""
    turns = np.angle(np.asarray(field, dtype=np.complex128)) / (2 * np.pi)
    # -1e-17 % 1 rounds to 1, which is the phase 0 again
    wrapped = turns % 1.0
    return np.where(wrapped == 1.0, 0.0, wrapped)


@cache
def _cet_c6() -> NDArray[np.float64]:
    import colorcet

    table = colorcet.palette["CET_C6"]
    return np.array([[int(entry[i : i + 2], 16) for i in (1, 3, 5)] for entry in table]) / 255
