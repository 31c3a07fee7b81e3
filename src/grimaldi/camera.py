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
    """Points (n, 3) that a camera sees, the unit normals there towards it (n, 3), and how wide a pixel is (n,).

    Where all rays of a film are one, pixels have no width.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    pixel: NDArray[np.float64]


def rays(sensor: Any, time: Any, wavelength: Any, place: Any, aperture: Any) -> tuple[Any, Any]:
    """A sensor's rays and their weights, one for each place on the film [0..1]², even where all are the same."""
    ray, weight = sensor.sample_ray_differential(time, wavelength, place, aperture)
    none = dr.zeros(mi.Vector3f, dr.width(place))
    ray.o, ray.d = ray.o + none, ray.d + none
    return ray, weight


def seen(scene: Scene, sensor: Any) -> View:
    """What a sensor sees of a scene, on a coarse grid."""
    width = int(sensor.film().crop_size()[0])
    index = dr.arange(mi.UInt32, 2 * GRID**2)  # each place of the grid, then those a pixel beside: in one kernel
    place, beside = index % GRID**2, index // GRID**2
    x = (mi.Float(place % GRID) + 0.5) / GRID + mi.Float(beside) / width
    y = (mi.Float(place // GRID) + 0.5) / GRID
    ray, _ = rays(sensor, 0.0, 0.5, mi.Point2f(x, y), mi.Point2f(0.5))
    si = scene.mitsuba.ray_intersect(ray)
    n = dr.mulsign(mi.Vector3f(si.n), -dr.dot(si.n, ray.d))
    met = si.is_valid()
    dr.eval(si.p, n, met)
    points, normals = (np.array(v, np.float64).T.reshape(2, -1, 3) for v in (si.p, n))
    pixel = np.linalg.norm(points[0] - points[1], axis=1)
    keep = np.array(met).reshape(2, -1).all(axis=0)
    return View(points[0][keep], normals[0][keep], pixel[keep])
