"""Loop's subdivision of triangle meshes, with borders.

C. Loop, "Smooth Subdivision Surfaces Based on Triangles", M.S. thesis, University of Utah, 1987, with the weights of
J. Warren (1995) at inner vertices: 3/16 for three neighbours, 3/8n for n. A border is a cubic B-spline by itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]


def subdivide(points: Reals, faces: Integers, levels: int) -> tuple[Reals, Integers]:
    """Points (n, 3) and faces (m, 3) after `levels` steps, the points moved to where they would end after infinitely
    many.

    Raises InputError where more than two faces share an edge, or a vertex is where borders meet.
    """
    for _ in range(levels):
        points, faces = _step(points, faces)
    return _limit(points, faces), faces


class _Neighbours:
    """A mesh's edges, and of each vertex the sum of its neighbours: along the border where it is on one."""

    def __init__(self, points: Reals, faces: Integers) -> None:
        sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
        self.ends, self.of_side, count = np.unique(
            np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        self.of_side = self.of_side.reshape(-1)
        if (count > 2).any():
            a, b = self.ends[count > 2][0]
            raise InputError(f"the edge between vertices {a} and {b} is shared by {count.max()} faces; subdivide none")
        self.border = count == 1
        n = len(points)
        on_border = np.bincount(self.ends[self.border].ravel(), minlength=n)
        if (on_border > 2).any():
            raise InputError(f"vertex {int(on_border.argmax())} lies where borders meet; part the surfaces there")
        self.at_border = on_border == 2
        count_all = np.bincount(self.ends.ravel(), minlength=n)
        self.valence = np.where(self.at_border, 2, count_all)
        used = self.ends[self.border | ~self.at_border[self.ends].any(axis=1)]
        mixed = self.ends[~self.border & self.at_border[self.ends].any(axis=1)]
        self.sum = np.zeros_like(points)
        np.add.at(self.sum, used[:, 0], points[used[:, 1]])
        np.add.at(self.sum, used[:, 1], points[used[:, 0]])
        for here, there in ((mixed[:, 0], mixed[:, 1]), (mixed[:, 1], mixed[:, 0])):
            inner = ~self.at_border[here]
            np.add.at(self.sum, here[inner], points[there[inner]])

    def beta(self) -> Reals:
        """Loop's weight of each neighbour of an inner vertex."""
        return np.where(self.valence == 3, 3 / 16, 3 / (8 * np.maximum(self.valence, 1)))

    def mixed(self, points: Reals, share: Reals) -> Reals:
        """Each vertex moved towards its neighbours, each of which gets the weight `share` (n,)."""
        return (1 - self.valence * share)[:, None] * points + share[:, None] * self.sum


def _step(points: Reals, faces: Integers) -> tuple[Reals, Integers]:
    around = _Neighbours(points, faces)
    even = around.mixed(points, np.where(around.at_border, 1 / 8, around.beta()))
    a, b = points[around.ends[:, 0]], points[around.ends[:, 1]]
    opposite = np.zeros_like(a)
    np.add.at(opposite, around.of_side, points[np.roll(faces, -2, axis=1).ravel()])
    odd = np.where(around.border[:, None], 0.5 * (a + b), 0.375 * (a + b) + 0.125 * opposite)
    ab, bc, ca = (len(points) + around.of_side.reshape(-1, 3)).T
    v0, v1, v2 = faces.T
    finer = np.stack([v0, ab, ca, ab, v1, bc, ca, bc, v2, ab, bc, ca], axis=1).reshape(-1, 3)
    return np.concatenate([even, odd]), finer


def _limit(points: Reals, faces: Integers) -> Reals:
    """The left eigenvectors of the step: 1/(n + 3/8β) for each neighbour inside, 1/6 on a border."""
    around = _Neighbours(points, faces)
    inner = 1 / (around.valence + 3 / (8 * around.beta()))
    return around.mixed(points, np.where(around.at_border, 1 / 6, inner))
