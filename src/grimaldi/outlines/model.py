"""What a source sees of the edges that bound its light: plain frozen data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Outline:
    """The lit outlines of one source as straight segments, n of them, in world space.

    Each runs from `start` to `end` so that dφ > 0 (THEORY eq. 4-6) seen from a ray that hits the body,
    or goes through the hole. Neighbours share their end points exactly; where a near outline crosses
    in front of a far one the loop closes through a radial connector, which carries no dφ and is left out.
    """

    start: Reals  # (n, 3)
    end: Reals  # (n, 3)
    body: Integers  # (n,) index into Scene.bodies; -1 - i for planar outline i
    edge: Integers  # (n,) the mesh edge it lies on: 3 f + i from corner i of face f on; -1 on smooth shapes
    interval: Reals  # (n, 2) the lit part of that edge, as parameters in 0..1
    normals: Reals  # (n, 2, 3) unit normals of the two faces beside, towards the source first; 0 where there is none
    outward: Reals  # (n, 3) unit, across the ray from the source, towards the open side
    behind: Reals  # (n,) how far behind it, along the ray, its own body comes next; inf behind outer outlines
    chain: Integers  # (n,) segments of one chain follow each other in the arrays, end to start
    radius: Reals  # (n,) of curvature of the surface along the ray [scene units]; 0 where the rim is sharp
    sag: float = 0.0  # how far a segment may lie from the curve that it stands for [scene units]
    detour: float = 0.0  # how much Δ may err for that where the field is asked [scene units]
    far: float = float("inf")  # Δ from which on segments add nothing there that the tolerance sees [scene units]

    def __len__(self) -> int:
        return len(self.start)

    def distances(self, point: Reals) -> Reals:
        """How far each segment (n,) is from a point (3,)."""
        span, v = self.end - self.start, point - self.start
        t = np.clip((v * span).sum(1) / np.maximum((span * span).sum(1), 1e-300), 0, 1)
        return np.linalg.norm(v - t[:, None] * span, axis=1)

    @staticmethod
    def empty() -> Outline:
        """Nothing stands in the light."""
        none = np.empty(0, np.int64)
        points = np.empty((0, 3))
        return Outline(
            points, points, none, none, np.empty((0, 2)), np.empty((0, 2, 3)), points, np.empty(0), none, np.empty(0)
        )
