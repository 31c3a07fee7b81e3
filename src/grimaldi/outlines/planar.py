"""The outline of planar holes and masks: their loops, whole."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.candidate import Candidates, closed_curve, facing, polygon, segments_for, toward
from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Source
from grimaldi.scene.planar import PlanarOutline


def loops(planar: PlanarOutline, source: Source, sag: float) -> list[Candidates]:
    """The loops of a planar outline, each turned so that dφ > 0 seen from a ray that goes through."""
    result = []
    reverse = toward(source, planar.origin[None])[0] @ planar.normal > 0
    for corners in _corners(planar, sag):
        corners = corners[::-1] if reverse else corners
        unit = facing(source, np.broadcast_to(planar.normal, corners.shape), corners)
        result.append(closed_curve(corners, np.stack([unit, np.zeros_like(unit)], axis=1)))
    return result


def _corners(planar: PlanarOutline, sag: float) -> tuple[Reals, ...]:
    if not planar.is_ellipse:
        return planar.world_loops()
    x, y = planar.to_world[:3, 0], planar.to_world[:3, 1]
    n = segments_for(float(np.linalg.norm([x, y])), sag)
    return (planar.origin + polygon(n) @ np.stack([x, y]),)
