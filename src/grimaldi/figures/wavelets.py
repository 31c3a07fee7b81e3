"""Figure 3: Huygens' wavelets add up to the next front."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.figures.drawing import Clock, Panel, grid, plane, strip
from grimaldi.figures.model import Answer, Figure, Picture, Settings

COUNTS = (1, 3, 9, 65)
LENGTH = 30.0  # of the row, in wavelengths: 65 sources are then under λ/2 apart
FAR, HALF = 18.0, 12.0


def scene(count: int) -> dict[str, Any]:
    """A row of sources in phase along y at x = 0, of total amplitude 1; λ = 1."""
    row = np.linspace(-LENGTH / 2, LENGTH / 2, count) if count > 1 else np.zeros(1)
    return {"type": "scene"} | {
        f"wavelet-{i}": {"type": "coherent_point", "position": [0.0, float(y), 0.0], "amplitude": 1 / count}
        for i, y in enumerate(row)
    }


def front(count: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The field (rows, columns) in the plane of the row."""
    field = grimaldi.field(scene(count), plane(x, y), wavelength=1.0, diffraction="none")
    return field.U.values[0, 0].reshape(len(y), len(x))


def unevenness(count: int) -> float:
    """How far the front's phase strays from its mean within 5 λ of the axis, 8 λ ahead [wavelengths]."""
    u = front(count, np.array([8.0]), np.linspace(-5, 5, 101))[:, 0]
    return float(np.ptp(np.unwrap(np.angle(u)))) / (2 * np.pi)


def draw(settings: Settings) -> Figure:
    clock = Clock()
    x, y = grid(0.0, FAR, -HALF, HALF, 480 if settings.full else 240)
    panels = []
    for count in COUNTS:
        u = front(count, x, y)
        shown = u.real / np.median(np.abs(u[:, x > 4]))
        title = f"{count} wavelet" if count == 1 else f"{count} wavelets"
        panels.append(Panel(title, shown, "RdBu_r", (-2.0, 2.0)))
    strip(settings.folder / "figure-3.png", panels, (0.0, FAR, -HALF, HALF), "x [λ]", "y [λ]")
    waves = {count: unevenness(count) for count in (9, 65)}
    return Figure(
        "3",
        "Huygens' principle",
        "The real part of the field that a row of sources in phase sends to the right. Closer than half a wavelength "
        "the wavelets merge into one front.",
        (Picture("figure-3.png", "Wavelets from 1, 3, 9 and 65 sources: 30, 15, 3.75 and 0.47 λ apart"),),
        {"row": f"{LENGTH:g} λ long", "field": "eq. 1, real part, scaled to its median"},
        {
            "time": str(clock),
            "phase of the middle 10 λ, 8 λ ahead": f"within {waves[65]:.2f} λ by 65, {waves[9]:.2f} λ by 9 wavelets",
        },
        (
            Answer(
                "Wavelets of point sources add up to the next front of a plane wave (figure 3).",
                "reproduced",
                f"65 sources 0.47 λ apart: even within {waves[65]:.2f} λ; 9 are too few.",
            ),
        ),
    )
