"""Nodes and weights over the holes of a screen: Gauss-Legendre in triangles, or over the ellipse itself."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.model import Scene


class Patches(NamedTuple):
    """Triangles, or one whole ellipse, with the same rule.

    Points of a triangle are centre + ρ (first + t second), those of an ellipse centre + ρ (cos t first + sin t second).
    """

    centre: Reals  # (m, 3)
    first: Reals  # (m, 3)
    second: Reals  # (m, 3)
    area: Reals  # (m,), signed
    ellipse: bool

    def rule(self, slope: float, share: float) -> Rule:
        """For integrands whose phase grows by `slope` a length at most, to `share` of their modulus."""
        if self.ellipse:
            reach = float(np.linalg.norm(np.stack([self.first[0], self.second[0]]), 2))
            rho, weight = gauss(0.5 * slope * reach, share)
            # the trapezoid rule is exact to half the degree of Gauss's, and small rings need fewer nodes
            each = 2 * count(slope * reach * rho, share)
            first = np.repeat(np.cumsum(each) - each, each)
            t = (np.arange(len(first)) - first) * np.repeat(2 * np.pi / each, each)
            return Rule(np.repeat(rho, each), t, np.repeat(weight / each, each))
        ends = np.stack([self.first, self.first + self.second])
        reach, side = (float(np.linalg.norm(v, axis=-1).max()) for v in (ends, self.second))
        (rho, w_rho), (t, w_t) = (gauss(0.5 * slope * length, share) for length in (reach, side))
        return Rule(np.repeat(rho, len(t)), np.tile(t, len(rho)), np.outer(w_rho, w_t).ravel())


class Rule(NamedTuple):
    """Nodes (n,) at ρ in 0..1 and t, and their weights dρ dt."""

    rho: Reals
    t: Reals
    weight: Reals


def patches(scene: Scene) -> list[Patches]:
    """The holes in signed triangles from the middle of each loop, those of like size together; ellipses whole."""
    parts = []
    for shape in scene.screen:
        if shape.is_ellipse:
            x, y = shape.to_world[:3, :2].T[:, None]
            parts.append(Patches(shape.origin[None], x, y, np.pi * np.linalg.norm(np.cross(x, y), axis=1), True))
            continue
        for loop in shape.world_loops():
            centre = np.broadcast_to(0.5 * (loop.min(0) + loop.max(0)), loop.shape)
            first, second = loop - centre, np.roll(loop, -1, axis=0) - loop
            area = 0.5 * np.cross(first, second) @ shape.normal
            sides = np.linalg.norm(second, axis=1)
            size = np.ceil(2 * np.log2(sides / sides.max()))
            for of in (size == one for one in np.unique(size)):
                parts.append(Patches(centre[of], first[of], second[of], area[of], False))
    return parts


def count(half: ArrayLike, share: float) -> Integers:
    """How many Gauss-Legendre nodes integrate e^{iφ}, |φ'| <= half over [-1, 1], to `share` of 2.

    The error is at most 64/15 e^{|Im φ|} ρ^{-2n}/(1 - ρ^{-2}) with φ on Bernstein's ellipse of any ρ = e^σ (Trefethen,
    Approximation Theory, thm. 19.3), and for a quadratic φ there |Im φ| <= half sinh σ cosh σ. Four times as much
    leaves room for a factor of polynomial size.
    """
    sigma = np.geomspace(0.01, 5, 200)
    growth = np.sinh(sigma) * np.cosh(sigma) / (2 * sigma)
    n = np.multiply.outer(half, growth) + np.log(8.6 / share / -np.expm1(-2 * sigma)) / (2 * sigma)
    return np.maximum(np.ceil(n.min(axis=-1)).astype(int), 0) + 1


@lru_cache(maxsize=64)
def gauss(half: float, share: float) -> tuple[Any, Any]:
    """Nodes and weights on 0..1, in panels of at most 60 radians either side."""
    panels = int(np.ceil(max(half, 1.0) / 60))
    x, w = np.polynomial.legendre.leggauss(int(count(half / panels, share)))
    middles = np.arange(panels)[:, None] + 0.5
    return ((middles + 0.5 * x) / panels).ravel(), np.tile(0.5 * w / panels, panels)


def nodes(part: Patches, rule: Rule) -> tuple[Reals, Reals]:
    """Points (n, 3) and weights (n,), which add up to the area."""
    rho, t, weight = rule
    along, across = (rho * np.cos(t), rho * np.sin(t)) if part.ellipse else (rho, rho * t)
    x = part.centre[:, None] + along[:, None] * part.first[:, None] + across[:, None] * part.second[:, None]
    return x.reshape(-1, 3), np.multiply.outer(2 * part.area, rho * weight).ravel()
