"""What a camera sees, coarsely: where the field will be asked, and how wide a pixel is there."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from grimaldi.scene.model import Scene

GRID = 32  # rays across the film


class View(NamedTuple):
    """Points (n, 3) that a camera sees, the unit normals there towards it (n, 3), and how wide a pixel is (n,)."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    pixel: NDArray[np.float64]


def seen(scene: Scene, sensor: Any) -> View:
    """What a sensor sees of a scene, on a coarse grid."""
    width = int(sensor.film().crop_size()[0])
    x, y = dr.meshgrid(*(dr.arange(mi.Float, GRID) / GRID + 0.5 / GRID for _ in range(2)))

    def hits(shift: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        ray, _ = sensor.sample_ray_differential(0.0, 0.5, mi.Point2f(x + shift / width, y), mi.Point2f(0.5))
        si = scene.mitsuba.ray_intersect(ray)
        n = dr.mulsign(mi.Vector3f(si.n), -dr.dot(si.n, ray.d))
        return np.array(si.p, np.float64).T, np.array(n, np.float64).T, np.array(si.is_valid())

    here, normals, met = hits(0.0)
    beside, _, met_too = hits(1.0)
    pixel = np.linalg.norm(here - beside, axis=1)
    keep = met & met_too & (pixel > 0)
    return View(here[keep], normals[keep], pixel[keep])
