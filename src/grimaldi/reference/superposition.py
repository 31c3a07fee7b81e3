"""Point sources in free space summed by the definition (THEORY eq. 1 and 3), in extended precision."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


def fields(
    positions: ArrayLike,
    amplitudes: ArrayLike,
    phases: ArrayLike,
    groups: Sequence[Hashable],
    points: ArrayLike,
    wavelength: float,
) -> dict[Hashable, NDArray[np.complex128]]:
    """Eq. 1 summed within each coherence group: {group: U (points,)} in order of first appearance.

    `positions` (n, 3), `amplitudes` (n,), `phases` (n,) [rad] and `groups` (n) of the sources;
    `points` (m, 3). Path lengths are reduced by whole wavelengths in `longdouble` where the machine has it.
    """
    extended = np.longdouble
    receivers = np.asarray(points, extended)
    total: dict[Hashable, NDArray[np.complex128]] = {}
    sources = zip(np.asarray(positions, extended), np.asarray(amplitudes), np.asarray(phases), groups, strict=True)
    for position, amplitude, phase, group in sources:
        length = np.sqrt(((receivers - position) ** 2).sum(axis=-1))
        cycles = length / extended(wavelength)
        angle = 2 * np.pi * (cycles - np.floor(cycles)).astype(float) + phase
        wave = amplitude * np.exp(1j * angle) / length.astype(float)
        total[group] = total.get(group, 0) + wave
    return total


def intensity(groups: dict[Hashable, NDArray[np.complex128]]) -> NDArray[np.float64]:
    """Eq. 3 for one wavelength of unit weight: Σ_group |U|², (points,)."""
    return np.asarray(sum(abs(u) ** 2 for u in groups.values()), np.float64)
