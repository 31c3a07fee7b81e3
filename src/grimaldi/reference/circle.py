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


def kirchhoff_area(
    radius: float, points: ArrayLike, wavelength: float, source_distance: float = np.inf, order: int = 200
) -> NDArray[np.complex128]:
    """M off the axis by Kirchhoff's area integral (Born & Wolf §8.3.2, eq. 17), brute force.

    -(1/4π) ∫ e^{ikΔ} R/(rs) [(ik - 1/s) z2/s + (ik - 1/r) z1/r] dA over the hole, by `order` Gauss-Legendre nodes
    along the radius and 2·`order` equal steps around. `points` (m, 3) behind the hole, its middle the origin, its axis
    z; the source is at (0, 0, -`source_distance`). Give an order well above 2 radius/wavelength.
    """
    k = 2 * np.pi / wavelength
    nodes, weights = np.polynomial.legendre.leggauss(order)
    rho = radius * (nodes + 1) / 2
    angle = np.pi / order * np.arange(2 * order)
    x, y = np.outer(rho, np.cos(angle)), np.outer(rho, np.sin(angle))
    area = np.pi / order * (radius / 2 * rho * weights)[:, None]
    result = []
    for px, py, z2 in np.asarray(points, float).reshape(-1, 3):
        s = np.sqrt((x - px) ** 2 + (y - py) ** 2 + z2**2)
        if np.isinf(source_distance):
            path, spread, out, near = s - z2, 1 / s, z2 / s + 1, z2 / s**2
        else:
            z1 = source_distance
            r, R = np.sqrt(x**2 + y**2 + z1**2), np.sqrt(px**2 + py**2 + (z1 + z2) ** 2)
            path, spread, out, near = r + s - R, R / (r * s), z2 / s + z1 / r, z2 / s**2 + z1 / r**2
        integrand = np.exp(1j * k * path) * spread * (1j * k * out - near)
        result.append(-(integrand * area).sum() / (4 * np.pi))
    return np.array(result, complex)
