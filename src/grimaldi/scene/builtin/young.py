"""Young's experiment: two coherent point sources light a screen."""

from __future__ import annotations

from typing import Any

from grimaldi.scene.builtin.bench import GREEN, bench


def build(
    separation: float = 1.0, distance: float = 1000.0, wavelength: float = GREEN, width: float = 8.0
) -> dict[str, Any]:
    """Two sources `separation` s apart along x, `distance` L from a screen of which `width` is seen [mm].

    Bright fringes along y are λL/s apart: by default 0.532 mm, which is 34 of 512 pixels and 15 fringes.
    A bright one is in the middle. Their intensity is 4A²/L² = 1 and that between them 0.
    """
    sources = {
        name: {
            "type": "coherent_point",
            "position": [side * separation / 2, 0.0, distance],
            "amplitude": distance / 2,
            "phase": 0.0,
            "group": "0",
        }
        for name, side in (("left", -1), ("right", 1))
    }
    return bench(wavelength, width, distance / 2, sources)
