"""The error of a picture as a part of what diffraction changes in it, and the loosest tolerance that keeps it small."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.bench.timing import anew
from grimaldi.scene.model import Scene

TOLERANCES = (0.1, 5e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3)  # the loosest first
REFERENCE = 1e-4
ALLOWED = 0.1


@dataclass(frozen=True)
class Film:
    """Side in pixels, samples a pixel, and the seed of its random numbers."""

    size: int
    spp: int
    seed: int

    def __str__(self) -> str:
        return f"{self.size}², {self.spp} spp"


@dataclass(frozen=True)
class Reached:
    """The error of pictures on a film at a tolerance."""

    tolerance: float
    error: float
    film: Film


def picture(scene: Scene, wavelength: float, film: Film, **options: Any) -> NDArray[np.float64]:
    """Linear radiance (y, x, channel), outlines found anew."""
    shot = grimaldi.render(
        anew(scene), wavelength=wavelength, size=(film.size, film.size), spp=film.spp, seed=film.seed, **options
    )
    return shot.picture.values.astype(np.float64)


def loosest(scene: Scene, wavelength: float, film: Film) -> Reached:
    """The loosest tolerance whose error is allowed; the strictest one where none is.

    The error is rms(p - p') / rms(p' - p0) over pixels: p at the tolerance, p' at tolerance 1e-4, p0 without
    diffraction, all with the same random numbers.
    """
    wave = picture(scene, wavelength, film, tolerance=REFERENCE)
    change = rms(wave - picture(scene, wavelength, film, diffraction="none"))
    tolerance, error = TOLERANCES[-1], np.inf
    for tolerance in TOLERANCES:
        error = rms(picture(scene, wavelength, film, tolerance=tolerance) - wave) / change
        if error <= ALLOWED:
            break
    return Reached(tolerance, error, film)


def field_error(scene: Scene, points: NDArray[np.float64], wavelength: float, tolerance: float) -> float:
    """The largest |ΔU| over |U0| = 1 at points (n, 3), against a hundredth of the tolerance in double precision."""
    asked = grimaldi.field(scene, points, wavelength=wavelength, tolerance=tolerance)
    strict = grimaldi.field(scene, points, wavelength=wavelength, tolerance=1e-2 * tolerance, precision="double")
    return float(abs(asked.U - strict.U).max())


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt((values**2).mean()))
