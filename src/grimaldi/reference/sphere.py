"""Spheres in a plane wave by partial waves: soft, hard, or absorbing (Bowman, Senior, Uslenghi, ch. 10)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import eval_legendre, spherical_jn, spherical_yn

Complexes = NDArray[np.complex128]
Boundary = Literal["soft", "hard", "absorbing"]


def orders(size: float) -> NDArray[np.int_]:
    """The partial waves that a sphere of size ka scatters: beyond ka + a few (ka)^{1/3} there are none to 1e-16."""
    return np.arange(int(size + 8 * np.cbrt(size) + 12))


def coefficients(size: float, boundary: Boundary) -> Complexes:
    """a_n of the scattered wave Σ (2n+1) iⁿ a_n h_n(kr) P_n(cosθ), n from 0; `size` ka.

    Soft, u = 0: -j/h. Hard, ∂u/∂r = 0: -j'/h'. Absorbing, ∂u/∂r = -iku, the impedance of free space:
    -(j' + ij)/(h' + ih). All at ka.
    """
    n = orders(size)
    j, y = spherical_jn(n, size), spherical_yn(n, size)
    slope_j, slope_y = spherical_jn(n, size, derivative=True), spherical_yn(n, size, derivative=True)
    h, slope_h = j + 1j * y, slope_j + 1j * slope_y
    if boundary == "soft":
        return -j / h
    if boundary == "hard":
        return -slope_j / slope_h
    return -(slope_j + 1j * j) / (slope_h + 1j * h)


def field(points: ArrayLike, radius: float, wavelength: float, boundary: Boundary) -> Complexes:
    """U for U0 = e^{ikz} around a sphere at the origin, at `points` (m, 3) outside it."""
    p = np.asarray(points, float).reshape(-1, 3)
    k, r = 2 * np.pi / wavelength, np.linalg.norm(p, axis=1)
    n = orders(k * radius)
    strength = (2 * n + 1) * 1j**n * coefficients(k * radius, boundary)
    waves = spherical_jn(n, k * r[:, None]) + 1j * spherical_yn(n, k * r[:, None])
    scattered = (strength * waves * eval_legendre(n, (p[:, 2] / r)[:, None])).sum(axis=1)
    return np.exp(1j * k * p[:, 2]) + scattered


def cross_sections(size: float, boundary: Boundary) -> tuple[float, float]:
    """Extinction and scattering over πa²: -(4/(ka)²) Σ (2n+1) Re a_n and (4/(ka)²) Σ (2n+1) |a_n|²."""
    a = coefficients(size, boundary)
    weight = 4 / size**2 * (2 * orders(size) + 1)
    return -float((weight * a.real).sum()), float((weight * abs(a) ** 2).sum())
