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
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.frame import constant
from grimaldi.diffraction.model import Evaluate, Factor, Options, Receivers
from grimaldi.diffraction.segment import sincos
from grimaldi.outlines.candidate import segments_for
from grimaldi.outlines.model import Integers, Reals
from grimaldi.scene.model import Scene, Source, Vector

PLANES = 16  # so many planes of points are worth a transform each
STEEPEST = 0.25  # offset across the normal over distance along it, up to which the bounds are meant to hold
QUADRATURE, TRANSFORM = 0.0625, 0.25  # shares of the tolerance
EXCESS = 20  # finufft's largest error over its eps: up to 17 seen at the rim of its modes, for upsampling by 1.25
FINEST = 1e-14  # of finufft's eps
LEAST = 1e-3  # of the bound: less error than that is not expected
SAMPLES, SAFETY = 16, 2.5  # points where the error is measured, and what it may be elsewhere times that
MOST_NODES = 1 << 23
MOST_CELLS = 1 << 26  # of the FFT

# Rough seconds on two cores; only which is larger matters, and mostly by far.
PAIR, PAIR_DOUBLE = 4e-9, 1.2e-8  # a point and a segment of the line integral
SPREAD, CELL, CALL = 1e-9, 5e-9, 5e-3  # a node or target and a cell that it covers; a cell of the FFT; the rest


class Lattice(NamedTuple):
    """Points that stand in `rows` of `columns`."""

    rows: int
    columns: int
    u: Vector  # (3,) from one point of a row to the next
    v: Vector  # (3,) from one row to the next

    @property
    def middle(self) -> int:
        """The point that finufft counts its modes from."""
        return (self.rows // 2) * self.columns + self.columns // 2

    @property
    def corners(self) -> list[int]:
        last = (self.rows - 1) * self.columns
        return [0, self.columns - 1, last, last + self.columns - 1]


def rounding(points: Reals) -> Vector:
    """How far (3,) rounding may move points (n, 3) of these coordinates."""
    return 2e-15 * np.maximum(points.max(axis=0), -points.min(axis=0))


def lattice(points: Reals) -> Lattice | None:
    """The lattice whose rows are the points (n, 3), but for rounding; None where there is none."""
    if len(points) < 4:
        return None
    slack = rounding(points)
    ahead = points[: 1 << 15]
    on = np.abs(ahead - ahead[0] - np.arange(len(ahead))[:, None] * (ahead[1] - ahead[0])) <= len(ahead) * slack
    columns = len(on) if on.all() else int(on.all(axis=1).argmin())
    if columns < 2 or len(points) % columns or len(points) < 2 * columns:
        return None
    rows = points.reshape(-1, columns, 3)
    u, v = (rows[0, -1] - rows[0, 0]) / (columns - 1), (rows[-1, 0] - rows[0, 0]) / (len(rows) - 1)
    for axis in range(3):
        off = rows[:, :, axis] - (rows[0, 0, axis] + np.arange(columns) * u[axis])
        off -= (np.arange(len(rows)) * v[axis])[:, None]
        if max(off.max(), -off.min()) > slack[axis]:
            return None
    return Lattice(len(rows), columns, u, v)


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


# ---------------------------------------------------------------- what is left out


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


# ---------------------------------------------------------------- quadrature


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
            n = 2 * count(slope * reach, share)  # the trapezoid rule is exact to half the degree of Gauss's
            round_ = np.arange(n, dtype=np.float64) * (2 * np.pi / n), np.full(n, 1 / n)
            return Rule(gauss(0.5 * slope * reach, share), round_)
        ends = np.stack([self.first, self.first + self.second])
        reach, side = (float(np.linalg.norm(v, axis=-1).max()) for v in (ends, self.second))
        return Rule(gauss(0.5 * slope * reach, share), gauss(0.5 * slope * side, share))


class Rule(NamedTuple):
    """Nodes and weights over ρ in 0..1 and over t."""

    radial: tuple[Reals, Reals]
    round: tuple[Reals, Reals]

    @property
    def size(self) -> int:
        return len(self.radial[0]) * len(self.round[0])


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


def count(half: float, share: float) -> int:
    """How many Gauss-Legendre nodes integrate e^{iφ}, |φ'| <= half over [-1, 1], to `share` of 2.

    The error is at most 64/15 e^{|Im φ|} ρ^{-2n}/(1 - ρ^{-2}) with φ on Bernstein's ellipse of any ρ = e^σ (Trefethen,
    Approximation Theory, thm. 19.3), and for a quadratic φ there |Im φ| <= half sinh σ cosh σ. Four times as much
    leaves room for a factor of polynomial size.
    """
    sigma = np.geomspace(0.01, 5, 200)
    n = (half * np.sinh(sigma) * np.cosh(sigma) + np.log(8.6 / share / -np.expm1(-2 * sigma))) / (2 * sigma)
    return int(np.ceil(n.min())) + 1


@lru_cache(maxsize=64)
def gauss(half: float, share: float) -> tuple[Any, Any]:
    """Nodes and weights on 0..1, in panels of at most 60 radians either side."""
    panels = int(np.ceil(max(half, 1.0) / 60))
    x, w = np.polynomial.legendre.leggauss(count(half / panels, share))
    middles = np.arange(panels)[:, None] + 0.5
    return ((middles + 0.5 * x) / panels).ravel(), np.tile(0.5 * w / panels, panels)


def nodes(part: Patches, rule: Rule) -> tuple[Reals, Reals]:
    """Points (n, 3) and weights (n,), which add up to the area."""
    (rho, w_rho), (t, w_t) = rule
    along, across = (np.cos(t), np.sin(t)) if part.ellipse else (np.ones_like(t), t)
    rim = along[:, None] * part.first[:, None] + across[:, None] * part.second[:, None]
    x = part.centre[:, None, None] + rho[:, None, None] * rim[:, None]
    w = 2 * part.area[:, None, None] * (rho * w_rho)[:, None] * w_t
    return x.reshape(-1, 3), w.ravel()


# ---------------------------------------------------------------- the kernel


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
        ratio, cos1, inv_r, delta = R / r, h1 / r, 1 / r, d2 / (r + z1)
    z2 = h2 / cos - along
    s = dr.sqrt(z2 * z2 + d2)
    sin, cos_ = sincos(k * (delta + d2 / (s + z2)))
    scale = ratio / (4 * np.pi * s)
    real, imag = scale * (inv_r * cos1 + h2 / (s * s)), -k * scale * (cos1 + h2 / s)
    return real * cos_ - imag * sin, real * sin + imag * cos_


def sums(plane: Plane, points: Reals, x: Reals, c: NDArray[np.complex128], eps: float) -> NDArray[np.complex128]:
    """Σ c e^{-ik y·Bx} at the points, y being points - p0, to about eps of their size; x (m, 3) from x0."""
    import finufft

    axes, grid = plane.screen.axes, plane.lattice
    to_phase = -plane.screen.k * axes.T @ plane.B  # (3, 2)
    result: Any
    if grid is None:
        (x1, x2), (y1, y2) = (
            np.einsum("ji,mj->im", a, v, order="C") for a, v in ((to_phase, x), (axes.T, points - plane.p0))
        )
        result = finufft.nufft2d3(x1, x2, c, y1, y2, eps=eps, isign=1)
    else:
        x1, x2 = np.einsum("ji,mj->im", to_phase @ axes @ np.stack([grid.v, grid.u], axis=1), x, order="C")
        shape = grid.rows, grid.columns
        result = finufft.nufft2d1(x1, x2, c, shape, eps=eps, isign=1, upsampfac=upsampling(eps))
    return result.ravel()


def upsampling(eps: float) -> float:
    """How much finer than the points finufft's grid is: 1.25 is cheaper, where its widest kernel suffices."""
    return 1.25 if eps > 2e-9 else 2.0


# ---------------------------------------------------------------- whether and how


def fresnel_plane(
    scene: Scene, source: Source, k: float, options: Options, points: Reals, grid: Lattice | None
) -> Evaluate | None:
    """M of the model `boundary` at points (n, 3) of one of `planes`, its lattice with them.

    Returns a function of exactly these points, in their order. None where the error's bound exceeds the tolerance,
    or where the line integral is expected to be faster.
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
    # finufft's error is what it would return at its aliases, times eps: |M| <= 1 + ∮|dφ|/2π
    eps = TRANSFORM * options.tolerance / (EXCESS * min(mass, 1 + covers))
    phase = k * plane.slope(plane.b) * (screen.a + plane.b)
    numerical = (QUADRATURE + TRANSFORM) * options.tolerance + 1e-15 * (1 + phase)
    if LEAST * left(plane.b) + numerical > options.tolerance or eps < FINEST:
        return None
    # the nodes serve finufft's strongest aliases too, which lie within 2b
    rules = [part.rule(k * plane.slope(2 * plane.b), 0.5 * QUADRATURE * options.tolerance / mass) for part in parts]
    size = sum(rule.size * len(part.area) for rule, part in zip(rules, parts, strict=True))
    if size > MOST_NODES or _seconds(plane, eps, size, len(points)) > _line_seconds(scene, plane, options, len(points)):
        return None
    if left(plane.b) + numerical > options.tolerance:
        # what is left out is small and smooth: a hundredth of it needs few nodes
        coarse = Opening.of(plane, parts, [part.rule(k * plane.slope(plane.b), 1e-2 / mass) for part in parts])
        left = left.scaled(min(1.0, SAFETY * coarse.excess(points, left)))
        if left(plane.b) + numerical > options.tolerance:
            return None
    opening = Opening.of(plane, parts, rules)
    return _evaluate(opening, scene.screen[0].hole, points, min(eps, 1e-2), left, numerical)


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
        at_p0 = _complex(kernel(plane.screen, V(*map(double.buffer, x.T)), p0))
        ratio = at_p0 / _complex(kernel(plane.screen, constant(V, np.zeros(3)), p0))
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
        x = V(*(dr.gather(F, double.buffer(column), node) for column in self.x.T))
        at = points[chosen] - screen.x0
        p = V(*(dr.gather(F, double.buffer(column), point) for column in at.T))
        re, im = kernel(screen, x, p)
        w, c_re, c_im = (
            dr.gather(F, double.buffer(values), node)
            for values in (self.weights, self.factored.real, self.factored.imag)
        )
        exact = _complex((dr.block_sum(w * re, m), dr.block_sum(w * im, m)))
        y = points[chosen] - self.plane.p0
        B = -screen.k * screen.axes.T @ self.plane.B @ screen.axes
        q = V(*(dr.gather(F, double.buffer(column), point) for column in (y @ B.T).T))
        sin, cos = sincos(dr.dot(x, q))
        factored = _complex((dr.block_sum(c_re * cos - c_im * sin, m), dr.block_sum(c_re * sin + c_im * cos, m)))
        outer = _complex(kernel(screen, constant(V, np.zeros(3)), V(*map(double.buffer, at.T))))
        off = np.abs(factored * outer - exact)
        return float((off / bound(np.linalg.norm(y, axis=1))).max())


def _evaluate(opening: Opening, hole: bool, points: Reals, eps: float, left: Remainder, numerical: float) -> Evaluate:
    screen = opening.plane.screen
    double = types(double=True)
    F, V, index = double.Float, double.Vector, dr.uint32_array_t(double.Float)
    p0, zero = constant(V, opening.plane.p0 - screen.x0), constant(V, np.zeros(3))
    flat = double.buffer(sums(opening.plane, points, opening.x, opening.factored, eps).view(np.float64))

    def evaluate(receivers: Receivers) -> Factor:
        p = V(receivers.p) - constant(V, screen.x0)
        i = dr.arange(index, len(points))
        a, b = dr.gather(F, flat, 2 * i), dr.gather(F, flat, 2 * i + 1)
        re, im = kernel(screen, zero, p)
        real, imag = re * a - im * b, re * b + im * a
        error = left(dr.norm(p - p0)) + numerical
        return Factor(real, imag, error) if hole else Factor(1 - real, -imag, error)

    return evaluate


def _complex(z: tuple[Any, Any]) -> NDArray[np.complex128]:
    return z[0].numpy() + 1j * z[1].numpy()


def _turning(loop: Reals) -> float:
    """By how much the direction along a loop (n, 3) turns, 2π if it is convex [rad]."""
    e = np.roll(loop, -1, axis=0) - loop
    following = np.roll(e, -1, axis=0)
    sin, cos = np.linalg.norm(np.cross(e, following), axis=1), np.einsum("ij,ij->i", e, following)
    return float(np.arctan2(sin, cos).sum())


def _seconds(plane: Plane, eps: float, size: int, n: int) -> float:
    """What the transform is expected to take."""
    width = max(-math.log10(eps), 1) + 2
    if plane.lattice is not None:
        cells = upsampling(eps) ** 2 * n
        return CALL + CELL * cells + SPREAD * size * width**2
    phase = plane.screen.k * plane.curvature * plane.screen.a * plane.b
    cells = (8 / np.pi * phase + 4 * width) ** 2
    return CALL + CELL * cells + SPREAD * (size + n) * width**2 if cells < MOST_CELLS else math.inf


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
