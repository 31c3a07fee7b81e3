"""How a source's view of the scene is laid flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from grimaldi.outlines.model import Reals
from grimaldi.outlines.view import seen
from grimaldi.scene.model import Source

WIDEST = np.radians(75)  # from the axis; further out a gnomonic picture is stretched beyond use


@dataclass(frozen=True, eq=False)
class Projection:
    """From points in space to the source's picture plane, x to the right and y up as the source looks.

    `kind` is "parallel" for a plane wave (scene units), "gnomonic" (as through a pinhole: straight edges
    stay straight; units of the distance) where all lies within 75° of `axis`, and "azimuthal equidistant"
    (the angle from `axis` [rad], true in all directions up to the whole sphere) otherwise.
    """

    kind: str
    source: Source
    axis: Reals  # (3,) unit, into the picture
    right: Reals  # (3,)
    up: Reals  # (3,)

    def __call__(self, points: Reals) -> Reals:
        """Picture coordinates (..., 2) of points (..., 3)."""
        at = seen(self.source, points)
        across = np.stack([at @ self.right, at @ self.up], axis=-1)
        if self.kind == "parallel":
            return across
        along = (at @ self.axis)[..., None]
        if self.kind == "gnomonic":
            return across / along
        sine = np.linalg.norm(across, axis=-1, keepdims=True)
        return across * np.arctan2(sine, along) / np.maximum(sine, 1e-300)


def projection(source: Source, points: Reals) -> Projection:
    """The projection that suits `source` and what it is to show, `points` (n, 3)."""
    if source.direction is not None:
        return _upright("parallel", source, source.direction)
    at = seen(source, points)
    mean = at.mean(axis=0)
    length = np.linalg.norm(mean)
    axis = mean / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    wide = (at @ axis).min(initial=1.0) < np.cos(WIDEST)
    return _upright("azimuthal equidistant" if wide else "gnomonic", source, axis)


def _upright(kind: str, source: Source, axis: Reals) -> Projection:
    """With world z up in the picture, or y where the source looks along z."""
    sky = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(axis, sky)
    right /= np.linalg.norm(right)
    return Projection(kind, source, axis, right, np.cross(right, axis))
