"""Sommerfeld's half plane: the exact field of a plane wave (Born & Wolf §11.5)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grimaldi.reference import fresnel_edge

Boundary = Literal["soft", "hard"]


def field(
    x: ArrayLike, z: ArrayLike, wavelength: float, boundary: Boundary, tilt: float = 0.0
) -> NDArray[np.complex128]:
    """U for U0 = e^{ik(x sin tilt + z cos tilt)} past the half plane z = 0, x > 0, on both of its sides.

        U = U0 F(-√(2kr) cos((θ-α)/2)) ∓ U' F(-√(2kr) cos((θ+α)/2)),   F: `fresnel_edge.factor` of √(2/π) times that

    with polar coordinates x = r cosθ, z = -r sinθ, the wave coming from θ = α, and U' its mirror image. Soft: U = 0
    on the half plane (E along the edge, minus); hard: ∂U/∂z = 0 there (H along the edge, plus).

    `x`, `z` (...) of receivers; `tilt` [rad] of the direction towards +x, between ±π/2.
    """
    x, z = np.broadcast_arrays(np.asarray(x, float), np.asarray(z, float))
    k, r = 2 * np.pi / wavelength, np.hypot(x, z)
    theta = np.mod(np.arctan2(-z, x), 2 * np.pi)
    source = np.pi / 2 + tilt
    parts = []
    for angle in (theta - source, theta + source):
        wave = np.exp(-1j * k * r * np.cos(angle))
        parts.append(wave * fresnel_edge.factor(-np.sqrt(4 * k * r / np.pi) * np.cos(angle / 2)))
    return parts[0] - parts[1] if boundary == "soft" else parts[0] + parts[1]
