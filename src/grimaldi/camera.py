"""What a camera sees, coarsely: where the field will be asked, and how wide a pixel is there."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from grimaldi.scene.model import Scene

GRID = 32  # rays across the film


def seen(scene: Scene, sensor: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 3) that the camera sees on a coarse grid, and a pixel's width there (n,)."""
    width = int(sensor.film().crop_size()[0])
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
