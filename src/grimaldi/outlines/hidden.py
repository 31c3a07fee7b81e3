"""Whether points are hidden from a source, in Float64 and without ray offsets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from grimaldi.outlines.candidate import toward
from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.model import Body, Cylinder, Disk, Mesh, Source, Sphere

TOUCHING = 1e-9  # of the way to the source (of the scene's size for a plane wave): no nearer blocker counts
WIDE = 0.05  # view radius above which a triangle is held against every point
PART = 1024  # points held against triangles at once


def view(source: Source, x: Reals) -> Reals:
    """Where points (..., 3) appear to the source: the unit direction, or the place across a plane wave's rays."""
    if source.position is not None:
        v = x - source.position
        return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)
    assert source.direction is not None
    return x - (x @ source.direction)[..., None] * source.direction


class Balls:
    """Balls in a source's view, found by the points they hold: small ones through a tree, wide ones always."""

    def __init__(self, centres: Reals, radii: Reals, wide: float) -> None:
        self.centres, self.radii = centres, radii
        self.small, self.large = np.flatnonzero(radii <= wide), np.flatnonzero(radii > wide)
        self.widest = float(radii[self.small].max(initial=0.0))
        self.tree = KDTree(centres[self.small])

    def holding(self, points: Reals, margin: float = 0.0) -> tuple[Integers, Integers]:
        """Pairs (ball, point) of points (n, 3) within `margin` of the balls."""
        found = self.tree.query_ball_point(points, self.widest + margin, return_sorted=False)
        lengths = np.fromiter(map(len, found), np.int64, len(found))
        point = np.repeat(np.arange(len(points)), lengths)
        parts = [np.asarray(f, np.int64) for f in found if f]
        ball = self.small[np.concatenate(parts)] if parts else np.empty(0, np.int64)
        near = np.linalg.norm(points[point] - self.centres[ball], axis=1) <= self.radii[ball] + margin
        return (
            np.concatenate([ball[near], np.repeat(self.large, len(points))]),
            np.concatenate([point[near], np.tile(np.arange(len(points)), len(self.large))]),
        )


@dataclass(frozen=True, eq=False)
class Triangles:
    """A mesh as a source sees it: corners (m, 3, 3) in space, and the balls that hold them in view."""

    corners: Reals
    balls: Balls


Obstacle = Triangles | Sphere | Disk | Cylinder


def obstacles(bodies: tuple[Body, ...], source: Source) -> tuple[Obstacle, ...]:
    """Bodies prepared for `hidden` and `behind`."""
    return tuple(_triangles(b.geometry, source) if isinstance(b.geometry, Mesh) else b.geometry for b in bodies)


def _triangles(mesh: Mesh, source: Source) -> Triangles:
    corners = mesh.vertices[mesh.faces]
    seen = view(source, corners)
    centres = seen.mean(axis=1)
    radii = np.linalg.norm(seen - centres[:, None], axis=2).max(axis=1)
    if source.is_plane:
        wide = WIDE * float(np.ptp(seen, axis=(0, 1)).max())
    else:
        wide = WIDE
        # a triangle near the source sags: its directions leave the chord's ball by less than its radius squared
        radii = np.where(radii > 0.8, np.inf, radii * (1 + radii))
    # few triangles much larger than most would make the tree's search wide for all
    wide = min(wide, 8 * float(np.median(radii)))
    return Triangles(corners, Balls(centres, radii * (1 + 1e-9) + 1e-12, wide))


@dataclass(frozen=True, eq=False)
class Queries:
    """Points (n, 3), and for each the body and the two triangles of it that meet there and cannot hide it."""

    x: Reals
    body: Integers
    faces: Integers  # (n, 2)

    def __getitem__(self, which: NDArray[np.bool_] | Integers) -> Queries:
        return Queries(self.x[which], self.body[which], self.faces[which])


def hidden(obstacles: tuple[Obstacle, ...], source: Source, queries: Queries) -> NDArray[np.bool_]:
    """Whether something stands between each point and the source."""
    result = np.zeros(len(queries.x), bool)
    size = max((float(np.ptp(queries.x, axis=0).max()), 1e-300)) if len(queries.x) else 1.0
    least = TOUCHING * (size if source.is_plane else 1.0)
    for number, obstacle in enumerate(obstacles):
        rest = np.flatnonzero(~result)
        if not len(rest):
            break
        open_ = queries[rest]
        own = open_.body == number
        if isinstance(obstacle, Triangles):
            for point, t in _meetings(obstacle, source, open_, own):
                result[rest[point[_between(source, t, least)]]] = True
        elif isinstance(obstacle, Cylinder):
            for t in _on_tube(obstacle, source, open_.x, own):
                result[rest[_between(source, t, least)]] = True
        else:
            other = rest[~own]
            x = queries.x[other]
            if isinstance(obstacle, Sphere):
                result[other] = _by_sphere(obstacle, source, x, least)
            else:
                result[other] = _by_disk(obstacle, source, x, least)
    return result


def _between(source: Source, t: Reals, least: float) -> NDArray[np.bool_]:
    """Whether x + t·toward lies strictly between x and the source."""
    return (t > least) & (t < (np.inf if source.is_plane else 1.0))


def behind(obstacle: Obstacle, source: Source, queries: Queries) -> Reals:
    """How far behind each point, away from the source, its own body comes next [scene units]; inf where it does not."""
    result = np.full(len(queries.x), np.inf)
    own = np.ones(len(queries.x), bool)
    for point, t in _own_meetings(obstacle, source, queries, own):
        away = t < -TOUCHING
        length = np.linalg.norm(toward(source, queries.x[point]), axis=1)
        np.minimum.at(result, point[away], (-t * length)[away])
    return result


def _own_meetings(
    obstacle: Obstacle, source: Source, queries: Queries, own: NDArray[np.bool_]
) -> Iterator[tuple[Integers, Reals]]:
    """Where lines that touch a body's outline meet it again, as `_meetings`; spheres and discs never."""
    if isinstance(obstacle, Triangles):
        yield from _meetings(obstacle, source, queries, own)
    elif isinstance(obstacle, Cylinder):
        for t in _on_tube(obstacle, source, queries.x, own):
            met = np.flatnonzero(np.isfinite(t))
            yield met, t[met]


def _meetings(
    mesh: Triangles, source: Source, queries: Queries, own: NDArray[np.bool_]
) -> Iterator[tuple[Integers, Reals]]:
    """Where lines x + t·toward meet triangles, in parts: which query, and t. Triangles beside an edge do not count."""
    for first in range(0, len(queries.x), PART):
        part = slice(first, first + PART)
        face, point = mesh.balls.holding(view(source, queries.x[part]))
        point += first
        beside = own[point] & (queries.faces[point] == face[:, None]).any(axis=1)
        face, point = face[~beside], point[~beside]
        t = meeting(mesh.corners[face], queries.x[point], toward(source, queries.x[point]))
        met = np.isfinite(t)
        yield point[met], t[met]


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


def _on_tube(tube: Cylinder, source: Source, x: Reals, own: NDArray[np.bool_]) -> tuple[Reals, Reals]:
    """Both t where x + t·toward meets a tube's wall, NaN where it does not; from its own points only the other one."""
    inverse = np.linalg.inv(tube.to_world)
    p = x @ inverse[:3, :3].T + inverse[:3, 3]
    w = toward(source, x) @ inverse[:3, :3].T
    across = np.linalg.norm(p[:, :2], axis=1)
    round_ = np.where(own[:, None], p[:, :2] / np.maximum(across, 1e-300)[:, None], p[:, :2])
    a, b = (w[:, :2] ** 2).sum(1), (round_ * w[:, :2]).sum(1)
    c = np.where(own, 0.0, across**2 - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        # the roots' stable form: their sum and their product
        far = -(b + np.copysign(np.sqrt(b * b - a * c), b))
        roots = far / a, np.where(own, np.nan, c / far)
        heights = (p[:, 2] + t * w[:, 2] for t in roots)
        first, second = (np.where((z >= 0) & (z <= 1), t, np.nan) for t, z in zip(roots, heights, strict=True))
    return first, second


def _by_disk(disk: Disk, source: Source, x: Reals, least: float) -> NDArray[np.bool_]:
    inverse = np.linalg.inv(disk.to_world)
    p = x @ inverse[:3, :3].T + inverse[:3, 3]
    w = toward(source, x) @ inverse[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -p[:, 2] / w[:, 2]
        at = p[:, :2] + t[:, None] * w[:, :2]
    return (w[:, 2] != 0) & ((at**2).sum(1) <= 1) & _between(source, t, least)
