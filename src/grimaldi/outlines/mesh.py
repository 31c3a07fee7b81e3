"""Silhouette and border edges of a triangle mesh as a source sees them.

An edge bounds the light exactly where all its triangles lie on one side of it in the source's view: so borders of
open meshes count, edges between coplanar faces do not, and neither winding nor the number of triangles at an edge
matters. Each triangle's side is decided once: the edges of a closed mesh form closed loops.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.candidate import EDGE_ON, Candidates, edge_on, facing
from grimaldi.outlines.model import Integers, Reals
from grimaldi.outlines.soup import Soup, by_threads, dot
from grimaldi.scene.model import Source
from grimaldi.scene.triangles import areas


def sides(soup: Soup, source: Source) -> NDArray[np.int8]:
    """±1: whether triangles (m,) turn counter-clockwise along the rays of the source; 0 if their body stops no ray.

    Edge-on ones turn as they would for the source a little nearer to the common middle of their body: winding does
    not matter, and a box in light along its walls is bounded by the border of its front. A body all of whose
    triangles are edge-on, a sheet in the plane of its rays, stops none.
    """
    side, level = np.empty(len(soup), np.int8), np.empty(len(soup), bool)
    for part in soup.parts():
        a, area = _areas(soup, part)
        if source.position is not None:
            w = [s - x for s, x in zip(source.position, a, strict=True)]
        else:
            assert source.direction is not None
            w = [-d for d in source.direction]
        along, area2, w2 = dot(area, w), dot(area, area), dot(w, w)
        side[part] = np.where(along > 0, -1, 1)
        level[part] = along * along <= EDGE_ON**2 * area2 * w2
    some = np.flatnonzero(level)
    if len(some):
        a, area = _areas(soup, some)
        middle = _middles(soup, soup.body[some])
        side[some] = np.where(dot(area, a - middle) < 0, -1, 1)
        standing = np.zeros(len(soup.first) - 1, bool)
        standing[soup.body[~level]] = True
        side[~standing[soup.body]] = 0
    return side


def _areas(soup: Soup, which: slice | Integers) -> tuple[Reals, Reals]:
    """First corners (3, m) and twice the area vectors (3, m) of triangles."""
    a, b, c = (soup.points.take(corners[which], axis=1) for corners in soup.corners)
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    return a, np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])


def _middles(soup: Soup, body: Integers) -> Reals:
    """The mean (3, n) of all corners of bodies (n,)."""
    bodies, of = np.unique(body, return_inverse=True)
    means = [soup.triangles(np.arange(*soup.first[[i, i + 1]].tolist())).mean(axis=(1, 2)) for i in bodies]
    return np.array(means).reshape(-1, 3).T[:, of]


def silhouettes(soup: Soup, source: Source) -> tuple[Candidates, Integers]:
    """All edges of meshes that bound their light, folds and borders of open meshes, and the body (n,) of each.

    The first normal of a fold is that of the face towards the source, turned to it; the second one's face lies
    behind and its normal points away, so that the body is behind both. A border has one normal.
    """
    side = np.where(soup.has_corners, sides(soup, source), 0)
    n = soup.points.shape[1]
    # a fold's ends have triangles of both sides, a border's are told by `at_border`: few edges of a fine mesh do
    turned = np.zeros((2, n), bool)

    def mark(part: slice) -> None:
        for way, sign in enumerate((1, -1)):
            turned[way, soup.corners[:, part][:, side[part] == sign].ravel()] = True

    by_threads(mark, soup.parts())
    marked = (turned[0] & turned[1]) | soup.at_border

    def some(part: slice) -> tuple[Integers, Integers]:
        at_ends = marked[soup.corners[:, part]] & (side[part] != 0)
        face, corner = np.nonzero((at_ends & np.roll(at_ends, -1, axis=0)).T)
        return part.start + face, corner

    none = np.empty(0, np.int64)
    face, corner = (
        np.concatenate([none, *parts]) for parts in zip((none, none), *by_threads(some, soup.parts()), strict=True)
    )
    tail, head = soup.corners[corner, face], soup.corners[(corner + 1) % 3, face]

    forward = tail < head
    key = np.where(forward, tail, head) * n + np.where(forward, head, tail)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(key[order]) != 0)[: len(key)])
    count = np.diff(np.append(first, len(key)))
    turn = np.where(forward, 1, -1) * side[face]
    total = np.add.reduceat(turn[order], first) if len(first) else first
    bounds = np.flatnonzero(np.abs(total) == count)
    bounds = bounds[np.argsort(order[first[bounds]])]  # as the mesh has them

    one = order[first[bounds]]
    two = order[np.minimum(first[bounds] + 1, max(len(order) - 1, 0))]
    face1, face2 = face[one], np.where(count[bounds] == 2, face[two], -1)
    along = side[face1] > 0
    start, end = (soup.points[:, np.where(along, *ends)].T for ends in ((tail[one], head[one]), (head[one], tail[one])))
    normals, swap = normals_beside(soup, source, start, face1, face2)
    body = soup.body[face1]
    edge = 3 * (face1 - soup.first[body]) + corner[one]
    face1, face2 = np.where(swap, face2, face1), np.where(swap, face1, face2)
    beside = np.stack([face1, face2], axis=1)
    return Candidates(start, end, normals, edge, beside), body


def normals_beside(
    soup: Soup, source: Source, x: Reals, face1: Integers, face2: Integers
) -> tuple[Reals, NDArray[np.bool_]]:
    """Normals (n, 2, 3) beside edges at x, the face towards the source first, and where face2 is that one.

    face1, face2 (n,): triangles of the soup that meet at the edges; face2 is -1 where there is one only.
    """
    corners1, corners2 = soup.triangles(face1).T, soup.triangles(face2).T
    n1, n2 = (facing(source, areas(*np.moveaxis(c, 1, 0))[1], x) for c in (corners1, corners2))
    two = face2 >= 0
    out1, out2 = _furthest(n2, corners1 - x[:, None]), _furthest(n1, corners2 - x[:, None])
    level1, level2 = edge_on(source, n1, x), edge_on(source, n2, x)
    # face2 is in front where it bulges out of the plane of face1 towards the source
    swap = two & np.where(level1, out1 < 0, out2 > 0)
    # an edge-on face's normal points away from the other face, a lone one's from the middle of the mesh
    inward = (out2 > 0) != swap
    if (lone := level1 & ~two).any():
        middle = _middles(soup, soup.body[face1[lone]]).T
        inward[lone] = np.einsum("ij,ij->i", n1[lone], x[lone] - middle) < 0
    n1 = np.where((level1 & inward)[:, None], -n1, n1)
    n2 = np.where((two & level2 & ((out1 > 0) == swap))[:, None], -n2, n2)
    lit = np.where(swap[:, None], n2, n1)
    dark = np.where(two[:, None], -np.where(swap[:, None], n1, n2), 0.0)
    return np.stack([lit, dark], axis=1), swap


def _furthest(normals: Reals, corners: Reals) -> Reals:
    """Of corners (n, 3, 3) the height (n,) along normals that is the furthest from 0."""
    height = np.einsum("ij,ikj->ik", normals, corners)
    return np.take_along_axis(height, np.abs(height).argmax(axis=1)[:, None], axis=1)[:, 0]
