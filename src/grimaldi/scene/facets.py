"""Triangles side by side in one plane, put together into as few as their border needs.

What stops light and where its edges run stay the same within Float32's rounding, so that neither outlines nor rays
depend on how finely the flat parts of a body are meshed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grimaldi.scene.model import Facets, Mesh, Vector
from grimaldi.scene.triangles import areas, merged_points

FLAT = 2e-7  # of the coordinates: how far corners in Float32 lie off the plane or line that they were meant for
FEW = 16  # triangles in one plane, that are not worth putting together
WORTH = 4  # times fewer triangles than before, that are
NORMALS = 256  # steps of a unit vector, by which faces of one plane are told from those of curved surfaces

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


class _Sides(NamedTuple):
    """The sides of triangles, k of them: 3 f + i runs from corner i of face f to the next."""

    tail: Integers
    head: Integers
    facet: Integers  # a number of the plane part that its face lies in; of faces that stay as they are, one each
    group: Integers  # of sides that join the same corners
    twin: Integers  # the other side of an edge of two faces of opposite winding, else -1

    def of(self, which: Flags) -> _Sides:
        return _Sides(*(values[which] for values in self))


def facets(mesh: Mesh) -> Facets | None:
    """The mesh by its plane parts; None where that would not leave much fewer triangles."""
    if len(mesh.faces) < FEW * WORTH:
        return None
    area, normal = areas(*(mesh.vertices[mesh.faces[:, i]] for i in range(3)))
    if _is_curved(normal):
        return None
    x = mesh.vertices + 0.0  # -0.0 becomes 0.0
    kept, number = merged_points(np.ascontiguousarray(x.T), np.zeros(len(x), np.int64))
    x, corners = x[kept], number[mesh.faces]
    off = FLAT * (np.abs(x).max() + np.ptp(x, axis=0).max())
    sides, flat = _plane_parts(x, corners, area, normal, off)
    while np.count_nonzero(flat[sides.facet[::3]]) > (1 - 1 / WORTH) * len(corners):
        borders = _borders(x, sides, flat, off)
        inside, broken = _triangulated(x, corners, sides, borders, flat)
        if not len(broken):
            return _joined(x, corners, sides, flat, *inside)
        flat[broken] = False  # what lies beside them must keep its corners too
    return None


def _is_curved(normal: Vector) -> bool:
    """Whether there are too many directions of faces (m, 3) for much of them to be flat: a quick look."""
    step = np.round(NORMALS * (normal + 1)).astype(np.int64)
    return len(np.unique((step[:, 0] << 20) + (step[:, 1] << 10) + step[:, 2])) > len(normal) / WORTH


def _plane_parts(x: Vector, corners: Integers, area: Vector, unit: Vector, off: float) -> tuple[_Sides, Flags]:
    """The sides of triangles (m, 3), and of each facet whether it is one plane part of at least `FEW` of them.

    area, unit (m, 3) as in `areas`.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    m = len(corners)
    tail, head = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    group, twin = _paired(tail, head, len(x))
    one = np.flatnonzero(twin > np.arange(len(twin)))
    two = twin[one]
    f, g = one // 3, two // 3
    apex = corners[g, (two + 2) % 3]
    level = np.abs(np.einsum("ij,ij->i", x[apex] - x[corners[f, 0]], unit[f])) <= off
    level &= np.einsum("ij,ij->i", unit[f], unit[g]) > 0
    joins = coo_array((np.ones(level.sum(), bool), (f[level], g[level])), shape=(m, m))
    parts, part = connected_components(joins, directed=False)

    flat = _is_plane([x[corners[:, i]] for i in range(3)], area, unit, part, parts, off) & (np.bincount(part) >= FEW)
    alone = ~flat[part]
    part[alone] = parts + np.arange(np.count_nonzero(alone))  # no triangle of these is any other's business
    flat = np.append(flat, np.zeros(np.count_nonzero(alone), bool))
    return _Sides(tail, head, np.repeat(part, 3), group, twin), flat


def _paired(tail: Integers, head: Integers, n: int) -> tuple[Integers, Integers]:
    """`group` and `twin` of sides between n corners."""
    key = np.minimum(tail, head) * n + np.maximum(tail, head)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(key[order]) != 0))
    count = np.diff(np.append(first, len(key)))
    group, twin = np.empty(len(key), np.int64), np.full(len(key), -1)
    group[order] = np.repeat(np.arange(len(first)), count)
    one, two = order[first[count == 2]], order[first[count == 2] + 1]
    opposite = tail[one] == head[two]
    one, two = one[opposite], two[opposite]
    twin[one], twin[two] = two, one
    return group, twin


def _is_plane(own: list[Vector], area: Vector, unit: Vector, part: Integers, parts: int, off: float) -> Flags:
    """Whether parts of a surface are plane as wholes: one that curves little from face to face is not.

    own: the corners of its triangles (m, 3), three arrays.
    """
    normal = np.stack([np.bincount(part, column) for column in area.T], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    middle = np.stack([np.bincount(part, column) for column in np.sum(own, axis=0).T], axis=1)
    level = (normal * middle).sum(1) / (3 * np.bincount(part))
    height = np.max([np.abs((p * normal[part]).sum(1) - level[part]) for p in own], axis=0)
    most = np.zeros(parts)
    np.maximum.at(most, part, height)
    turned = np.bincount(part, (unit * normal[part]).sum(1) <= 0) > 0
    return (most <= off) & ~turned


def _borders(x: Vector, sides: _Sides, flat: Flags, off: float) -> tuple[Integers, Integers, Integers]:
    """The lines that bound plane parts: where each begins and ends, and the side that it begins with."""
    inner = (sides.twin >= 0) & flat[sides.facet] & (sides.facet == sides.facet[sides.twin])
    index = np.flatnonzero(~inner)
    outer = sides.of(~inner)
    passed, before, after = _in_line(x, outer, flat, off)
    own = flat[outer.facet]
    tail, head, index = outer.tail[own], outer.head[own], index[own]
    line = ~passed[tail]
    tail, head, index = tail[line], head[line], index[line]
    end = np.where(before[head] == tail, after[head], before[head])
    return tail, np.where(passed[head], end, head), index


def _in_line(x: Vector, outer: _Sides, flat: Flags, off: float) -> tuple[Flags, Integers, Integers]:
    """Corners that may be left out, since an edge between two plane parts only passes through them straight on.

    With the corners at both ends of that edge.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(x)
    order = np.argsort(outer.group, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(outer.group[order]) != 0)[: len(order)])
    count = np.diff(np.append(first, len(order)))
    one, two = order[first], order[np.minimum(first + 1, len(order) - 1)]
    a, b = outer.tail[one], outer.head[one]
    left, right = outer.facet[one], np.where(count == 2, outer.facet[two], -1)
    plain = flat[left] & ((count == 1) | ((count == 2) & (outer.twin[one] >= 0) & flat[right]))
    low, high = np.minimum(left, right), np.maximum(left, right)

    ends, other = np.append(a, b), np.append(b, a)
    pair = np.tile(np.stack([low, high], axis=1), (2, 1))
    odd = np.zeros(n, bool)
    odd[ends[~np.tile(plain, 2)]] = True
    order = np.argsort(ends, kind="stable")
    at = np.searchsorted(ends[order], np.arange(n))
    degree = np.bincount(ends, minlength=n)
    v = np.flatnonzero((degree == 2) & ~odd)
    p, q = order[at[v]], order[at[v] + 1]
    v, p, q = (values[(pair[p] == pair[q]).all(1)] for values in (v, p, q))
    before, after = np.full(n, -1), np.full(n, -1)
    before[v], after[v] = other[p], other[q]
    ahead = ((x[before[v]] - x[v]) * (x[after[v]] - x[v])).sum(1) < 0
    passed = np.zeros(n, bool)
    passed[v[ahead & (_distance(x[v], x[before[v]], x[after[v]]) <= off)]] = True

    # chains of such corners, each as a whole: a curve's corners are in line with their neighbours too
    both = passed[a] & passed[b]
    links = coo_array((np.ones(np.count_nonzero(both), bool), (a[both], b[both])), shape=(n, n))
    chains, chain = connected_components(links, directed=False)
    one = passed[ends] & ~passed[other]
    ends, other = ends[one], other[one]
    corner = np.full((chains, 2), -1)
    for way, index in enumerate((np.arange(len(ends)), np.arange(len(ends))[::-1])):
        corner[chain[ends[index]], way] = other[index]
    v = np.flatnonzero(passed)
    p, q = corner[chain[v]].T
    bent = (p < 0) | (p == q)
    bent |= _distance(x[v], x[p], x[q]) > off
    stay = np.zeros(chains, bool)
    stay[chain[v[bent]]] = True
    passed &= ~stay[chain]
    v = np.flatnonzero(passed)
    before[v], after[v] = corner[chain[v]].T
    return passed, before, after


def _distance(x: Vector, a: Vector, b: Vector) -> Vector:
    """Of points (n, 3) from the lines through a and b."""
    e = b - a
    e /= np.maximum(np.linalg.norm(e, axis=1, keepdims=True), 1e-300)
    return np.linalg.norm(np.cross(x - a, e), axis=1)


def _triangulated(
    x: Vector, corners: Integers, sides: _Sides, borders: tuple[Integers, Integers, Integers], flat: Flags
) -> tuple[tuple[Integers, Integers], list[int]]:
    """Triangles (m, 3) in the plane parts and the numbers of their edges, and the parts whose borders enclose none."""
    start, end, side = borders
    order = np.argsort(sides.facet[side], kind="stable")
    start, end, side = start[order], end[order], side[order]
    part, first = np.unique(sides.facet[side], return_index=True)
    last = np.append(first[1:], len(side))
    faces: list[Integers] = [np.empty((0, 3), np.int64)]
    edges: list[Integers] = [np.empty((0, 3), np.int64)]
    broken = []
    for facet, i, j in zip(part.tolist(), first, last, strict=True):
        own = corners[side[i:j] // 3]
        area, _ = areas(*(x[own[:, corner]] for corner in range(3)))
        found = _filled(x, start[i:j], end[i:j], area.sum(0))
        if found is None:
            broken.append(facet)
            continue
        names = dict(zip(zip(start[i:j].tolist(), end[i:j].tolist(), strict=True), side[i:j].tolist(), strict=True))
        faces.append(found)
        ways = np.stack([found, np.roll(found, -1, axis=1)], axis=2).reshape(-1, 2).tolist()
        edges.append(np.array([names.get((a, b), side[i]) for a, b in ways], np.int64).reshape(-1, 3))
    return (np.concatenate(faces), np.concatenate(edges)), broken


def _filled(x: Vector, start: Integers, end: Integers, normal: Vector) -> Integers | None:
    """Triangles (m, 3) within the loops of edges start→end, which run counter-clockwise about the normal."""
    import shapely

    after = dict(zip(start.tolist(), end.tolist(), strict=True))
    if len(after) < len(start) or set(after.values()) != set(after):
        return None  # loops that touch at a corner
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    v = np.cross(normal, u)
    at = x @ np.stack([u / np.linalg.norm(u), v / np.linalg.norm(v)], axis=1)
    loops = []
    while after:
        loop = [next(iter(after))]
        while (following := after.pop(loop[-1])) != loop[0]:
            loop.append(following)
        loops.append(loop)
    if min(map(len, loops)) < 3:
        return None
    rings = [shapely.LinearRing(at[loop]) for loop in loops]
    shells = [i for i, ring in enumerate(rings) if ring.is_ccw]
    if len(shells) != 1:
        return None
    polygon = shapely.Polygon(rings[shells[0]], [ring for i, ring in enumerate(rings) if i != shells[0]])
    if not polygon.is_valid:
        return None
    cut = shapely.constrained_delaunay_triangles(polygon)
    places = shapely.get_coordinates(cut).reshape(-1, 4, 2)[:, :3]
    (ux, uy), (vx, vy) = (places[:, 1] - places[:, 0]).T, (places[:, 2] - places[:, 0]).T
    turned = ux * vy < uy * vx
    places[turned] = places[turned, ::-1]
    number = {tuple(at[i].tolist()): i for loop in loops for i in loop}
    return np.array([[number[tuple(place)] for place in three] for three in places.tolist()], np.int64)


def _joined(
    x: Vector, corners: Integers, sides: _Sides, flat: Flags, faces: Integers, edges: Integers
) -> Facets | None:
    """The triangles of plane parts and those that stayed as they are."""
    stay = np.flatnonzero(~flat[sides.facet[::3]])
    if len(stay) + len(faces) > len(corners) / WORTH:
        return None
    faces = np.concatenate([faces, corners[stay]])
    used, index = np.unique(faces, return_inverse=True)
    return Facets(x[used], index.reshape(-1, 3), np.concatenate([edges, 3 * stay[:, None] + np.arange(3)]))
