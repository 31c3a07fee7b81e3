"""How wide fringes are against the pixels of a camera: to suggest a wavelength, and to warn."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from grimaldi.camera import View, seen
from grimaldi.errors import GrimaldiWarning
from grimaldi.outlines.model import Reals
from grimaldi.scene.bodies import vertices
from grimaldi.scene.model import Scene

FEW = 64  # bodies suffice likewise
SOME = 64  # points of a body suffice to tell how far it is
WANTED = 4.0  # pixels that a suggested wavelength's fringes take


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
            stacklevel=5,
        )


def _scales(scene: Scene, sensor: Any) -> Iterator[tuple[float, float]]:
    """Pairs (c, p): somewhere the camera sees fringes c λ^p pixels wide, in the median over what it sees.

    Behind an edge the first fringe takes √(λ z2 (z1+z2)/z1), z1 and z2 the distances from the edge to the source and
    to the surface; two sources of one group make fringes λ/α apart, α the angle between them.
    """
    whole = seen(scene, sensor)
    view = View(*(values[whole.pixel > 0] for values in whole))
    points, pixel = view.points, view.pixel
    if not len(points):
        return
    for source in scene.sources:
        for x in _obstacles(scene):
            edges = _above(x, view)
            if not len(edges):
                continue
            centre = edges.mean(axis=0)
            z2 = np.linalg.norm(points - centre, axis=1)
            z1 = np.inf if source.position is None else float(np.linalg.norm(centre - source.position))
            yield float(np.median(np.sqrt(z2 * (1 + z2 / z1)) / pixel)), 0.5
    for a, b in combinations(scene.sources, 2):
        if a.group == b.group:
            angle = np.linalg.norm(_direction(a, points) - _direction(b, points), axis=1)
            if (angle > 0).any():
                yield float(np.median(1 / (angle[angle > 0] * pixel[angle > 0]))), 1.0


def _obstacles(scene: Scene) -> Iterator[Reals]:
    """Some points (n, 3) of each hole, mask and body that stands in the light; of many bodies, of some."""
    for body in scene.bodies[:: len(scene.bodies) // FEW + 1]:
        x = vertices(body.geometry)
        yield x[:: len(x) // SOME + 1]
    for shape in scene.screen:
        yield np.concatenate(shape.world_loops(SOME))


def _above(x: Reals, view: View) -> Reals:
    """The points x (n, 3) that rise above the horizon of at least half of what the camera sees: others do not act."""
    rise = np.einsum("ik,jk->ij", view.normals, x) - np.einsum("ik,ik->i", view.normals, view.points)[:, None]
    far = 1e-3 * np.linalg.norm(x[None] - view.points[:, None], axis=2)
    return x[(rise > far).mean(axis=0) >= 0.5]


def _direction(source: Any, points: Reals) -> Reals:
    if source.position is None:
        return np.broadcast_to(source.direction, points.shape)
    d = points - source.position
    return d / np.linalg.norm(d, axis=1, keepdims=True)
