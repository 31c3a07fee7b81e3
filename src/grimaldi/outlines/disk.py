"""The outline of a disc: its rim, in general an ellipse."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.candidate import Candidates, closed_curve, edge_on, facing, polygon, segments_for, toward
from grimaldi.scene.model import Disk, Source


def silhouette(disk: Disk, source: Source, sag: float) -> Candidates:
    """The rim as a polygon within `sag` of it; a sheet has one normal, and in the plane of its rays stops none."""
    x, y = disk.to_world[:3, 0], disk.to_world[:3, 1]
    centre = disk.to_world[:3, 3]
    size = float(np.linalg.norm([x, y]))
    corners = centre + polygon(segments_for(size, sag)) @ np.stack([x, y])
    normal = np.cross(x, y)
    if edge_on(source, normal[None], centre[None])[0]:
        return Candidates.empty()
    if toward(source, centre[None])[0] @ normal > 0:  # counter-clockwise about the direction of travel
        corners = corners[::-1]
    unit = facing(source, np.broadcast_to(normal / np.linalg.norm(normal), corners.shape), corners)
    return closed_curve(corners, np.stack([unit, np.zeros_like(unit)], axis=1))
