"""Silhouette and border edges of a triangle mesh as a source sees them.

An edge bounds the light exactly where all its triangles lie on one side of it in the source's view: so borders of
open meshes count, edges between coplanar faces do not, and neither winding nor the number of triangles at an edge
matters. Each triangle's side is decided once: the edges of a closed mesh form closed loops.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.candidate import Candidates, edge_on, facing, toward
from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.model import Mesh, Source


def weld(mesh: Mesh) -> tuple[Reals, Integers]:
    """Vertices merged by position (n, 3), and faces (m, 3) among them; faces without three corners keep no edge."""
    points = np.ascontiguousarray(mesh.vertices + 0.0)  # -0.0 becomes 0.0
    keys = points.view(np.dtype((np.void, points.itemsize * 3))).ravel()
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    return points[first], inverse[mesh.faces]


def has_corners(faces: Integers) -> NDArray[np.bool_]:
    """Whether faces (m, 3) join three different vertices."""
    return (faces != np.roll(faces, 1, axis=1)).all(axis=1)


def sides(source: Source, corners: Reals) -> Integers:
    """±1: whether triangles (m, 3, 3) turn counter-clockwise along the rays of the source.

    Edge-on ones turn as they would for the source a little nearer to their common middle: winding does not matter,
    and a box in light along its walls is bounded by the border of its front.
    """
    a, area = corners[:, 0], areas(corners)
    turn = -np.einsum("ij,ij->i", area, toward(source, a))
    nearer = np.einsum("ij,ij->i", area, a - corners.mean(axis=(0, 1)))
    return np.where(np.where(edge_on(source, area, a), nearer, turn) < 0, -1, 1)


def areas(corners: Reals) -> Reals:
    """Twice the area vectors (m, 3) of triangles (m, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.cross(b - a, c - a)


def silhouette(mesh: Mesh, source: Source) -> Candidates:
    """All edges of the mesh that bound its light: folds, and borders of open meshes.

    The first normal of a fold is that of the face towards the source, turned to it; the second one's face lies
    behind and its normal points away, so that the body is behind both. A border has one normal.
    """
    points, faces = weld(mesh)
    whole = has_corners(faces)
    index, faces = np.flatnonzero(whole), faces[whole]
    corners = points[faces]
    if edge_on(source, areas(corners), corners[:, 0]).all():  # a sheet in the plane of its rays stops none
        return Candidates.empty()
    side = sides(source, corners)

    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    forward = tail < head
    key = np.where(forward, tail, head) * len(points) + np.where(forward, head, tail)
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    turn = np.where(forward, 1, -1) * np.repeat(side, 3)
    total = np.add.reduceat(turn[order], first) if len(first) else first
    bounds = np.flatnonzero(np.abs(total) == count)

    corner = order[first[bounds]]
    along = turn[corner] > 0
    low, high = np.where(forward, tail, head)[corner], np.where(forward, head, tail)[corner]
    start, end = points[np.where(along, low, high)], points[np.where(along, high, low)]
    two = count[bounds] == 2
    face1 = corner // 3
    face2 = np.where(two, order[np.minimum(first[bounds] + 1, len(order) - 1)] // 3, -1)
    normals, swap = normals_beside(points, faces, source, start, face1, face2)
    face1, face2 = np.where(swap, face2, face1), np.where(swap, face1, face2)
    beside = np.stack([index[face1], np.where(two, index[face2], -1)], axis=1)
    return Candidates(start, end, normals, bounds, beside)


def normals_beside(
    points: Reals, faces: Integers, source: Source, x: Reals, face1: Integers, face2: Integers
) -> tuple[Reals, np.ndarray]:
    """Normals (n, 2, 3) beside edges at x, the face towards the source first, and where face2 is that one."""
    corners = points[faces]
    area = areas(corners)
    unit = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)
    n1, n2 = facing(source, unit[face1], x), facing(source, unit[face2], x)
    two = face2 >= 0
    out1, out2 = _furthest(n2, corners[face1] - x[:, None]), _furthest(n1, corners[face2] - x[:, None])
    level1, level2 = edge_on(source, n1, x), edge_on(source, n2, x)
    # face2 is in front where it bulges out of the plane of face1 towards the source
    swap = two & np.where(level1, out1 < 0, out2 > 0)
    # an edge-on face's normal points away from the other face, a lone one's from the middle of the mesh
    inward = np.where(two, (out2 > 0) != swap, np.einsum("ij,ij->i", n1, x - points.mean(axis=0)) < 0)
    n1 = np.where((level1 & inward)[:, None], -n1, n1)
    n2 = np.where((two & level2 & ((out1 > 0) == swap))[:, None], -n2, n2)
    lit = np.where(swap[:, None], n2, n1)
    dark = np.where(two[:, None], -np.where(swap[:, None], n1, n2), 0.0)
    return np.stack([lit, dark], axis=1), swap


def _furthest(normals: Reals, corners: Reals) -> Reals:
    """Of corners (n, 3, 3) the height (n,) along normals that is the furthest from 0."""
    height = np.einsum("ij,ikj->ik", normals, corners)
    return np.take_along_axis(height, np.abs(height).argmax(axis=1)[:, None], axis=1)[:, 0]
