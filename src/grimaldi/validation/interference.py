"""Sources in free space."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import grimaldi
from grimaldi.reference import superposition
from grimaldi.reference import young as reference
from grimaldi.validation.computing import K, difference, line
from grimaldi.validation.model import Case, Curve


def young() -> Case:
    """Two fringes to either side of the axis."""
    far, apart = 1e8, 1e4
    x = np.linspace(-2, 2, 161) * reference.fringe_spacing(1, far, apart)
    scene: dict[str, Any] = {
        f"light-{i}": {"type": "coherent_point", "position": [side * apart / 2, 0, 0], "amplitude": far}
        for i, side in enumerate((1, -1))
    }
    begun = time.perf_counter()
    field = grimaldi.field({"type": "scene", **scene}, line(x, far), wavelength=1.0, diffraction="none")
    seconds = time.perf_counter() - begun
    computed, expected = field.intensity.values, reference.intensity(x, 1, far, apart)
    phase = K * apart * x.max() * (x.max() ** 2 + apart**2 / 4) / (2 * far**3)
    rounding = K * np.spacing(far)
    return Case(
        "young",
        "Fresnel",
        "young.intensity",
        difference(computed, expected),
        0.0,
        float(2 * (phase + rounding)),  # 4cos²(δ/2) changes by 2 dδ at most
        seconds,
        f"of I/I_one; sources {apart:g} λ apart, z = {far:g} λ",
        Curve(x / reference.fringe_spacing(1, far, apart), computed, expected, "x s/λz", "I/I₁"),
    )


def sources() -> Case:
    """Five sources of two groups at 400 λ: each group's field by eq. 1 in extended precision."""
    positions = np.array([[-4, 0, 0], [4, 1, 0], [0, 3, -2], [9, -5, 1], [-7, -2, 3]], float)
    amplitudes, phases = np.array([1, 0.7, 1.3, 0.5, 0.9]), np.array([0, 1, 2, -1, 0.5])
    groups = ["a", "b", "a", "b", "a"]
    x = np.linspace(-80, 80, 161)
    points = line(x, 400, 7.0)
    scene: dict[str, Any] = {
        f"light-{i}": {
            "type": "coherent_point",
            "position": position.tolist(),
            "amplitude": float(amplitudes[i]),
            "phase": float(phases[i]),
            "group": groups[i],
        }
        for i, position in enumerate(positions)
    }
    begun = time.perf_counter()
    field = grimaldi.field({"type": "scene", **scene}, points, wavelength=1.0, diffraction="none")
    seconds = time.perf_counter() - begun
    exact = superposition.fields(positions, amplitudes, phases, groups, points, 1.0)
    expected = np.stack([exact[str(group)] for group in field.group.values])
    computed = field.U.values[0]
    scale = 1 / np.hypot(400, 7)
    return Case(
        "sources",
        "exact",
        "superposition.fields",
        difference(computed, expected) / scale,
        0.0,
        float(2 * K * np.spacing(400.0) * amplitudes.sum()),
        seconds,
        "of U/U₀; five sources in two groups, 400 λ away",
        Curve(x, computed[0] / scale, expected[0] / scale, "x [λ]", "U/U₀"),
    )
