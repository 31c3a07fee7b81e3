"""The flagship: the shadow of a creature on a floor and a wall, with its diffraction fringes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from grimaldi.scene.builtin.bench import film, transform

MESH = Path(__file__).with_name("creature.ply")  # made by scenes/make_creature.py


def build(wavelength: float = 0.0532, width: int = 700, height: int = 525) -> dict[str, Any]:
    """A creature 1 mm tall in green light: 100 scene units of 10 µm, `wavelength` 532 nm.

    The light is a point at a distance z1 of about 460 from the creature, whose shadow falls z2 of about
    140 behind it on floor and wall. With 1/L = 1/z1 + 1/z2 the first bright fringe lies 0.86 √(λL) from
    the shadow's rim, times the magnification (z1+z2)/z1: 2.7 units or 5 of 700 pixels, and the next ones
    follow 4, 3, 2 ... pixels apart, as in the report's figure 5. The head's edges are about 4.5 times
    shorter than the body's: where tessellation biases a method, it shows there.
    """
    T = transform()
    plain = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.75, 0.74, 0.72]}}
    return {
        "type": "scene",
        "scene_unit": "10 um",
        "integrator": {"type": "wave", "wavelength": wavelength},
        "light": {
            "type": "point",
            "position": [-230.0, -400.0, 125.0],
            "intensity": {"type": "rgb", "value": [1.00e6, 0.92e6, 0.80e6]},
        },
        "creature": {
            "type": "ply",
            "filename": str(MESH),
            "bsdf": {
                "type": "twosided",
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.42, 0.55, 0.36]}},
            },
        },
        "floor": {"type": "rectangle", "to_world": T().scale([1500, 1500, 1]), "bsdf": plain},
        "wall": {
            "type": "rectangle",
            "to_world": T().translate([0, 120, 0]).rotate([1, 0, 0], 90).scale([1500, 1500, 1]),
            "bsdf": plain,
        },
        "sensor": {
            "type": "perspective",
            "fov": 34,
            "fov_axis": "x",
            "to_world": T().look_at([330, -480, 180], [40, 40, 50], [0, 0, 1]),
            "film": film(width, height),
            "sampler": {"type": "independent", "sample_count": 16},
        },
    }
