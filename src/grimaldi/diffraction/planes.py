"""Planes of points parallel to a screen of holes, and what the kernel factored over one of them leaves out of M.

Symbols as in `fresnel_plane`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from grimaldi.diffraction.lattice import Lattice, lattice, rounding
from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.model import Scene, Source, Vector

PLANES = 16  # so many planes of points are worth a transform each
STEEPEST = 0.25  # offset across the normal over distance along it, up to which the bounds are meant to hold


@dataclass(frozen=True, eq=False)
class Screen:
    """The holes of a scene as one source lights them; `axes` (2, 3) and `normal` (3,) are an orthonormal frame."""

    source: Source
    k: float
    axes: Reals
    normal: Vector  # away from the source
    x0: Vector  # (3,)
    a: float  # how far the holes reach from x0

    @property
    def h1(self) -> float:
        """From the source to the screen, along the normal."""
        return math.inf if self.source.position is None else float((self.x0 - self.source.position) @ self.normal)

    @property
    def tilt(self) -> float:
        """The largest tangent of the angle between normal and ray, over the holes."""
        if self.source.position is None:
            d = np.asarray(self.source.direction)
            return float(np.linalg.norm(self.axes @ d) / (d @ self.normal))
        return (self.a + float(np.linalg.norm(self.axes @ (self.source.position - self.x0)))) / self.h1

    @staticmethod
    def of(scene: Scene, source: Source, k: float) -> Screen:
        loops = np.concatenate([loop for shape in scene.screen for loop in shape.world_loops()])
        x0 = 0.5 * (loops.min(0) + loops.max(0))
        normal = scene.screen[0].normal
        ray = source.direction if source.position is None else x0 - source.position
        assert ray is not None
        normal = normal * np.sign(ray @ normal)
        axes = np.linalg.svd(normal[None])[2][1:]
        reach = float(np.linalg.norm(loops - x0, axis=1).max())
        return Screen(source, k, axes, normal, x0, 1.0001 * reach)  # an ellipse exceeds its polygon by 8e-5


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane of points parallel to the screen, or their `lattice`."""

    screen: Screen
    p0: Vector  # (3,)
    b: float  # how far the points reach from p0
    off: tuple[float, float]  # how far they may lie off the lattice in the plane, and off the plane
    lattice: Lattice | None

    @property
    def h2(self) -> float:
        """From the screen to the points."""
        return float((self.p0 - self.screen.x0) @ self.screen.normal)

    @cached_property
    def across(self) -> Vector:
        """(2,) p0 - x0 along the screen."""
        return self.screen.axes @ (self.p0 - self.screen.x0)

    @property
    def B(self) -> Reals:
        """(2, 2) of the module's equation."""
        s0 = math.hypot(self.h2, *self.across)
        return (np.eye(2) - np.outer(self.across, self.across) / s0**2) / s0

    @property
    def curvature(self) -> float:
        """1/L = 1/h1 + 1/h2."""
        return 1 / self.screen.h1 + 1 / self.h2

    def slope(self, b: float) -> float:
        """|∇Δ| is nowhere larger for points up to b from p0.

        It vanishes where the ray crosses the screen, and |∇∇Δ| <= 1/h1 + 1/h2.
        """
        screen = self.screen
        if screen.source.position is None:
            share = 1.0
            d = screen.axes @ np.asarray(screen.source.direction)
            foot = self.across - self.h2 * d / (np.asarray(screen.source.direction) @ screen.normal)
        else:
            share = screen.h1 / (screen.h1 + self.h2)
            foot = share * self.across + (1 - share) * (screen.axes @ (screen.source.position - screen.x0))
        return (screen.a + float(np.linalg.norm(foot)) + share * b) * self.curvature

    @property
    def is_paraxial(self) -> bool:
        return max(self.screen.tilt, (math.hypot(*self.across) + self.screen.a + self.b) / self.h2) <= STEEPEST

    @staticmethod
    def of(screen: Screen, points: Reals, grid: Lattice | None) -> Plane:
        hull = points if grid is None else points[grid.corners]
        p0 = 0.5 * (points.min(0) + points.max(0)) if grid is None else points[grid.middle]
        b = float(np.linalg.norm(hull - p0, axis=1).max())
        slack = rounding(hull)
        beside = float(np.linalg.norm(np.abs(screen.axes) @ slack))
        off = float(np.ptp(hull @ screen.normal) + np.abs(screen.normal) @ slack)
        return Plane(screen, p0, b, (beside, off), grid)


class Group(NamedTuple):
    """Points of one plane: which they are, and the lattice that they form, if any."""

    which: slice | Integers
    lattice: Lattice | None


def planes(scene: Scene, source: Source, points: Reals) -> list[Group]:
    """The planes parallel to the screen and beyond it that points (n, 3) lie on; none where planes are many."""
    if not scene.screen:
        return []
    screen = Screen.of(scene, source, 0.0)
    grid = lattice(points)
    hull = points if grid is None else points[grid.corners]
    heights = hull @ screen.normal - screen.x0 @ screen.normal
    slack = 4 * float(np.abs(screen.normal) @ rounding(hull))
    if np.ptp(heights) <= slack:
        return [Group(slice(None), grid)] if heights.min() > 0 else []
    if grid is not None:
        return []
    ordered = np.sort(heights)
    first = ordered[np.concatenate([[True], np.diff(ordered) > slack])]
    if len(first) > PLANES:
        return []
    number = np.searchsorted(first, heights, side="right") - 1
    each = [np.flatnonzero(number == i) for i in np.flatnonzero(first > 0)]
    return [Group(index, lattice(points[index])) for index in each]


class Remainder(NamedTuple):
    """What the factored kernel does to M at most: c0 + b (c1 + b (c2 + b c3)) at the distance b from p0."""

    c0: float
    c1: float
    c2: float
    c3: float

    def scaled(self, by: float) -> Remainder:
        return Remainder(*(by * c for c in self))

    def __call__(self, b: Any) -> Any:
        return self.c0 + b * (self.c1 + b * (self.c2 + b * self.c3))


def remainder(plane: Plane, area: float, covers: float) -> Remainder:
    """A bound of |M_factored - M|.

    Over the module's ψ, since |∇³s| <= 3|w|/h³ at the offset w = w0 + y - x, and s at the height h = h2,

        |ψ| <= 3kab/h³ [w0 (a+b)/2 + a²/6 + ab/4 + b²/6],   |∇ψ| <= 3kb/h³ [w0 (a + b/2) + a²/2 + ab/2 + b²/6]

    and |η| <= 4ab/h². With K dA = -dφ d(C e^{ikΔ})/2π (THEORY eq. 4) integrated by parts along the azimuths of the
    ray, the error is at most (∮|dφ|/2π) (2|ψ| + 2a|∇ψ| + 4|η|); `covers`, the outlines' total turning over 2π, is
    no less than ∮|dφ|/2π.
    Where holes are small ∫|K| dA (|ψ| + |η|) is less.
    """
    screen = plane.screen
    k, a, h = screen.k, screen.a, plane.h2
    w0 = math.hypot(*plane.across)
    cubic, square = 3 * k * a / h**3, 4 * a / h**2
    by_rim = covers * np.array(
        [cubic * (3 * w0 * a + 4 / 3 * a * a) + 4 * square, cubic * (2 * w0 + 1.5 * a), cubic * 2 / 3]
    )
    mass = k / (2 * np.pi) * plane.curvature * area
    by_area = mass * np.array(
        [cubic * (w0 * a / 2 + a * a / 6) + square, cubic * (w0 / 2 + a / 4), cubic / 6],
    )
    powers = plane.b ** np.arange(1, 4)
    c = by_rim if by_rim @ powers < by_area @ powers else by_area
    beside, off = plane.off
    c0 = 4 * covers * k * (beside * plane.slope(plane.b) + off * a * (a + 2 * plane.b + w0) / h**2)
    return Remainder(float(c0), *c.tolist())
