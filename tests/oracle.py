"""Slow, literal references in Float64 NumPy, written from THEORY alone; nothing of the product is used here.

`area_factor`: M = U/U0 by the Kirchhoff area integral over the nodes of an opening.
`edge_factor`: M of an opening by eq. 6 along the nodes of its outline; shares no formula with the other.
Factors of opaque bodies are one minus those of their outline (eq. 5, Babinet).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Reals = NDArray[np.float64]
Factors = NDArray[np.complex128]


def as_complex(values: ArrayLike) -> Factors:
    return np.asarray(values, np.complex128)


@dataclass(frozen=True)
class Spherical:
    """Eq. 1 with A = 1, φ0 = 0 from `position` (3,)."""

    position: ArrayLike

    def wave(self, x: Reals, k: float) -> tuple[Factors, Factors]:
        """U0 at x (n, 3) and its gradient (n, 3)."""
        v = x - np.asarray(self.position, float)
        r = np.linalg.norm(v, axis=1)
        u = np.exp(1j * k * r) / r
        return as_complex(u), as_complex(((1j * k - 1 / r) * u / r)[:, None] * v)


@dataclass(frozen=True)
class Plane:
    """Eq. 2 with A = 1, φ0 = 0 along `direction` (3,), unit, through the world's origin."""

    direction: ArrayLike

    def wave(self, x: Reals, k: float) -> tuple[Factors, Factors]:
        """U0 at x (n, 3) and its gradient (n, 3)."""
        d = np.asarray(self.direction, float)
        u = np.exp(1j * k * (x @ d))
        return u, 1j * k * u[:, None] * d


Source = Spherical | Plane


@dataclass(frozen=True)
class Nodes:
    """Quadrature nodes (n, 3) with vector weights (n, 3): normal times area, or tangent times length."""

    x: Reals
    w: Reals

    def __add__(self, other: Nodes) -> Nodes:
        return Nodes(np.concatenate([self.x, other.x]), np.concatenate([self.w, other.w]))

    def __neg__(self) -> Nodes:
        return Nodes(self.x, -self.w)


def disc_area(to_world: ArrayLike, radial: int = 300, angular: int = 600) -> Nodes:
    """The unit disc in z = 0 under the affine map `to_world` (4, 4): Gauss-Legendre by trapezoid rule."""
    rho, w = _gauss(radial)
    theta = np.arange(angular) * 2 * np.pi / angular
    local = np.stack([np.outer(rho, np.cos(theta)), np.outer(rho, np.sin(theta))], axis=-1).reshape(-1, 2)
    weights = np.repeat(rho * w, angular) * 2 * np.pi / angular
    return _affine(to_world, local, weights)


def square_area(to_world: ArrayLike, order: int = 400) -> Nodes:
    """The square [-1, 1]² in z = 0 under `to_world` (4, 4): tensor Gauss-Legendre."""
    x, w = np.polynomial.legendre.leggauss(order)
    local = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    return _affine(to_world, local, np.outer(w, w).ravel())


def polygon_area(loop: ArrayLike, order: int = 200) -> Nodes:
    """A plane polygon with corners (n, 3): signed triangles about its middle, tensor Gauss-Legendre each.

    The normal follows the right hand around the loop; any simple polygon, convex or not.
    """
    corners = np.asarray(loop, float)
    apex = corners.mean(axis=0)
    u, wu = _gauss(order)
    v, wv = _gauss(order)
    nodes: list[Reals] = []
    weights: list[Reals] = []
    for first, second in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side = first + v[:, None] * (second - first) - apex
        nodes.append((apex + u[:, None, None] * side).reshape(-1, 3))
        normal = np.cross(first - apex, second - apex)
        weights.append(np.outer(u * wu, wv).reshape(-1, 1) * normal)
    return Nodes(np.concatenate(nodes), np.concatenate(weights))


def circle_edge(to_world: ArrayLike, n: int = 20_000) -> Nodes:
    """The rim of `disc_area`'s disc, counter-clockwise: trapezoid rule."""
    return curve_edge(_circle(np.asarray(to_world, float)), 0, 2 * np.pi, n)


def arc_edge(to_world: ArrayLike, start: float, end: float, n: int = 20_000) -> Nodes:
    """The part of `circle_edge` between two angles [rad]."""
    return curve_edge(_circle(np.asarray(to_world, float)), start, end, n)


def curve_edge(curve: Callable[[Reals], tuple[Reals, Reals]], start: float, end: float, n: int) -> Nodes:
    """Midpoint rule along t -> (X, X') from `start` to `end`: spectrally accurate on closed curves."""
    x, tangent = curve(np.linspace(start, end, 2 * n + 1)[1::2])
    return Nodes(x, tangent * (end - start) / n)


def polygon_edge(loop: ArrayLike, pieces: int = 400, order: int = 12) -> Nodes:
    """The sides of a polygon (n, 3), not necessarily plane: `pieces` Gauss-Legendre panels on each."""
    corners = np.asarray(loop, float)
    sides = np.asarray(np.roll(corners, -1, axis=0) - corners, float)
    x, w = _gauss(order)
    t = ((np.arange(pieces)[:, None] + x) / pieces).ravel()
    w = np.tile(w / pieces, pieces)
    nodes = corners[:, None] + t[:, None] * sides[:, None]
    return Nodes(nodes.reshape(-1, 3), (w[:, None] * sides[:, None]).reshape(-1, 3))


def area_factor(source: Source, points: ArrayLike, opening: Nodes, wavelength: float) -> Factors:
    """M (m,) at `points` (m, 3) behind an opening: (1/4π) ∫ (U0 ∂nG - G ∂nU0) dA / U0(P), G = e^{iks}/s.

    The sign of the normals does not matter: each receiver lies on the side away from the source.
    """
    k = 2 * np.pi / wavelength
    receivers = np.atleast_2d(np.asarray(points, float))
    incident, gradient = source.wave(opening.x, k)
    flux = (gradient * opening.w).sum(axis=1)
    forward = np.sign(np.imag((flux * incident.conj()).sum()))
    free = source.wave(receivers, k)[0]
    result = np.empty(len(receivers), complex)
    for i, p in enumerate(receivers):
        v = p - opening.x
        s = np.linalg.norm(v, axis=1)
        green = np.exp(1j * k * s) / s
        slope = -(1j * k - 1 / s) * green / s * (v * opening.w).sum(axis=1)
        result[i] = forward * (incident * slope - green * flux).sum() / (4 * np.pi)
    return result / free


def edge_factor(source: Source, points: ArrayLike, outline: Nodes, wavelength: float) -> Factors:
    """M (m,) = (1/2π) ∮ (1 - C e^{ikΔ}) dφ (eq. 6) of openings in front of `points` (m, 3).

    Loops run either way: M is taken positive where the ray passes. The ray's line must cross the
    opening between source and receiver, if it does.
    """
    everywhere = np.ones((len(np.atleast_2d(points)), len(outline.x)), bool)
    return _boundary(source, points, outline, wavelength, 1.0, everywhere)


def edge_wave(
    source: Source, points: ArrayLike, outline: Nodes, wavelength: float, visible: NDArray[np.bool_]
) -> Factors:
    """(m,) (1/2π) ∫ C e^{ikΔ} dφ over the nodes that `visible` (m, nodes) marks: eq. 5 is 1 - n plus this.

    Accurate wherever the ray passes no edge closely.
    """
    return -_boundary(source, points, outline, wavelength, 0.0, visible)


def polygon_factor(source: Source, points: ArrayLike, loop: ArrayLike, wavelength: float) -> Factors:
    """M (m,) behind an opening with corners (n, 3), by eq. 6 side by side, to about 1e-13 wherever the points are.

    The ray's line must cross the opening between source and receiver, if it does. On a side at the distance w from the
    ray, t = t_d + w sinh v takes out the pole of dφ; panels in v are halved until 20 Gauss-Legendre nodes serve each.
    """
    k = 2 * np.pi / wavelength
    corners = np.asarray(loop, float)
    receivers = np.atleast_2d(np.asarray(points, float))
    result = np.zeros(len(receivers), complex)
    for i, p in enumerate(receivers):
        for first, second in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            result[i] += _side(source, p, first, second, k) / (2 * np.pi)
    sign = np.sign(_area_vector(corners) @ _ray(source, corners.mean(axis=0)))
    return np.asarray(sign * result, complex)


def _side(source: Source, p: Reals, first: Reals, second: Reals, k: float) -> complex:
    length = float(np.linalg.norm(second - first))
    e = (second - first) / length
    a, distance = _ray(source, p), np.inf
    if isinstance(source, Spherical):
        distance = float(np.linalg.norm(a))
        a = a / distance
    h = (first - p) @ a
    q0 = first - p - h * a
    ea = float(e @ a)
    eq = e - ea * a
    eqq, kappa = float(eq @ eq), float(a @ np.cross(q0, eq))
    if kappa == 0:
        return 0
    foot, w = -float(q0 @ eq) / eqq, abs(kappa) / eqq

    def integrand(v: Reals) -> NDArray[np.complex128]:
        t, d2 = foot + w * np.sinh(v), eqq * (w * np.cosh(v)) ** 2
        z2 = -(h + t * ea)
        z1 = distance - z2
        detour = _excess(z2, d2) + (_excess(z1, d2) if np.isfinite(distance) else 0)
        c = 0.5 * (1 + _cosine(z1, z2, d2))
        return np.asarray((1 - c * np.exp(1j * k * detour)) / np.cosh(v), complex)

    x, weights = _gauss(20)

    def panels(low: Reals, high: Reals) -> NDArray[np.complex128]:
        width = (high - low)[:, None]
        return (width * weights * integrand(low[:, None] + width * x)).sum(axis=1)

    v0, v1 = np.arcsinh(-foot / w), np.arcsinh((length - foot) / w)
    ends = np.linspace(v0, v1, max(int(abs(v1 - v0) / 0.7), 2) + 1)
    low, high = ends[:-1], ends[1:]
    whole, total = panels(low, high), 0j
    while len(low):
        middle = 0.5 * (low + high)
        left, right = panels(low, middle), panels(middle, high)
        good = abs(whole - left - right) < 1e-14
        total += complex((left + right)[good].sum())
        low, high = np.concatenate([low[~good], middle[~good]]), np.concatenate([middle[~good], high[~good]])
        whole = np.concatenate([left[~good], right[~good]])
    return float(np.sign(kappa)) * total


def _ray(source: Source, x: Reals) -> Reals:
    """From the source to x, or along a plane wave."""
    return np.asarray(source.direction, float) if isinstance(source, Plane) else x - np.asarray(source.position, float)


def _area_vector(corners: Reals) -> Reals:
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)


def _boundary(
    source: Source,
    points: ArrayLike,
    outline: Nodes,
    wavelength: float,
    geometric: float,
    visible: NDArray[np.bool_],
) -> Factors:
    k = 2 * np.pi / wavelength
    receivers = np.atleast_2d(np.asarray(points, float))
    result = np.empty(len(receivers), complex)
    for i, p in enumerate(receivers):
        if isinstance(source, Plane):
            a = np.asarray(source.direction, float)
            z2 = (p - outline.x) @ a
            q = outline.x - p + z2[:, None] * a
            z1 = np.full_like(z2, np.inf)
        else:
            origin = np.asarray(source.position, float)
            distance = np.linalg.norm(p - origin)
            a = (p - origin) / distance
            z1 = (outline.x - origin) @ a
            q = outline.x - origin - z1[:, None] * a
            z2 = distance - z1
        d2 = (q * q).sum(axis=1)
        detour = _excess(z1, d2) + _excess(z2, d2)
        c = 0.5 * (1 + _cosine(z1, z2, d2))
        azimuth = np.cross(q, outline.w) @ a / d2
        integrand = (geometric - c * np.exp(1j * k * detour)) * azimuth
        result[i] = integrand[visible[i]].sum() / (2 * np.pi)
    # A loop's sense is a convention: it follows its own area vector, seen along the ray.
    middle = outline.x.mean(axis=0)
    side = np.sign(np.cross(outline.x - middle, outline.w).sum(axis=0) @ _ray(source, middle))
    return side * result


def _excess(z: Reals, d2: Reals) -> Reals:
    """√(z² + d²) - z without cancellation."""
    root = np.sqrt(z * z + d2)
    return np.where(z > 0, d2 / (root + abs(z)), root + abs(z))


def _cosine(z1: Reals, z2: Reals, d2: Reals) -> Reals:
    """cosγ = (z1 z2 - d²)/(r s), for a plane wave z2/s."""
    s = np.sqrt(z2 * z2 + d2)
    if np.isinf(z1).all():
        return z2 / s
    return (z1 * z2 - d2) / (np.sqrt(z1 * z1 + d2) * s)


def _gauss(order: int) -> tuple[Reals, Reals]:
    """Gauss-Legendre on 0..1."""
    x, w = np.polynomial.legendre.leggauss(order)
    return (x + 1) / 2, w / 2


def _affine(to_world: ArrayLike, local: Reals, weights: Reals) -> Nodes:
    matrix = np.asarray(to_world, float)
    x = local @ matrix[:3, :2].T + matrix[:3, 3]
    return Nodes(x, weights[:, None] * np.cross(matrix[:3, 0], matrix[:3, 1]))


def _circle(matrix: Reals) -> Callable[[Reals], tuple[Reals, Reals]]:
    def curve(t: Reals) -> tuple[Reals, Reals]:
        c, s = np.cos(t), np.sin(t)
        x = np.stack([c, s], axis=-1) @ matrix[:3, :2].T + matrix[:3, 3]
        return x, np.stack([-s, c], axis=-1) @ matrix[:3, :2].T

    return curve
