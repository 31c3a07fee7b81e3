"""Edges that may bound a body's light, before it is known which parts of them the source reaches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.model import Source

FINEST = 65536  # segments of a curve
EDGE_ON = 1e-6  # rad: what Float32 vertices leave open of a face's direction


@dataclass(frozen=True, eq=False)
class Candidates:
    """Straight edges, n of them, oriented as in `Outline`."""

    start: Reals  # (n, 3)
    end: Reals  # (n, 3)
    normals: Reals  # (n, 2, 3), as in `Outline`
    edge: Integers  # (n,) as in `Outline`
    faces: Integers  # (n, 2) triangles (`Soup`) beside the edge: they cannot hide it; -1 where there is none

    @staticmethod
    def empty() -> Candidates:
        """No edge."""
        points, none = np.empty((0, 3)), np.empty(0, np.int64)
        return Candidates(points, points, np.empty((0, 2, 3)), none, np.empty((0, 2), np.int64))

    @staticmethod
    def concatenate(parts: Sequence[Candidates]) -> Candidates:
        return Candidates(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Candidates)))

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, which: NDArray[np.bool_] | Integers) -> Candidates:
        return Candidates(*(getattr(self, f.name)[which] for f in fields(Candidates)))

    def at(self, which: Integers, t: Reals) -> Reals:
        """Points (k, 3) at parameters t (k,) of edges `which`."""
        start = self.start[which]
        return start + t[:, None] * (self.end[which] - start)


def toward(source: Source, x: Reals) -> Reals:
    """From points x (n, 3) to the source: S - x for a point, the unit vector -d for a plane wave."""
    if source.position is not None:
        return source.position - x
    assert source.direction is not None
    return np.broadcast_to(-source.direction, x.shape)


def facing(source: Source, normals: Reals, x: Reals) -> Reals:
    """Normals (n, 3) at x turned towards the source."""
    away = np.einsum("ij,ij->i", normals, toward(source, x)) < 0
    return np.where(away[:, None], -normals, normals)


def edge_on(source: Source, normals: Reals, x: Reals) -> NDArray[np.bool_]:
    """Whether faces with normals (n, 3) at x hold their rays from the source, as far as Float32 tells."""
    w = toward(source, x)
    along = np.einsum("ij,ij->i", normals, w)
    return np.abs(along) <= EDGE_ON * np.linalg.norm(normals, axis=1) * np.linalg.norm(w, axis=1)


def closed_curve(points: Reals, normals: Reals) -> Candidates:
    """The loop through points (n, 3) of a smooth shape, one pair of normals (n, 2, 3) to each segment."""
    none = np.full(len(points), -1)
    return Candidates(points, np.roll(points, -1, axis=0), normals, none, np.full((len(points), 2), -1))


def segments_for(radius: float, sag: float) -> int:
    """How many segments keep a circle's polygon within `sag` of it, sag = r π²/2n², at most `FINEST`."""
    return int(np.clip(np.ceil(np.pi * np.sqrt(radius / (2 * sag))), 16, FINEST))


def least_sag(radius: float) -> float:
    """The sag of a circle's finest polygon."""
    return radius * np.pi**2 / (2 * FINEST**2)


def polygon(n: int) -> Reals:
    """Corners (n, 2) of the regular polygon with the unit circle's area, whose mean distance from it vanishes."""
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    radius = np.sqrt(2 * np.pi / n / np.sin(2 * np.pi / n))
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
