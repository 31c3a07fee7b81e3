"""The far field of a circular hole: Airy's pattern (Born & Wolf §8.5.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j0, j1


def amplitude(w: ArrayLike) -> NDArray[np.float64]:
    """2 J1(w)/w at w = k a sinθ (...); 1 on the axis, first zero at w = 3.83171, or sinθ = 1.21967 λ/2a."""
    w = np.asarray(w, float)
    safe = np.where(w == 0, 1.0, w)
    return np.where(w == 0, 1.0, 2 * j1(safe) / safe)


def factor(radius: float, offset: ArrayLike, distance: float, wavelength: float) -> NDArray[np.complex128]:
    """M of a plane wave far behind the hole: -i (1 + cosθ)/2 (k a²/2s) e^{ik(s-z)} 2 J1(w)/w.

    `offset` ρ (...) from the axis and `distance` z of receivers, s = √(ρ² + z²), sinθ = ρ/s; (1 + cosθ)/2 is
    Kirchhoff's obliquity. Leaves out the next power of Fresnel's number, a relative k a² cos²θ/4s.
    """
    rho, k = np.asarray(offset, float), 2 * np.pi / wavelength
    s = np.hypot(rho, distance)
    detour = rho**2 / (s + distance)
    strength = 0.25 * (1 + distance / s) * k * radius**2 / s
    wave = -1j * strength * np.exp(1j * k * detour) * amplitude(k * radius * rho / s)
    return np.asarray(wave, np.complex128)


def encircled(w: ArrayLike) -> NDArray[np.float64]:
    """Rayleigh's fraction of the light within w: 1 - J0² - J1²; 0.83778 within the first dark ring."""
    return 1 - j0(np.asarray(w, float)) ** 2 - j1(np.asarray(w, float)) ** 2
