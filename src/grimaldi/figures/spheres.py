"""Figure 6 a-c: spheres by neither, by interference only, and with diffraction."""

from __future__ import annotations

from typing import Any

import grimaldi
from grimaldi.figures.drawing import Clock, side_by_side
from grimaldi.figures.model import Answer, Figure, Picture, Settings
from grimaldi.film.colour import automatic_exposure
from grimaldi.film.png import pixels
from grimaldi.scene.builtin.bench import film, transform

WAVELENGTH = 0.5
APART, DISTANCE = 5.0, 400.0  # of the lights: fringes λ·400/5 = 40 λ apart on the floor
BALLS = (((-12.0, 4.0, 9.0), 7.0), ((6.0, 14.0, 14.0), 10.0), ((9.0, -12.0, 6.0), 4.5))

WAYS: dict[str, dict[str, Any]] = {
    "a  neither": {"diffraction": "none", "interference": False},
    "b  interference only": {"diffraction": "none"},
    "c  with diffraction": {},
}


def scene(width: int, height: int) -> dict[str, Any]:
    """Three spheres over a floor, under two coherent lights `APART` apart."""
    T = transform()
    grey = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.7] * 3}}}
    lights = {
        name: {"type": "coherent_point", "position": [side * APART / 2 - 120.0, -90.0, DISTANCE], "amplitude": DISTANCE}
        for name, side in (("left", -1), ("right", 1))
    }
    balls = {
        f"ball-{i}": {"type": "sphere", "center": list(centre), "radius": radius, "bsdf": grey}
        for i, (centre, radius) in enumerate(BALLS)
    }
    return {
        "type": "scene",
        **lights,
        **balls,
        "floor": {"type": "rectangle", "to_world": T().scale([300, 300, 1]), "bsdf": grey},
        "sensor": {
            "type": "perspective",
            "fov": 32,
            "to_world": T().look_at([30, -120, 85], [4, 4, 3], [0, 0, 1]),
            "film": film(width, height),
        },
    }


def draw(settings: Settings) -> Figure:
    width, height, spp = (700, 525, 16) if settings.full else (360, 270, 4)
    pictures, times = [], {}
    for title, way in WAYS.items():
        clock = Clock()
        pictures.append(grimaldi.render(scene(width, height), wavelength=WAVELENGTH, spp=spp, **way))
        times[title.split("  ")[1] + ": time"] = str(clock)
    exposure = 0.6 * automatic_exposure(pictures[0]["picture"])
    shown = [(title, pixels(picture, "picture", exposure)) for title, picture in zip(WAYS, pictures, strict=True)]
    last = pictures[-1]
    worst = f"{float(last.error.max() / abs(last.U).max()):.1g} of the largest |U| (tolerance 1e-3)"
    side_by_side(settings.folder / "figure-6.png", shown)
    return Figure(
        "6",
        "Spheres",
        "Three spheres on a floor under two coherent lights.",
        (Picture("figure-6.png", "Neither; interference only; with diffraction"),),
        {
            "lights": f"{APART:g} units apart at {DISTANCE:g}, λ = {WAVELENGTH:g}",
            "pixels": f"{width} × {height}, {spp} samples",
        },
        {**times, "with diffraction: error": worst},
        (
            Answer(
                "A scene of spheres, by neither, with interference, with diffraction (figure 6 a-c); a sphere's "
                "silhouette is a circle.",
                "reproduced",
                "The circle is that of the tangent rays, not the great circle, cut where another sphere hides it.",
            ),
        ),
    )
