"""Whether points on edges are hidden from a source, in Float64 and without ray offsets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.candidate import Candidates, toward
from grimaldi.outlines.model import Integers, Reals
from grimaldi.outlines.pieces import Pieces
from grimaldi.outlines.soup import Soup, by_threads, dot, grouped
from grimaldi.outlines.view import View
from grimaldi.scene.bodies import vertices
from grimaldi.scene.model import Body, Cylinder, Disk, Mesh, Source, Sphere

TOUCHING = 1e-9  # of the way to the source (of the edges' extent for a plane wave): no nearer blocker counts
PAIRS = 1 << 14  # of a point and what may hide it at once: what fits the cache


@dataclass(frozen=True, eq=False)
class Sight:
    """Edges, and for each piece of them all that may lie before or behind it in the source's view.

    These are triangles of the soup, and after them, from len(soup) on, bodies that are no meshes.
    """

    source: Source
    bodies: Sequence[Body]
    soup: Soup
    edges: Candidates
    body: Integers  # (n,) whose edges they are
    pieces: Pieces
    first: Integers  # (pieces + 1,) each piece's part of `found`
    found: Integers
    least: float  # how far before a point, in its ways to the source, a blocker has to be

    @staticmethod
    def of(bodies: Sequence[Body], soup: Soup, view: View, edges: Candidates, body: Integers, pieces: Pieces) -> Sight:
        """Gather what overlaps each piece in view. Triangles beside an edge do not count for it."""
        pairs = [*_triangles(soup, view, edges, pieces), _shapes(bodies, len(soup), view, pieces)]
        piece, found = (np.concatenate(x) for x in zip(*pairs, strict=True))
        order = np.argsort(piece, kind="stable")
        first = np.append(0, np.cumsum(np.bincount(piece, minlength=len(pieces))))
        size = max(float(np.ptp(edges.start, axis=0).max(initial=0.0)), 1e-300)
        least = TOUCHING * (size if view.source.is_plane else 1.0)
        return Sight(view.source, bodies, soup, edges, body, pieces, first, found[order], least)

    def _pairs(self, edge: Integers, t: Reals) -> Iterator[tuple[Integers, Integers]]:
        """Which of the points at parameters t of edges may meet what, in parts; all of a point lie in one part."""
        piece = self.pieces.holding(edge, t)
        count = self.first[piece + 1] - self.first[piece]
        some = np.flatnonzero(count)
        total = np.cumsum(count[some])
        cuts = np.searchsorted(total, np.arange(PAIRS, total[-1] if len(total) else 0, PAIRS))
        for part in np.split(some, np.unique(cuts)):
            n = count[part]
            query = np.repeat(part, n)
            begin = np.repeat(self.first[piece[part]] - (np.cumsum(n) - n), n)
            yield query, self.found[begin + np.arange(len(query))]

    def hidden(self, edge: Integers, t: Reals) -> NDArray[np.bool_]:
        """Whether something stands between points at parameters t (k,) of edges (k,) and the source."""
        result = np.zeros(len(edge), bool)
        most = np.inf if self.source.is_plane else 1.0
        x = self.edges.at(edge, t)
        for query, found in self._pairs(edge, t):
            for hit, place in self._meetings(x[query], self.body[edge[query]], found):
                result[query[hit[(place > self.least) & (place < most)]]] = True
        return result

    def behind(self, edge: Integers, t: Reals, x: Reals) -> Reals:
        """How far behind points x (k, 3) beside edges, at parameters t, their own body comes next; inf where not."""
        result = np.full(len(edge), np.inf)
        owner = np.concatenate([self.soup.body, np.arange(len(self.bodies))])
        for query, found in self._pairs(edge, t):
            own = owner[found] == self.body[edge[query]]
            query, found = query[own], found[own]
            for hit, place in self._meetings(x[query], self.body[edge[query]], found):
                away = place < -TOUCHING
                at = query[hit[away]]
                length = np.linalg.norm(toward(self.source, x[at]), axis=1)
                np.minimum.at(result, at, -place[away] * length)
        return result

    def _meetings(self, x: Reals, body: Integers, found: Integers) -> Iterator[tuple[Integers, Reals]]:
        """Where lines x + t·toward meet what was found: which pair, and t.

        Lines that touch a body's own outline never meet its disc or sphere again, and its tube once.
        """
        flat = np.flatnonzero(found < len(self.soup))
        t = meeting(self.soup.triangles(found[flat]), x[flat], toward(self.source, x[flat]))
        met = np.isfinite(t)
        yield flat[met], t[met]
        rest = np.flatnonzero(found >= len(self.soup))
        for i, which in grouped(found[rest] - len(self.soup)):
            pair = rest[which]
            shape, own = self.bodies[i].geometry, body[pair] == i
            if isinstance(shape, Cylinder):
                places = _on_tube(shape, self.source, x[pair], own)
            elif isinstance(shape, Sphere):
                places = _on_sphere(shape, self.source, x[pair], own)
            else:
                assert isinstance(shape, Disk)
                places = (_on_disk(shape, self.source, x[pair], own),)
            for t in places:
                met = np.isfinite(t)
                yield pair[met], t[met]


def _triangles(soup: Soup, view: View, edges: Candidates, pieces: Pieces) -> list[tuple[Integers, Integers]]:
    """Pairs (piece, triangle) that overlap in view, in parts."""
    seen = view(soup.points)

    def pairs(part: slice) -> tuple[Integers, Integers]:
        corners = [seen.take(c, axis=1) for c in soup.corners[:, part]]
        triangle, piece = pieces.index.overlapping(*view.boxes(*corners))
        edge, number = pieces.edge[piece], part.start + triangle
        beside = (edges.faces[edge, 0] == number) | (edges.faces[edge, 1] == number)
        kept = ~beside & pieces.may_be_met(piece, [c.take(triangle, axis=1) for c in corners])
        return piece[kept], number[kept]

    return by_threads(pairs, soup.parts())


def _shapes(bodies: Sequence[Body], offset: int, view: View, pieces: Pieces) -> tuple[Integers, Integers]:
    """Pairs (piece, offset + body) of bodies that are no meshes and overlap in view."""
    number = np.array([i for i, body in enumerate(bodies) if not isinstance(body.geometry, Mesh)], np.int64)
    if not len(number):
        return number, number
    corners = [vertices(bodies[i].geometry) for i in number]
    sizes = np.array([len(x) for x in corners])
    boxes = np.empty((2, 3, len(number)))
    for size, of in grouped(sizes):
        boxes[:, :, of] = view.boxes(*(view(np.array([corners[i][k] for i in of]).T) for k in range(size)))
    shape, piece = pieces.index.overlapping(*boxes)
    return piece, offset + number[shape]


def meeting(corners: Reals, x: Reals, w: Reals) -> Reals:
    """t where lines x + t w meet triangles (3 coordinates, 3 corners, n), NaN where they miss.

    x, w (n, 3). An edge belongs to both its triangles.
    """
    a, b, c = (corners - x.T[:, None]).swapaxes(0, 1)
    bc, ca, ab = _cross(b, c), _cross(c, a), _cross(a, b)
    d = np.ascontiguousarray(w.T)
    u, v, s = dot(d, bc), dot(d, ca), dot(d, ab)
    inside = ((u >= 0) & (v >= 0) & (s >= 0)) | ((u <= 0) & (v <= 0) & (s <= 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(inside, dot(a, bc) / (u + v + s), np.nan)


def _cross(p: Reals, q: Reals) -> Reals:
    return np.stack([p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]])


def _on_sphere(sphere: Sphere, source: Source, x: Reals, own: NDArray[np.bool_]) -> tuple[Reals, Reals]:
    """Both t where x + t·toward meets a sphere, NaN where it does not or only touches."""
    w, d = toward(source, x), x - sphere.centre
    a, b, c = ((p * q).sum(1) for p, q in ((w, w), (w, d), (d, d)))
    root = np.where(own, -1.0, b * b - a * (c - sphere.radius**2))
    reach = np.where(root > 0, np.sqrt(np.maximum(root, 0)), np.nan)
    return (-b - reach) / a, (-b + reach) / a


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


def _on_disk(disk: Disk, source: Source, x: Reals, own: NDArray[np.bool_]) -> Reals:
    """t where x + t·toward meets a disc, NaN where it does not."""
    inverse = np.linalg.inv(disk.to_world)
    p = x @ inverse[:3, :3].T + inverse[:3, 3]
    w = toward(source, x) @ inverse[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -p[:, 2] / w[:, 2]
        at = p[:, :2] + t[:, None] * w[:, :2]
        return np.where((w[:, 2] != 0) & ((at**2).sum(1) <= 1) & ~own, t, np.nan)
