"""The error of a picture as a part of what diffraction changes in it, and the loosest tolerance that keeps it small."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.bench.timing import anew, timed
from grimaldi.scene.model import Scene
from grimaldi.validation.computing import rms

TOLERANCES = (0.3, 0.2, 0.15, 0.1, 7e-2, 5e-2, 4e-2, 3e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3)  # the loosest first
REFERENCE = 1e-4
ALLOWED = 0.1
PATIENCE = 60.0  # for one picture, and for the reference at all strips [s]
STRIPS, LENGTH = 120, 50  # of pixels in a row, at which the reference is asked
HOW = (
    f"The tolerance is the loosest whose error is within {ALLOWED:.0%}; after a picture that takes longer than "
    f"{PATIENCE:g} s no stricter one is tried. The error is rms(p - p') / rms(p' - p0) over the pixels of strips at "
    f"random places of this film, with the same random numbers: p is the picture, p' that at tolerance {REFERENCE:g}, "
    "M asked for at every sample, and p0 the one without diffraction."
)


@dataclass(frozen=True)
class Film:
    """Side in pixels, samples a pixel, and the seed of its random numbers."""

    size: int
    spp: int
    seed: int

    def __str__(self) -> str:
        return f"{self.size}², {self.spp} spp"

    def strips(self) -> list[int]:
        """First pixels of disjoint strips of LENGTH pixels, counted along rows, at random by the seed."""
        chosen = np.random.default_rng(self.seed).permutation(self.size**2 // LENGTH)[:STRIPS]
        return (LENGTH * chosen).tolist()


@dataclass(frozen=True, eq=False)
class Reference:
    """Linear radiance (n, channels) at some pixels (n,) of a film, counted along rows."""

    pixels: NDArray[np.int64]
    wave: NDArray[np.float64]
    rays: NDArray[np.float64]  # without diffraction

    def error(self, picture: NDArray[np.float64]) -> float:
        """Of a picture (y, x, channel): rms(p - p') / rms(p' - p0), p' with diffraction and p0 without."""
        p = picture.reshape(-1, picture.shape[2])[self.pixels]
        return rms(p, self.wave) / rms(self.wave, self.rays)


@dataclass(frozen=True)
class Reached:
    """The error at a tolerance and at how many pixels it was measured; the seconds of the picture, rendered once.

    That is the first one in its light: outlines are found.
    """

    tolerance: float
    error: float
    pixels: int
    time: float

    def cells(self) -> dict[str, str]:
        """As a table shows it."""
        above = "" if self.error <= ALLOWED else f", above {ALLOWED:.0%}"
        return {
            "tolerance": f"{self.tolerance:g}",
            "error": f"{self.error:.1%}{above}",
            "measured at": f"{self.pixels:,} pixels",
        }


def picture(scene: Scene, wavelength: float, film: Film, **options: Any) -> NDArray[np.float64]:
    """Linear radiance (y, x, channel)."""
    shot = grimaldi.render(
        scene, wavelength=wavelength, size=(film.size, film.size), spp=film.spp, seed=film.seed, **options
    )
    return shot.picture.values.astype(np.float64)


def reference(scene: Scene, wavelength: float, film: Film, patience: float = PATIENCE) -> Reference:
    """What `picture` has at tolerance 1e-4 and without diffraction, at the pixels of the film's strips.

    M is asked for at every sample. Where all strips take longer than `patience` [s], it is at those done by then.
    """
    from grimaldi.engine.tiles import render_tile
    from grimaldi.light import prepare
    from grimaldi.options import Settings
    from grimaldi.rendering import resized, shot_of

    sensor = scene.mitsuba.sensors()[0]
    wave: list[NDArray[np.float32]] = []
    rays: list[NDArray[np.float32]] = []
    firsts = film.strips()
    begun = None
    with resized(sensor, (film.size, film.size)):
        shot = shot_of(sensor, None, film.spp, film.seed, None)
        strict = prepare(anew(scene), Settings(wavelength, tolerance=REFERENCE, fast=False))
        sharp = prepare(anew(scene), Settings(wavelength, diffraction="none"))
        for first in firsts:
            wave.append(render_tile(strict, sensor, shot, first, LENGTH).picture)
            rays.append(render_tile(sharp, sensor, shot, first, LENGTH).picture)
            begun = begun or time.perf_counter()  # the first strip compiles the kernels
            if time.perf_counter() - begun > patience:
                break
    pixels = np.add.outer(firsts[: len(wave)], np.arange(LENGTH)).ravel()
    return Reference(pixels, *(np.concatenate(strips, axis=1).T.astype(np.float64) for strips in (wave, rays)))


def loosest(scene: Scene, wavelength: float, film: Film, patience: float = PATIENCE) -> Reached:
    """The loosest tolerance whose error is allowed; where none is, that of the least error.

    After a picture that took longer than `patience` [s], no stricter tolerance is tried.
    """
    exact = reference(scene, wavelength, film, patience)
    picture(scene, wavelength, replace(film, size=film.size // 8), tolerance=TOLERANCES[0])  # compiles the kernels
    tried: list[Reached] = []
    for tolerance in TOLERANCES:
        found, seconds = timed(lambda tolerance=tolerance: picture(anew(scene), wavelength, film, tolerance=tolerance))
        tried.append(Reached(tolerance, exact.error(found), len(exact.pixels), seconds))
        if tried[-1].error <= ALLOWED or seconds > patience:
            break
    return min(tried, key=lambda reached: reached.error)


def field_error(scene: Scene, points: NDArray[np.float64], wavelength: float, tolerance: float) -> float:
    """The largest |ΔU| over |U0| = 1 at points (n, 3), against a hundredth of the tolerance in double precision."""
    asked = grimaldi.field(scene, points, wavelength=wavelength, tolerance=tolerance)
    strict = grimaldi.field(scene, points, wavelength=wavelength, tolerance=1e-2 * tolerance, precision="double")
    return float(abs(asked.U - strict.U).max())
