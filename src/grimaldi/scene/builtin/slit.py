"""Diffraction by a slit: a plane wave through a long opening in an opaque screen."""

from __future__ import annotations

from typing import Any

from grimaldi.scene.builtin.bench import GREEN, bench, transform


def build(
    opening: float = 0.2,
    length: float = 60.0,
    distance: float = 200.0,
    wavelength: float = GREEN,
    width: float = 6.0,
) -> dict[str, Any]:
    """A slit `opening` a wide in x and `length` long in y, `distance` L before the screen [mm].

    The Fresnel number a²/4λL is 0.094, so that the picture is nearly Fraunhofer's sinc²(ax/λL): dark
    lines are λL/a apart, by default 0.532 mm or 45 of 512 pixels, and the first side lobes have 4.7 % of
    the middle, whose intensity is about a²/λL = 0.38 of the incident. The slit's ends are 27 mm beyond
    the picture, where their wave has 0.2 % of the amplitude in fringes finer than a pixel.
    """
    T = transform()
    parts = {
        "light": {"type": "coherent_directional", "direction": [0.0, 0.0, -1.0], "amplitude": 1.0},
        "slit": {
            "type": "rectangle",
            "to_world": T().translate([0, 0, distance]).scale([opening / 2, length / 2, 1]),
            "bsdf": {"type": "aperture"},
        },
    }
    return bench(wavelength, width, distance / 2, parts)
