"""The sentence in the report's introduction: sound from a speaker goes round a corner."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.figures.drawing import Clock, Panel, grid, plane, strip
from grimaldi.figures.model import Answer, Figure, Picture, Settings

WAVELENGTHS = {"3.4 m (100 Hz)": 3.4, "0.34 m (1 kHz)": 0.34, "3.4 cm (10 kHz)": 0.034}
LEFT, RIGHT, BOTTOM, TOP = -8.0, 12.0, -8.0, 8.0  # metres, seen from above
SPEAKER = (-4.0, -3.0, 0.0)


def scene() -> dict[str, Any]:
    """A speaker behind the end of a long, high wall that stands in the plane x = 0 at y < 0; metres."""
    import mitsuba as mi

    scalar: Any = mi.scalar_rgb
    wall = scalar.ScalarTransform4f().translate([0, -200, 0]).rotate([0, 1, 0], 90).scale(200)
    return {
        "type": "scene",
        "speaker": {"type": "coherent_point", "position": list(SPEAKER), "amplitude": 1.0},
        "wall": {"type": "rectangle", "to_world": wall, "bsdf": {"type": "twosided", "bsdf": {"type": "diffuse"}}},
    }


def level(points: NDArray[np.float64], wavelength: float, diffraction: str = "boundary") -> NDArray[np.float64]:
    """The level [dB] at points (n, 3), 0 dB one metre before the speaker."""
    field = grimaldi.field(scene(), points, wavelength=wavelength, diffraction=diffraction)
    return 10 * np.log10(np.maximum(field.intensity.values, 1e-12))


def draw(settings: Settings) -> Figure:
    clock = Clock()
    x, y = grid(LEFT, RIGHT, BOTTOM, TOP, 480 if settings.full else 240)
    points = plane(x, y)
    maps = {"rays": level(points, 1.0, "none")}
    maps |= {f"λ = {name}": level(points, wavelength) for name, wavelength in WAVELENGTHS.items()}
    last = list(maps)[-1]
    panels = [
        Panel(name, values.reshape(len(y), len(x)), "magma", (-60.0, 0.0), "level [dB]" if name == last else "")
        for name, values in maps.items()
    ]
    strip(settings.folder / "figure-7.png", panels, (LEFT, RIGHT, BOTTOM, TOP), "x [m]", "y [m]", 2.9)
    listener = np.array([[6.0, -4.0, 0.0]])
    heard = {name: level(listener, wavelength)[0] for name, wavelength in WAVELENGTHS.items()}
    free = -20 * np.log10(np.linalg.norm(listener[0] - SPEAKER))
    gains = ", ".join(f"{value - free:.0f} dB at {name}" for name, value in heard.items())
    return Figure(
        "7",
        "Sound round a corner",
        "Seen from above: a speaker stands behind the end of a long wall (x = 0, y < 0). By rays the other side is "
        "silent; a wave gets there, the longer the louder.",
        (Picture("figure-7.png", "Level round the end of a wall, by rays and at three wavelengths"),),
        {"speaker": f"{SPEAKER[:2]} m", "wall": "400 m high and long: a black half plane"},
        {"time": str(clock), "at (6, -4) m, against no wall": gains + "; by rays nothing"},
        (
            Answer(
                "Sound from a speaker goes round a corner (introduction).",
                "reproduced",
                f"In the shadow it falls by 10 dB from one decade of wavelength to the next: {gains}.",
            ),
        ),
    )
