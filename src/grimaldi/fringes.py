"""How wide fringes are against the pixels of a camera: to suggest a wavelength, and to warn."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import GrimaldiWarning
from grimaldi.outlines.extract import outline
from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Scene

WANTED = 4.0  # pixels that a suggested wavelength's fringes take
GRID = 32  # rays across the film


def suggested_wavelength(scene: Scene, sensor: Any) -> float | None:
    """The wavelength whose finest fringes are about four pixels wide; None where the camera sees none."""
    found = [(WANTED / scale) ** (1 / power) for scale, power in _scales(scene, sensor)]
    return max(found, default=None)


def warn_of_fine_fringes(scene: Scene, sensor: Any, wavelengths: Sequence[float]) -> None:
    """A GrimaldiWarning where fringes are narrower than a pixel and will look like noise."""
    shortest = min(wavelengths)
    widths = [scale * shortest**power for scale, power in _scales(scene, sensor)]
    if widths and min(widths) < 1:
        warnings.warn(
            f"{scene.name}: at wavelength {shortest:g} fringes are {min(widths):.2g} pixels wide and alias; take more "
            f"pixels, a closer camera, or a wavelength of about {suggested_wavelength(scene, sensor):.2g}",
            GrimaldiWarning,
            stacklevel=3,
        )


def _scales(scene: Scene, sensor: Any) -> Iterator[tuple[float, float]]:
    """Pairs (c, p): somewhere the camera sees fringes c λ^p pixels wide, in the median over what it sees.

    Behind an edge the first fringe takes √(λ z2 (z1+z2)/z1), z1 and z2 the distances from the edge to the source and
    to the surface; two sources of one group make fringes λ/α apart, α the angle between them.
    """
    points, pixel = _seen(sensor, scene)
    if not len(points):
        return
    for source in scene.sources:
        edges = outline(scene, source)
        if not len(edges):
            continue
        centre = edges.start.mean(axis=0)
        z2 = np.linalg.norm(points - centre, axis=1)
        z1 = np.inf if source.position is None else float(np.linalg.norm(centre - source.position))
        yield float(np.median(np.sqrt(z2 * (1 + z2 / z1)) / pixel)), 0.5
    for a, b in combinations(scene.sources, 2):
        if a.group == b.group:
            angle = np.linalg.norm(_direction(a, points) - _direction(b, points), axis=1)
            if (angle > 0).any():
                yield float(np.median(1 / (angle[angle > 0] * pixel[angle > 0]))), 1.0


def _direction(source: Any, points: Reals) -> Reals:
    if source.position is None:
        return np.broadcast_to(source.direction, points.shape)
    d = points - source.position
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def _seen(sensor: Any, scene: Scene) -> tuple[Reals, NDArray[np.float64]]:
    """Points (n, 3) that the camera sees on a coarse grid, and a pixel's width there (n,)."""
    import drjit as dr
    import mitsuba as mi

    width, height = (int(v) for v in sensor.film().crop_size())
    x, y = dr.meshgrid(*(dr.arange(mi.Float, GRID) / GRID + 0.5 / GRID for _ in range(2)))

    def hits(shift: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        ray, _ = sensor.sample_ray_differential(0.0, 0.5, mi.Point2f(x + shift / width, y), mi.Point2f(0.5))
        si = scene.mitsuba.ray_intersect(ray)
        return np.array(si.p, np.float64).T, np.array(si.is_valid())

    here, met = hits(0.0)
    beside, met_too = hits(1.0)
    both = met & met_too
    pixel = np.linalg.norm(here - beside, axis=1)
    keep = both & (pixel > 0)
    return here[keep], pixel[keep]
