"""The triangles of all meshes of a scene as one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.model import Integers, Reals
from grimaldi.parts import parts
from grimaldi.scene.model import Geometry, Mesh
from grimaldi.scene.triangles import merged_points

PART = 1 << 15  # triangles, or points, at once: what fits the cache

S = TypeVar("S")
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Soup:
    """Triangles of several bodies, whose vertices are merged by position within each body.

    Coordinates lie apart, (3, n), and corners too, (3, m): all that runs over every triangle is bound by memory.
    """

    points: Reals  # (3, n)
    corners: Integers  # (3, m) indices of points
    body: Integers  # (m,) of each triangle, rising
    first: Integers  # (bodies + 1,) each body's first triangle; as long as there are bodies, meshes or not

    @staticmethod
    def of(shapes: Sequence[Geometry]) -> Soup:
        """All triangles of the bodies that are meshes, in their order; shapes: each body's."""
        meshes = [(i, shape) for i, shape in enumerate(shapes) if isinstance(shape, Mesh)]
        n_points = [len(mesh.vertices) for _, mesh in meshes]
        n_faces = np.zeros(len(shapes), np.int64)
        n_faces[[i for i, _ in meshes]] = [len(mesh.faces) for _, mesh in meshes]
        offset = np.cumsum([0, *n_points])
        points = np.concatenate([np.empty((0, 3)), *(mesh.vertices for _, mesh in meshes)]).T + 0.0  # -0.0 becomes 0.0
        corners = np.empty((3, n_faces.sum()), np.int64)
        first = np.append(0, np.cumsum(n_faces))
        for (i, mesh), start in zip(meshes, offset[:-1], strict=True):
            np.add(mesh.faces.T, start, out=corners[:, first[i] : first[i + 1]])
        owner = np.repeat(np.array([i for i, _ in meshes], np.int64), n_points)
        kept, number = _merged(np.ascontiguousarray(points), owner, offset)
        if len(kept) < points.shape[1]:
            points, corners = points[:, kept], number[corners]
        return Soup(np.ascontiguousarray(points), corners, np.repeat(np.arange(len(shapes)), n_faces), first)

    def __len__(self) -> int:
        return self.corners.shape[1]

    def parts(self) -> Iterator[slice]:
        """All triangles, so many at once as fit the cache."""
        return parts(len(self), PART)

    def triangles(self, which: Integers) -> Reals:
        """Corners (3 coordinates, 3 corners, k) of some triangles."""
        return self.points.take(self.corners.take(which, axis=1), axis=1)

    @cached_property
    def has_corners(self) -> NDArray[np.bool_]:
        """Whether triangles (m,) join three different points."""
        a, b, c = self.corners
        return (a != b) & (b != c) & (c != a)

    @cached_property
    def at_border(self) -> NDArray[np.bool_]:
        """Whether points (n,) end an edge that is not shared by just two triangles of opposite winding."""
        n = self.points.shape[1]
        result = np.zeros(n, bool)

        def find(bounds: tuple[int, int]) -> None:
            begin, end = bounds
            corners = self.corners[:, begin:end]
            corners = corners[:, self.has_corners[begin:end]]
            ends = [(corners[i], corners[i - 2]) for i in range(3)]
            # an edge's key is even one way round and odd the other, next to it when sorted
            keys = np.sort(np.concatenate([(np.minimum(a, b) * n + np.maximum(a, b)) * 2 + (a > b) for a, b in ends]))
            first = np.flatnonzero(np.append(True, np.diff(keys >> 1) != 0)[: len(keys)])
            count = np.diff(np.append(first, len(keys)))
            pair = (count == 2) & (keys[np.minimum(first + 1, len(keys) - 1)] != keys[first])
            odd = keys[first[~pair]] >> 1
            result[odd // n] = True
            result[odd % n] = True

        by_threads(find, _parts(self.first))
        return result


def by_threads(do: Callable[[S], T], parts: Iterable[S]) -> list[T]:
    """What `do` makes of each part: NumPy lets threads run."""
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        return [*threads.map(do, parts)]


def _parts(first: Integers) -> Iterator[tuple[int, int]]:
    """Where parts of bodies begin and end, of some `PART` items each, given each body's first item and their number."""
    marks = np.searchsorted(first, np.arange(0, first[-1] + PART, PART))
    cuts = np.unique(np.append(first[np.minimum(marks, len(first) - 1)], first[-1]))
    return zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)


def _merged(points: Reals, owner: Integers, first: Integers) -> tuple[Integers, Integers]:
    """`merged_points` of bodies that begin at points `first`, in parts."""
    kept, number, count = [np.empty(0, np.int64)], np.empty(len(owner), np.int64), 0
    for begin, end in _parts(first):
        own, number[begin:end] = merged_points(np.ascontiguousarray(points[:, begin:end]), owner[begin:end])
        number[begin:end] += count
        kept.append(begin + own)
        count += len(own)
    return np.concatenate(kept), number


def grouped(numbers: Integers) -> Iterator[tuple[int, Integers]]:
    """Each number that occurs among numbers (n,), and where it does."""
    order = np.argsort(numbers, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(numbers[order]) != 0)[: len(order)])
    for begin, end in zip(first, np.append(first[1:], len(order)), strict=False):
        yield int(numbers[order[begin]]), order[begin:end]


def dot(p: Any, q: Any) -> Any:
    """Of vectors (3, n) by rows, which NumPy sums quicker so."""
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
