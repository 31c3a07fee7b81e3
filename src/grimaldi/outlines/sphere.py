"""The silhouette of a sphere: the circle where rays from the source touch it."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.candidate import Candidates, closed_curve, polygon, segments_for
from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Source, Sphere


def silhouette(sphere: Sphere, source: Source, sag: float) -> Candidates:
    """The tangent circle, as a polygon within `sag` of it; none around the source."""
    centre, radius, axis = tangent_circle(sphere, source)
    if radius == 0:
        return Candidates.empty()
    x, y = across(axis)
    # counter-clockwise about the direction of travel
    corners = centre + radius * polygon(segments_for(radius, sag)) @ np.stack([x, y])
    middle = 0.5 * (corners + np.roll(corners, -1, axis=0)) - sphere.centre
    normal = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    return closed_curve(corners, np.stack([normal, normal], axis=1))


def tangent_circle(sphere: Sphere, source: Source) -> tuple[Reals, float, Reals]:
    """Centre (3,), radius and axis (3,), unit along the light, of the circle of tangent rays.

    Radius 0 where the source is inside, as in a room: nothing is touched.
    """
    if source.position is None:
        assert source.direction is not None
        return sphere.centre, sphere.radius, source.direction
    d = sphere.centre - source.position
    distance = float(np.linalg.norm(d))
    if distance <= sphere.radius:
        return source.position, 0.0, d / distance if distance > 0 else np.array([0.0, 0.0, 1.0])
    sine = sphere.radius / distance
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
