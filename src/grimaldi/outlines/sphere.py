"""The silhouette of a sphere: the circle where rays from the source touch it."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.candidate import Candidates, closed_curve, polygon, segments_for
from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Source, Sphere


def silhouette(sphere: Sphere, source: Source, sag: float) -> Candidates:
    """The tangent circle, as a polygon within `sag` of it."""
    centre, radius, axis = tangent_circle(sphere, source)
    x, y = across(axis)
    # counter-clockwise about the direction of travel
    corners = centre + radius * polygon(segments_for(radius, sag)) @ np.stack([x, y])
    middle = 0.5 * (corners + np.roll(corners, -1, axis=0)) - sphere.centre
    normal = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    return closed_curve(corners, np.stack([normal, normal], axis=1))


def tangent_circle(sphere: Sphere, source: Source) -> tuple[Reals, float, Reals]:
    """Centre (3,), radius and axis (3,), unit along the light, of the circle of tangent rays."""
    if source.position is None:
        assert source.direction is not None
        return sphere.centre, sphere.radius, source.direction
    d = sphere.centre - source.position
    distance = float(np.linalg.norm(d))
    sine = min(sphere.radius / distance, 1.0)  # from inside, as in a room, nothing is touched
    return (
        sphere.centre - d * sine**2,
        sphere.radius * float(np.sqrt(1 - sine**2)),
        d / distance,
    )


def across(axis: Reals) -> tuple[Reals, Reals]:
    """Two unit vectors x, y with x × y = axis."""
    helper = np.eye(3)[np.abs(axis).argmin()]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return x, np.cross(axis, x)
