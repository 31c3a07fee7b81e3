"""Many points on one plane behind planar holes or masks: Kirchhoff's area integral as one non-uniform FFT.

After A. Barnett, JATIS 7(2) 021211. The hole is summed over quadrature nodes x instead of along its rim, and the
kernel is factored. With x0, p0 the middles of holes and points, x and y the offsets from them,

    M = ∫ K(x, y) dA,   K(x, y) = K(x, 0) K(0, y) / K(0, 0) · e^{-ik y·Bx + iψ + η},   B = (1 - u uᵀ) / s0

K is Kirchhoff's integrand over U0, s0 = |p0 - x0|, and u the part of (p0 - x0)/s0 along the screen. |X-S| and |P-S|
are exact; of |P-X| all that depends on both x and y is, but for its bilinear part, left out: ψ in the phase, η in
the modulus. `remainder` bounds what that does to M.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import complex_array, types
from grimaldi.diffraction.frame import constant
from grimaldi.diffraction.lattice import Lattice
from grimaldi.diffraction.model import Evaluate, Factor, Options, Receivers
from grimaldi.diffraction.planes import Plane, Remainder, Screen, remainder
from grimaldi.diffraction.quadrature import Patches, Rule, nodes, patches
from grimaldi.diffraction.sines import sincos
from grimaldi.diffraction.transform import FINEST, seconds, sums
from grimaldi.outlines.candidate import segments_for
from grimaldi.outlines.model import Reals
from grimaldi.scene.model import Scene, Source

QUADRATURE, TRANSFORM = 0.0625, 0.25  # shares of the tolerance
EXCESS = 20  # finufft's largest error over its eps: up to 17 seen at the rim of its modes, for upsampling by 1.25
LEAST = 1e-3  # of the bound: less error than that is not expected
SAMPLES, SAFETY = 16, 2.5  # points where the error is measured, and what it may be elsewhere times that
MOST_NODES = 1 << 23
PAIR, PAIR_DOUBLE = 4e-9, 1.2e-8  # rough seconds of a point and a segment of the line integral


def kernel(screen: Screen, x: Any, p: Any) -> tuple[Any, Any]:
    """K (real, imaginary) between points x of the screen and p behind it (Float64), both from x0.

    K = -R/(4π r s) [(ik - 1/r) h1/r + (ik - 1/s) h2/s] e^{ikΔ}, over the plane wave's U0 its limit.
    """
    V = type(p)
    n = constant(V, screen.normal)
    k = screen.k
    height = dr.dot(x, n)
    h2 = dr.dot(p, n) - height
    across = p - dr.dot(p, n) * n
    if screen.source.position is None:
        a = constant(V, np.asarray(screen.source.direction))
        cos = dr.dot(a, n)
        v = x - height * n - across + h2 * (a / cos - n)
        along = dr.dot(v, a)
        d2 = dr.squared_norm(v) - along * along
        ratio, cos1, inv_r, delta = 1.0, cos, 0.0, 0.0
    else:
        S = constant(V, screen.source.position - screen.x0)
        h1 = height - dr.dot(S, n)
        ray = p - S
        R = dr.norm(ray)
        a = ray / R
        cos = (h1 + h2) / R
        S = S - dr.dot(S, n) * n
        v = x - height * n - S - (across - S) * (h1 / (h1 + h2))
        along = dr.dot(v, a)
        d2 = dr.squared_norm(v) - along * along
        z1 = h1 / cos + along
        r = dr.sqrt(z1 * z1 + d2)
        inv_r = 1 / r
        ratio, cos1, delta = R * inv_r, h1 * inv_r, d2 / (r + z1)
    z2 = h2 / cos - along
    s = dr.sqrt(z2 * z2 + d2)
    sin, cos_ = sincos(k * (delta + d2 / (s + z2)))
    inv_s = 1 / s  # divisions take as long as much else
    scale, cos2 = ratio * inv_s / (4 * np.pi), h2 * inv_s
    real, imag = scale * (inv_r * cos1 + inv_s * cos2), -k * scale * (cos1 + cos2)
    return real * cos_ - imag * sin, real * sin + imag * cos_


def fresnel_plane(
    scene: Scene, source: Source, k: float, options: Options, points: Reals, grid: Lattice | None
) -> Evaluate | None:
    """M of the model `boundary` at points (n, 3) of one of `planes`, its lattice with them.

    Returns a function of exactly these points, in their order. None where neither the error's bound nor an estimate
    of it is within the tolerance, or where the line integral is expected to be faster.
    """
    plane = Plane.of(Screen.of(scene, source, k), points, grid)
    screen = plane.screen
    if not plane.is_paraxial:
        return None
    parts = patches(scene)
    area = sum(float(np.abs(part.area).sum()) for part in parts)
    mass = k / (2 * np.pi) * plane.curvature * area
    covers = sum(_turning(loop) for shape in scene.screen for loop in shape.world_loops(16)) / (2 * np.pi)
    left = remainder(plane, area, covers)
    phase = k * plane.slope(plane.b) * (screen.a + plane.b)
    numerical = (QUADRATURE + TRANSFORM) * options.tolerance + 1e-15 * (1 + phase)
    if LEAST * left(plane.b) + numerical > options.tolerance:
        return None
    way = _cheapest(plane, parts, mass, covers, options.tolerance, len(points))
    if way is None or way.seconds > _line_seconds(scene, plane, options, len(points)):
        return None
    if left(plane.b) + numerical > options.tolerance:
        # what is left out is small and smooth: a hundredth of it needs few nodes
        coarse = Opening.of(plane, parts, [part.rule(k * plane.slope(plane.b), 1e-2 / mass) for part in parts])
        left = left.scaled(min(1.0, SAFETY * coarse.excess(points, left)))
        if left(plane.b) + numerical > options.tolerance:
            return None
    opening = Opening.of(plane, parts, way.rules)
    return _evaluate(opening, scene.screen[0].hole, points, way.eps, left, numerical)


class Way(NamedTuple):
    """What the holes are summed by, finufft's eps, and the seconds that this may take."""

    rules: list[Rule]
    eps: float
    seconds: float


def _cheapest(plane: Plane, parts: list[Patches], mass: float, covers: float, tolerance: float, n: int) -> Way | None:
    """The way to n points to the shares of the tolerance that takes least; None where there is none.

    finufft's error is what it would return at its aliases, times eps: at most mass = ∫|K| dA, or |M| <= 1 + ∮|dφ|/2π
    if the nodes serve the strongest aliases too, which lie within 2b.
    """
    ways = []
    for largest, reach in ((mass, plane.b), (min(mass, 1 + covers), 2 * plane.b)):
        eps = min(TRANSFORM * tolerance / (EXCESS * largest), 1e-2)
        rules = [part.rule(plane.screen.k * plane.slope(reach), 0.5 * QUADRATURE * tolerance / mass) for part in parts]
        count = sum(len(rule.rho) * len(part.area) for rule, part in zip(rules, parts, strict=True))
        if eps >= FINEST and count <= MOST_NODES:
            ways.append(Way(rules, eps, seconds(plane, eps, count, n)))
    return min(ways, key=lambda way: way.seconds, default=None)


@dataclass(frozen=True, eq=False)
class Opening:
    """The holes as nodes x (m, 3), from x0, with weights and K(x, 0)/K(0, 0) times these."""

    plane: Plane
    x: Reals
    weights: Reals
    factored: NDArray[np.complex128]

    @staticmethod
    def of(plane: Plane, parts: list[Patches], rules: list[Rule]) -> Opening:
        x, weights = (np.concatenate(a) for a in zip(*map(nodes, parts, rules), strict=True))
        x = x - plane.screen.x0
        double = types(double=True)
        V = double.Vector
        p0 = constant(V, plane.p0 - plane.screen.x0)
        with_middle = np.concatenate([x, np.zeros((1, 3))])
        at_p0 = complex_array(*kernel(plane.screen, V(*map(double.buffer, with_middle.T)), p0))
        ratio = at_p0[:-1] / at_p0[-1]
        return Opening(plane, x, weights, weights * ratio)

    def excess(self, points: Reals, bound: Remainder) -> float:
        """The largest |M_factored - M| / bound at a few of the points, M by the sum of K itself over the nodes."""
        screen, grid = self.plane.screen, self.plane.lattice
        side = int(math.sqrt(SAMPLES))
        if grid is None:
            chosen = np.linspace(0, len(points) - 1, SAMPLES).astype(int)
        else:
            row, column = (np.linspace(0, n - 1, side).astype(int) for n in (grid.rows, grid.columns))
            chosen = (row[:, None] * grid.columns + column).ravel()
        double = types(double=True)
        V, F, m = double.Vector, double.Float, len(self.x)
        i = dr.arange(dr.uint32_array_t(F), len(chosen) * m)
        node, point = i % m, i // m

        def each(index: Any, *columns: Reals) -> list[Any]:
            return [dr.gather(F, double.buffer(column), index) for column in columns]

        at, y = points[chosen] - screen.x0, points[chosen] - self.plane.p0
        B = -screen.k * screen.axes.T @ self.plane.B @ screen.axes
        outer = complex_array(*kernel(screen, constant(V, np.zeros(3)), V(*map(double.buffer, at.T))))
        x = V(*each(node, *self.x.T))
        w, re, im = each(node, self.weights, self.factored.real, self.factored.imag)
        u, v = each(point, outer.real, outer.imag)
        sin, cos = sincos(dr.dot(x, V(*each(point, *(y @ B.T).T))))
        exact_re, exact_im = kernel(screen, x, V(*each(point, *at.T)))
        real, imag = re * cos - im * sin, re * sin + im * cos
        off = w * exact_re - (u * real - v * imag), w * exact_im - (u * imag + v * real)
        dr.eval(off)
        off = np.abs(complex_array(*(dr.block_sum(part, m) for part in off)))
        return float((off / bound(np.linalg.norm(y, axis=1))).max())


def _evaluate(opening: Opening, hole: bool, points: Reals, eps: float, left: Remainder, numerical: float) -> Evaluate:
    screen = opening.plane.screen
    double = types(double=True)
    V, index = double.Vector, dr.uint32_array_t(double.Float)
    p0, zero = constant(V, opening.plane.p0 - screen.x0), constant(V, np.zeros(3))
    flat = double.taken(sums(opening.plane, points, opening.x, opening.factored, eps).view(np.float64))

    def evaluate(receivers: Receivers) -> Factor:
        p = V(receivers.p) - constant(V, screen.x0)
        a, b = dr.gather(mi.Vector2d, flat, dr.arange(index, len(points)))  # in one go
        re, im = kernel(screen, zero, p)
        real, imag = re * a - im * b, re * b + im * a
        error = left(dr.norm(p - p0)) + numerical
        return Factor(real, imag, error) if hole else Factor(1 - real, -imag, error)

    return evaluate


def _turning(loop: Reals) -> float:
    """By how much the direction along a loop (n, 3) turns, 2π if it is convex [rad]."""
    e = np.roll(loop, -1, axis=0) - loop
    following = np.roll(e, -1, axis=0)
    sin, cos = np.linalg.norm(np.cross(e, following), axis=1), np.einsum("ij,ij->i", e, following)
    return float(np.arctan2(sin, cos).sum())


def _line_seconds(scene: Scene, plane: Plane, options: Options, n: int) -> float:
    """What the line integral is expected to take."""
    k = plane.screen.k
    segments = 0
    for shape in scene.screen:
        size = float(np.linalg.norm(shape.to_world[:3, :2]))
        sag = min(options.tolerance / (k * plane.slope(plane.b)), 0.01 * size)
        segments += segments_for(size, sag) if shape.is_ellipse else sum(map(len, shape.loops))
    double = options.precision == "double" or options.tolerance < 1e-4
    return n * segments * (PAIR_DOUBLE if double else PAIR)
