"""Whether points are hidden from a source, in Float64 and without ray offsets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from grimaldi.outlines.candidate import toward
from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.model import Body, Disk, Mesh, Source, Sphere

TOUCHING = 1e-9  # of the way to the source (of the scene's size for a plane wave): no nearer blocker counts
WIDE = 0.05  # view radius above which a triangle is held against every point


def view(source: Source, x: Reals) -> Reals:
    """Where points (..., 3) appear to the source: the unit direction, or the place across a plane wave's rays."""
    if source.position is not None:
        v = x - source.position
        return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)
    assert source.direction is not None
    return x - (x @ source.direction)[..., None] * source.direction


def overlaps(
    centres: Reals, radii: Reals, others: Reals, other_radius: float, wide: float
) -> tuple[Integers, Integers]:
    """Pairs (i, j) of balls `centres[i]`, `radii[i]` and points `others[j]` within radii[i] + other_radius."""
    tree = KDTree(others)
    small = np.flatnonzero(radii <= wide)
    found = tree.query_ball_point(centres[small], radii[small] + other_radius, return_sorted=False)
    lengths = np.fromiter((len(f) for f in found), np.int64, len(found))
    i = np.repeat(small, lengths)
    j = np.concatenate([np.asarray(f, np.int64) for f in found if f] or [np.empty(0, np.int64)])
    large = np.flatnonzero(radii > wide)
    return (
        np.concatenate([i, np.repeat(large, len(others))]),
        np.concatenate([j, np.tile(np.arange(len(others)), len(large))]),
    )


@dataclass(frozen=True, eq=False)
class Queries:
    """Points (n, 3), and for each the body and the two triangles of it that meet there and cannot hide it."""

    x: Reals
    body: Integers
    faces: Integers  # (n, 2)

    def __getitem__(self, which: NDArray[np.bool_] | Integers) -> Queries:
        return Queries(self.x[which], self.body[which], self.faces[which])


def hidden(bodies: tuple[Body, ...], source: Source, queries: Queries) -> NDArray[np.bool_]:
    """Whether something stands between each point and the source."""
    result = np.zeros(len(queries.x), bool)
    size = max((float(np.ptp(queries.x, axis=0).max()), 1e-300)) if len(queries.x) else 1.0
    least = TOUCHING * (size if source.is_plane else 1.0)
    for number, body in enumerate(bodies):
        rest = np.flatnonzero(~result)
        if not len(rest):
            break
        open_ = queries[rest]
        own = open_.body == number
        if isinstance(body.geometry, Mesh):
            result[rest] = _by_mesh(body.geometry, source, open_, own, least)
        else:
            other = rest[~own]
            x = queries.x[other]
            if isinstance(body.geometry, Sphere):
                result[other] = _by_sphere(body.geometry, source, x, least)
            else:
                result[other] = _by_disk(body.geometry, source, x, least)
    return result


def _between(source: Source, t: Reals, least: float) -> NDArray[np.bool_]:
    """Whether x + t·toward lies strictly between x and the source."""
    return (t > least) & (t < (np.inf if source.is_plane else 1.0))


def behind(body: Body, source: Source, queries: Queries) -> Reals:
    """How far behind each point, away from the source, its own body comes next [scene units]; inf where it does not."""
    result = np.full(len(queries.x), np.inf)
    if not isinstance(body.geometry, Mesh):
        return result
    own = np.ones(len(queries.x), bool)
    for point, t in _meetings(body.geometry, source, queries, own):
        away = t < -TOUCHING
        length = np.linalg.norm(toward(source, queries.x[point]), axis=1)
        np.minimum.at(result, point[away], (-t * length)[away])
    return result


def _by_mesh(mesh: Mesh, source: Source, queries: Queries, own: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    result = np.zeros(len(queries.x), bool)
    for point, t in _meetings(mesh, source, queries, own):
        result[point[_between(source, t, least)]] = True
    return result


def _meetings(mesh: Mesh, source: Source, queries: Queries, own: NDArray[np.bool_]) -> Iterator[tuple[Integers, Reals]]:
    """Where lines x + t·toward meet triangles, in parts: which query, and t. Triangles beside an edge do not count."""
    corners = mesh.vertices[mesh.faces]
    seen = view(source, corners)
    centres = seen.mean(axis=1)
    radii = np.linalg.norm(seen - centres[:, None], axis=2).max(axis=1)
    if source.is_plane:
        wide = WIDE * max(float(np.ptp(queries.x, axis=0).max()), 1e-300)
    else:
        wide = WIDE
        # a triangle near the source sags: its directions leave the chord's ball by less than its radius squared
        radii = np.where(radii > 0.8, np.inf, radii * (1 + radii))
    face, point = overlaps(centres, radii, view(source, queries.x), 1e-12, wide)
    beside = own[point] & (queries.faces[point] == face[:, None]).any(axis=1)
    face, point = face[~beside], point[~beside]
    for part in np.array_split(np.arange(len(face)), len(face) // 1_000_000 + 1):
        f, p = face[part], point[part]
        t = meeting(corners[f], queries.x[p], toward(source, queries.x[p]))
        met = np.isfinite(t)
        yield p[met], t[met]


def meeting(corners: Reals, x: Reals, w: Reals) -> Reals:
    """t where lines x + t w meet triangles (n, 3, 3), NaN where they miss; an edge belongs to both its triangles."""
    a, b, c = np.moveaxis(corners - x[:, None], 1, 0)
    bc, ca, ab = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    u, v, s = (np.einsum("ij,ij->i", w, n) for n in (bc, ca, ab))
    inside = ((u >= 0) & (v >= 0) & (s >= 0)) | ((u <= 0) & (v <= 0) & (s <= 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(inside, np.einsum("ij,ij->i", a, bc) / (u + v + s), np.nan)


def _by_sphere(sphere: Sphere, source: Source, x: Reals, least: float) -> NDArray[np.bool_]:
    w, d = toward(source, x), x - sphere.centre
    a, b, c = ((p * q).sum(1) for p, q in ((w, w), (w, d), (d, d)))
    root = b * b - a * (c - sphere.radius**2)
    reach = np.sqrt(np.maximum(root, 0))
    return (root > 0) & (_between(source, (-b - reach) / a, least) | _between(source, (-b + reach) / a, least))


def _by_disk(disk: Disk, source: Source, x: Reals, least: float) -> NDArray[np.bool_]:
    inverse = np.linalg.inv(disk.to_world)
    p = x @ inverse[:3, :3].T + inverse[:3, 3]
    w = toward(source, x) @ inverse[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -p[:, 2] / w[:, 2]
        at = p[:, :2] + t[:, None] * w[:, :2]
    return (w[:, 2] != 0) & ((at**2).sum(1) <= 1) & _between(source, t, least)
