"""Arago's spot: the bright point in the middle of a disc's shadow."""

from __future__ import annotations

from typing import Any

from grimaldi.scene.builtin.bench import GREEN, bench, transform


def build(
    radius: float = 1.0, distance: float = 300.0, wavelength: float = GREEN, width: float = 4.0
) -> dict[str, Any]:
    """An opaque disc of `radius` a in a plane wave, `distance` L before the screen [mm].

    In the middle the intensity is C² (THEORY 5), nearly that without the disc. The spot falls off as
    J0²(2πar/λL): its first dark ring has the radius 0.383 λL/a, by default 0.061 mm or 7.8 of 512 pixels,
    the next ones follow λL/2a = 0.080 mm apart. Outside, the fringes begin √(λL) = 0.40 mm wide.
    """
    T = transform()
    parts = {
        "light": {"type": "coherent_directional", "direction": [0.0, 0.0, -1.0], "amplitude": 1.0},
        "disc": {
            "type": "disk",
            "to_world": T().translate([0, 0, distance]).scale([radius, radius, 1]),
            "bsdf": {"type": "twosided", "bsdf": {"type": "diffuse"}},
        },
    }
    return bench(wavelength, width, distance / 2, parts)
