"""The knife edge: fringes beside the shadow of a straight edge."""

from __future__ import annotations

from typing import Any

from grimaldi.scene.builtin.bench import GREEN, bench, transform


def build(
    distance: float = 500.0, wavelength: float = GREEN, width: float = 8.0, extent: float = 120.0
) -> dict[str, Any]:
    """An opaque square of side `extent`, one edge over the middle of the screen, in a plane wave [mm].

    It covers x > 0, `distance` L before the screen. With v = x √(2/λL) the intensity is 1/4 at v = 0,
    1.370 at v = -1.217 and 0.778 at v = -1.873 (THEORY 5): by default the first maximum is 0.444 mm or
    28 of 512 pixels from the geometric edge, and the fringes narrow to 4 pixels at the picture's border.
    The other edges are more than 50 mm away: 0.2 % of the amplitude, in fringes finer than a pixel.
    """
    T = transform()
    parts = {
        "light": {"type": "coherent_directional", "direction": [0.0, 0.0, -1.0], "amplitude": 1.0},
        "knife": {
            "type": "rectangle",
            "to_world": T().translate([extent / 2, 0, distance]).scale([extent / 2, extent / 2, 1]),
            "bsdf": {"type": "twosided", "bsdf": {"type": "diffuse"}},
        },
    }
    return bench(wavelength, width, distance / 2, parts)
