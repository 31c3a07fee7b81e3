"""Where a source sees things."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Source

ROUNDING = 1e-12  # of the view's extent


def seen(source: Source, x: Reals) -> Reals:
    """Where points (..., 3) appear to the source: the unit direction, or the place across a plane wave's rays."""
    if source.position is not None:
        v = x - source.position
        return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)
    assert source.direction is not None
    return x - (x @ source.direction)[..., None] * source.direction


@dataclass(frozen=True, eq=False)
class View:
    """A source's view turned so that the first two of its three coordinates tell most apart.

    Of a point source they are the unit direction's, the third along `frame`'s third row; of a plane wave the place
    across the rays, the third 0.
    """

    source: Source
    frame: Reals  # (3, 3) rows across, across, along
    extent: float  # of what there is to see: 1 for directions

    @staticmethod
    def of(source: Source, points: Reals) -> View:
        """The view of a source that is to tell points (n, 3) apart."""
        mean = seen(source, points).mean(axis=0) if source.direction is None and len(points) else source.direction
        axis = np.array([1.0, 0, 0]) if mean is None or np.linalg.norm(mean) < 1e-6 else mean / np.linalg.norm(mean)
        x = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
        x /= np.linalg.norm(x)
        frame = np.stack([x, np.cross(axis, x), axis if source.direction is None else np.zeros(3)])
        extent = 1.0 if source.direction is None else max(float(np.abs(points).max(initial=0.0)), 1e-300)
        return View(source, frame, extent)

    def __call__(self, points: Reals) -> Reals:
        """View coordinates (3, n) of points (3, n)."""
        if self.source.position is None:
            return self.frame @ points
        v = points - self.source.position[:, None]
        return self.frame @ (v / np.maximum(np.sqrt((v * v).sum(axis=0)), 1e-300))

    def boxes(self, *corners: Reals, margin: Reals | float = 0.0) -> tuple[Reals, Reals]:
        """Boxes low, high (3, n) that hold all that is seen of the hulls of view points (3, n) each.

        Directions bulge out of a chord, or out of a flat patch on the unit sphere that a circle of radius ρ holds, by
        1 - √(1-ρ²) <= ρ², and ρ² is at most a third of the box's squared diagonal (Jung's theorem).
        """
        low, high = corners[0], corners[0]
        for corner in corners[1:]:
            low, high = np.minimum(low, corner), np.maximum(high, corner)
        margin = margin + ROUNDING * self.extent
        if self.source.position is not None:
            bulge = ((high - low) ** 2).sum(axis=0) / 3
            margin = margin + np.where(bulge > 0.6, 2.0, bulge)
        return low - margin, high + margin
