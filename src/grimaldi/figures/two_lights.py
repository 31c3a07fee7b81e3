"""Figure 1 a-d: two coherent lights eight wavelengths apart."""

from __future__ import annotations

from typing import Any

import numpy as np

import grimaldi
from grimaldi.figures.drawing import Clock, Panel, grid, plane, strip
from grimaldi.figures.model import Answer, Figure, Picture, Settings
from grimaldi.film.colour import decode_srgb, encode_srgb
from grimaldi.film.phase import cyclic, two_colours

APART, HEIGHT, HALF = 8.0, 10.0, 20.0  # wavelengths


def scene() -> dict[str, Any]:
    """Two point sources `APART` apart along x, `HEIGHT` above the plane z = 0; λ = 1."""
    lights = {
        name: {"type": "coherent_point", "position": [side * APART / 2, 0.0, HEIGHT], "amplitude": HEIGHT}
        for name, side in (("left", -1), ("right", 1))
    }
    return {"type": "scene", **lights}


def bright_fringes(half: float) -> int:
    """How many hyperbolas of whole path difference cross the line |x| <= half under both lights."""
    farthest = np.hypot(half + APART / 2, HEIGHT) - np.hypot(half - APART / 2, HEIGHT)
    return 2 * int(np.floor(farthest)) + 1


def draw(settings: Settings) -> Figure:
    clock = Clock()
    n = 1024 if settings.full else 400
    x, y = grid(-HALF, HALF, -HALF, HALF, n)
    with_ = grimaldi.field(scene(), plane(x, y), wavelength=1.0, diffraction="none")
    without = grimaldi.field(scene(), plane(x, y), wavelength=1.0, diffraction="none", interference=False)
    u = with_.U.values[0, 0].reshape(n, n)
    intensity, plain = (field.intensity.values.reshape(n, n) for field in (with_, without))
    top = (0.0, 4.0)
    lit = encode_srgb(decode_srgb(two_colours(u)) * np.clip(intensity / 4, 0, 1)[..., None])
    seconds = str(clock)
    strip(
        settings.folder / "figure-1.png",
        [
            Panel("a  without interference", plain, limits=top),
            Panel("b  with interference", intensity, limits=top),
            Panel("c  phase, red 0..π, blue π..2π", two_colours(u)),
            Panel("d  phase × intensity", lit),
        ],
        (-HALF, HALF, -HALF, HALF),
        "x [λ]",
        "y [λ]",
        3.4,
    )
    strip(
        settings.folder / "figure-1-cyclic.png",
        [Panel("phase, even cyclic map (CET-C6)", cyclic(u)), Panel("log₁₀ of the intensity", _log(intensity))],
        (-HALF, HALF, -HALF, HALF),
        "x [λ]",
        "y [λ]",
    )
    count = bright_fringes(HALF)
    return Figure(
        "1",
        "Two coherent lights",
        "Two monochromatic point lights 8 λ apart over a plane, in the report's own colours: fields add first, and the "
        "length or the angle of the sum is taken when the picture is written.",
        (
            Picture("figure-1.png", "a-d as in the report"),
            Picture("figure-1-cyclic.png", "The same phase in a map without a step at 2π, and the dark fringes' depth"),
        ),
        {"lights": f"{APART:g} λ apart, {HEIGHT:g} λ above the plane", "pixels": f"{n} × {n}"},
        {"time": seconds, "bright fringes along y = 0": f"{count}, the number of whole path differences"},
        (
            Answer(
                "Light values are complex numbers in Cartesian form; intensity or phase is taken when the image is "
                "written (figure 1 a-d).",
                "reproduced",
                f"{count} bright hyperbolas within {HALF:g} λ, as their formula counts; the phase picture comes with "
                "an even cyclic map as well.",
            ),
        ),
    )


def _log(intensity: np.ndarray) -> np.ndarray:
    return np.log10(np.maximum(intensity, 1e-4))
