"""A circular hole or disc off its axis, in the Fresnel approximation, by Lommel's series (Born & Wolf §8.8.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv


def hole(
    radius: float, offset: ArrayLike, distance: ArrayLike, wavelength: float, source_distance: float = np.inf
) -> NDArray[np.complex128]:
    """M behind a hole, with u = k a²/L, v = k a ρ/L, 1/L = 1/z1 + 1/z2.

        v >= u (shadow):  M = -i e^{i(u + v²/u)/2} (U1 - i U2),   Un = Σ (-1)^s (u/v)^{n+2s} J_{n+2s}(v)
        v <  u (light):   M = 1 - e^{i(u + v²/u)/2} (V0 - i V1),  Vn = Σ (-1)^s (v/u)^{n+2s} J_{n+2s}(v)

    Both series hold for every u and v, but lose all digits on the other side of v = u, where their terms grow.

    `offset` ρ (...): where the ray from source to receiver crosses the hole's plane, from its middle; `distance` z2
    (...) and `source_distance` z1: of that plane from receiver and source. Leaves out phases of order
    k b⁴ (1/z1³ + 1/z2³)/8, b being the farthest point of the rim from the ray.
    """
    rho, z2 = np.broadcast_arrays(np.abs(np.asarray(offset, float)), np.asarray(distance, float))
    scale = 2 * np.pi / wavelength * radius * (1 / z2 + 1 / source_distance)
    u, v = scale * radius, scale * rho
    border = np.exp(0.5j * (u + v**2 / u))
    shadow = v >= u
    ratio = np.where(shadow, u, v) / np.maximum(u, v)
    first, second = _series(ratio, v, np.where(shadow, 1, 0))
    sum_ = first - 1j * second
    return np.where(shadow, -1j * border * sum_, 1 - border * sum_)


def disc(
    radius: float, offset: ArrayLike, distance: ArrayLike, wavelength: float, source_distance: float = np.inf
) -> NDArray[np.complex128]:
    """M behind an opaque disc: 1 - `hole` (Babinet)."""
    return 1 - hole(radius, offset, distance, wavelength, source_distance)


def _series(
    ratio: NDArray[np.float64], v: NDArray[np.float64], start: NDArray[np.int_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Σ_s (-1)^s ratio^{n+2s} J_{n+2s}(v) for n = start and n = start + 1; ratio <= 1.

    J_m(v) falls faster than any power once m > v + a few v^{1/3}.
    """
    largest = float(v.max(initial=0))
    terms = int(0.5 * (largest + 12 * np.cbrt(largest) + 40))
    total = []
    for n in (start, start + 1):
        order = n[..., None] + 2 * np.arange(terms)
        signs = (-1.0) ** np.arange(terms)
        total.append((signs * ratio[..., None] ** order * jv(order, v[..., None])).sum(axis=-1))
    return total[0], total[1]
