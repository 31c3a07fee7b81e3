"""Two parallel half planes, one behind the other, in the Fresnel approximation: the double Fresnel integral.

G. Millington, R. Hewitt, F. Immirzi, "Double knife-edge diffraction in field-strength predictions", Proc. IEE 109C,
419 (1962).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erfc

Complexes = NDArray[np.complex128]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)


def factor(first: float, second: float, apart: float, x: ArrayLike, distance: float, wavelength: float) -> Complexes:
    """M of a plane wave along the axis past two half planes that fill x > `first` and, `apart` behind it, x > `second`.

        M(x) = 1/√(iλz) ∫_{-∞}^{second} E(t) e^{iπ(t-x)²/λz} dt,   E(t): behind the first half plane alone

    `x` (...) of receivers, `distance` z behind the second half plane. The path of integration comes along the real
    line from `second` to min(second, x) and leaves it there by e^{-3πi/4}, on which the integrand dies away.
    """
    x = np.asarray(x, float)
    values = [_one(first, second, apart, float(at), distance, wavelength) for at in x.ravel()]
    return np.array(values, complex).reshape(x.shape)


def _one(first: float, second: float, apart: float, x: float, distance: float, wavelength: float) -> complex:
    curvature = np.pi / (wavelength * distance)

    def part(start: complex, end: complex) -> complex:
        """The integral along a straight piece, by panels over which the phase turns a few times at most."""
        phase = max(curvature, np.pi / (wavelength * apart)) * abs(end - start) ** 2
        panels = 4 + int(phase / 20)
        t = start + (end - start) / panels * (np.arange(panels)[:, None] + (NODES + 1) / 2)
        wave = _behind(t - first, apart, wavelength) * np.exp(1j * curvature * (t - x) ** 2)
        return complex((end - start) / (2 * panels) * (wave @ WEIGHTS).sum())

    turn = min(second, x)
    far = turn + np.exp(-0.75j * np.pi) * 6 / np.sqrt(curvature)  # e^{-36}
    return (part(far, turn) + part(turn, second)) / np.sqrt(1j * wavelength * distance)


def _behind(beyond: NDArray[Any], distance: float, wavelength: float) -> Complexes:
    """½ erfc(e^{-iπ/4} b √(π/λd)), b how far inside the half plane: `fresnel_edge.factor` for complex b as well."""
    return 0.5 * erfc(np.exp(-0.25j * np.pi) * np.sqrt(np.pi / (wavelength * distance)) * beyond)
