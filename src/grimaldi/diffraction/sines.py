"""Sine and cosine with the argument reduced to a turn first: Dr.Jit's own run away beyond 1e6 or so."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np
from numpy.polynomial import chebyshev

from grimaldi.outlines.model import Reals

SCALE = 4 * math.sqrt(2)  # of u, that its square lies between 0 and 2
DEGREE = {4: 4, 8: 9}  # of polynomials to the rounding of numbers of so many bytes


def sincos(x: Any) -> tuple[Any, Any]:
    """Sine and cosine of x [rad] in the precision of x."""
    return of_turns(x * (0.5 / math.pi))


def of_turns(turns: Any) -> tuple[Any, Any]:
    """The same of an angle in turns: by u, what it differs by from a quarter turn."""
    turns = turns - dr.round(turns)
    v = dr.fma(dr.abs(turns), SCALE, -0.25 * SCALE)
    t = dr.fma(v, v, -1)
    size = dr.itemsize_v(turns)
    return dr.mulsign(_polynomial(COSINE[size], t), turns), -v * _polynomial(SINE[size], t)


def rounded(turns: Any, Float: Any) -> tuple[Any, Any]:
    """The same as numbers of another precision, of an angle that is reduced in its own."""
    return of_turns(Float(turns - dr.round(turns)))


def _polynomial(coefficients: list[float], t: Any) -> Any:
    """The highest first, by Horner."""
    total = type(t)(coefficients[0])
    for c in coefficients[1:]:
        total = dr.fma(total, t, c)
    return total


def _in_squares(f: Callable[[Reals], Reals]) -> dict[int, list[float]]:
    """Polynomials in t = v² - 1 that are f(v) for v = `SCALE` u, |u| <= 1/4, as `DEGREE` says."""
    t = np.cos(np.pi * (np.arange(100) + 0.5) / 100)
    values = f(np.sqrt(t + 1))
    return {
        size: chebyshev.cheb2poly(chebyshev.chebfit(t, values, degree))[::-1].tolist()
        for size, degree in DEGREE.items()
    }


COSINE = _in_squares(lambda v: np.cos(2 * np.pi / SCALE * v))
SINE = _in_squares(lambda v: np.sin(2 * np.pi / SCALE * v) / v)
