"""What the cases share: lights on the axis, outlines, and M as `grimaldi.field` computes it; λ = 1 throughout."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import grimaldi

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]

K = 2 * np.pi


class Computed(NamedTuple):
    """M (n,) at points, and the seconds it took."""

    m: Complexes
    seconds: float


def factor(
    points: Reals,
    tolerance: float,
    *,
    outlines: Sequence[grimaldi.PlanarOutline] = (),
    bodies: Mapping[str, Any] | None = None,
    source_distance: float = np.inf,
    **options: Any,
) -> Computed:
    """M = U/U0 of a plane wave along +z, or of a point source at (0, 0, -source_distance), in double precision.

    U0 is the light's own field, so that the rounding of its phase, some k R 1e-16, is not counted: see `sources`.
    """
    light: dict[str, Any] = {"type": "coherent_directional", "direction": [0, 0, 1]}
    if np.isfinite(source_distance):
        light = {"type": "coherent_point", "position": [0, 0, -source_distance]}
    alone: dict[str, Any] = {"type": "scene", "light": light}
    undisturbed = grimaldi.field(alone, points, wavelength=1.0, diffraction="none")
    begun = time.perf_counter()
    scene = grimaldi.load({**alone, **(bodies or {})}, outlines=list(outlines))
    field = grimaldi.field(scene, points, wavelength=1.0, tolerance=tolerance, precision="double", **options)
    seconds = time.perf_counter() - begun
    return Computed((field.U / undisturbed.U).values[0, 0], seconds)


def line(x: Reals, z: ArrayLike, y: float = 0.0) -> Reals:
    """Points (n, 3) along x at height z."""
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1).astype(float)


def difference(computed: ArrayLike, expected: ArrayLike) -> float:
    """max |ΔM|; NaN where any is."""
    return float(np.abs(np.asarray(computed) - np.asarray(expected)).max())


def rms(computed: ArrayLike, expected: ArrayLike) -> float:
    return float(np.sqrt((np.abs(np.asarray(computed) - np.asarray(expected)) ** 2).mean()))


def circle(radius: float, hole: bool = True) -> grimaldi.PlanarOutline:
    return grimaldi.PlanarOutline.ellipse(np.diag([radius, radius, 1, 1]), hole=hole)


def box(width: float, height: float, x: float = 0.0) -> grimaldi.PlanarOutline:
    """A rectangular hole with its middle at x."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array([width, height]) / 2
    return grimaldi.PlanarOutline(corners + np.array([x, 0.0]))


def half_plane(size: float) -> grimaldi.PlanarOutline:
    """An opaque mask whose one edge is x = 0, |y| <= size, and whose others flare out.

    Nothing beyond the edge has a stationary point, so that it sends back λ z/4π² size² for size < z.
    """
    return grimaldi.PlanarOutline(size * np.array([[0, -1], [1, -2], [10, 0], [1, 2], [0, 1]]), hole=False)


def paraxial(across: float, distance: float) -> float:
    """The phase k b⁴/8z³ that Fresnel's approximation leaves out, b the farthest that matters across the ray."""
    return K * across**4 / (8 * distance**3)
