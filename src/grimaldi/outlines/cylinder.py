"""The outline of a cylinder's open tube: two tangent lines and its rims."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.candidate import Candidates, facing, segments_for, toward
from grimaldi.outlines.model import Reals
from grimaldi.scene.bodies import tube
from grimaldi.scene.model import Cylinder, Mesh, Source

ALONG = 1e-12  # sine of the angle below which light runs along the axis
PIECES = 32  # of a tangent line, so that its edges are not much longer than a rim's


def silhouette(cylinder: Cylinder, source: Source, sag: float) -> Candidates:
    """Both rims as polygons within `sag` of them, and the lines where the source's rays touch the tube.

    From inside, or along the axis, nothing is touched. A plane wave along the axis meets no surface at all.
    """
    if source.direction is not None and _tangents(cylinder, source) is None:
        return Candidates.empty()
    to_world = cylinder.to_world
    ring = _ring(_angles(cylinder, source, sag))
    turned = np.roll(ring, -1, axis=0)
    up = np.array([0, 0, 1.0])
    lines = _ring(np.array(_tangents(cylinder, source) or ()))
    along = lines[:, None] + np.linspace(0, 1, PIECES + 1)[:, None] * up
    lines = np.repeat(lines, PIECES, axis=0)
    start = np.concatenate([ring, ring + up, along[:, :-1].reshape(-1, 3)])
    end = np.concatenate([turned, turned + up, along[:, 1:].reshape(-1, 3)])
    middle = 0.5 * (start + end)
    axis = to_world[:3, 2]
    wall = np.concatenate([np.tile(axis, (len(ring), 1)), np.tile(-axis, (len(ring), 1)), -lines @ to_world[:3, :3].T])
    normal = (middle * [1, 1, 0]) @ np.linalg.inv(to_world[:3, :3])
    start, end, middle = (x @ to_world[:3, :3].T + to_world[:3, 3] for x in (start, end, middle))
    # the wall on the left of the edge, seen along the light
    right = np.einsum("ij,ij->i", np.cross(-toward(source, middle), end - start), wall) < 0
    start, end = np.where(right[:, None], end, start), np.where(right[:, None], start, end)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    rim = np.arange(len(start))[:, None] < 2 * len(ring)
    normals = np.where(rim, [facing(source, normal, middle), 0 * normal], normal).swapaxes(0, 1)
    none = np.full(len(start), -1)
    return Candidates(start, end, normals, none, np.stack([none, none], axis=1))


def strip(cylinder: Cylinder, source: Source, sag: float) -> Mesh:
    """The tube as flat faces within `sag` of it, with edges where the source's rays touch it."""
    return tube(cylinder, _ring(_angles(cylinder, source, sag)))


def _ring(angle: Reals) -> Reals:
    """Points (n, 3) of the unit circle."""
    return np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


def _tangents(cylinder: Cylinder, source: Source) -> tuple[float, float] | None:
    """Angles of the two lines where the source's rays touch the tube; the first begins the side towards it."""
    inverse = np.linalg.inv(cylinder.to_world)
    if source.position is not None:
        x, y = (inverse @ [*source.position, 1.0])[:2]
        distance = float(np.hypot(x, y))
        half = np.arccos(1 / distance) if distance > 1 else None
    else:
        w = inverse[:3, :3] @ toward(source, np.zeros((1, 3)))[0]
        x, y = w[:2]
        half = 0.5 * np.pi if np.hypot(x, y) > ALONG * np.linalg.norm(w) else None
    if half is None:
        return None
    middle = float(np.arctan2(y, x))
    return middle - half, middle + half


def _angles(cylinder: Cylinder, source: Source, sag: float) -> Reals:
    """Where a rim's segments meet, evenly on each side of the tangent lines."""
    radius = float(np.linalg.norm(cylinder.to_world[:3, :2], axis=0).max())
    n = segments_for(radius, min(sag, 0.01 * radius))
    lines = _tangents(cylinder, source)
    if lines is None:
        return 2 * np.pi * np.arange(n) / n
    low, high = lines
    parts = []
    for start, span in ((low, high - low), (high, 2 * np.pi - (high - low))):
        count = max(int(np.ceil(n * span / (2 * np.pi))), 2)
        parts.append(start + span * np.arange(count) / count)
    return np.concatenate(parts)
