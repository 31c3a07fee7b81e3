"""The surfaces that Kirchhoff's area integral runs over: openings, or what the source sees of opaque bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import types
from grimaldi.outlines.candidate import toward
from grimaldi.outlines.cylinder import strip
from grimaldi.outlines.sphere import across, tangent_circle
from grimaldi.scene.model import Cylinder, Disk, Geometry, Mesh, Source, Sphere
from grimaldi.scene.planar import PlanarOutline

Reals = NDArray[np.float64]

TRIANGLE, ELLIPSE, CAP = 0.0, 1.0, 2.0


@dataclass(frozen=True, eq=False)
class Patches:
    """Pieces of surface over the unit square (u, v), m of them.

    A triangle is origin + u ((1-v) X + v Y), an ellipse origin + u (cos 2πv X + sin 2πv Y), a spherical cap
    origin + sin θ (cos 2πv X + sin 2πv Y) + cos θ Z with θ = u·widest. All are turned away from the source.
    """

    kind: Reals  # (m,)
    origin: Reals  # (m, 3)
    X: Reals  # (m, 3)
    Y: Reals  # (m, 3)
    Z: Reals  # (m, 3) a cap's pole, towards the source; else the area element of u = 1
    widest: Reals  # (m,) θ of a cap's rim [rad]

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def areas(self) -> Reals:
        """(m,)"""
        radius2 = (self.Z**2).sum(1)
        return np.where(self.kind == CAP, 2 * np.pi * radius2 * (1 - np.cos(self.widest)), 0.5 * np.sqrt(radius2))

    @property
    def sizes(self) -> tuple[Reals, Reals]:
        """The greatest lengths (m,) along u and along v."""
        x, y = np.linalg.norm(self.X, axis=1), np.linalg.norm(self.Y, axis=1)
        along = np.where(self.kind == CAP, x * self.widest, np.maximum(x, y))
        round_ = np.where(self.kind == CAP, 2 * np.pi * x, 2 * np.pi * np.maximum(x, y))
        return along, np.where(self.kind == TRIANGLE, np.linalg.norm(self.Y - self.X, axis=1), round_)


def opening(screen: Sequence[PlanarOutline], source: Source) -> Patches:
    """What coplanar holes leave open, or masks cover."""
    return _joined([_planar(shape, source) for shape in screen])


def lit_surface(shapes: Sequence[Geometry], source: Source) -> Patches:
    """The surfaces of bodies, as far as they can be seen from the source but for what stands between."""
    return _joined([_body(shape, source) for shape in shapes])


def _joined(parts: Sequence[Patches]) -> Patches:
    none = np.empty((0, 3))
    parts = [Patches(none[:, 0], none, none, none, none, none[:, 0]), *parts]
    return Patches(
        *(np.concatenate([getattr(p, f) for p in parts]) for f in ("kind", "origin", "X", "Y", "Z", "widest"))
    )


def _planar(shape: PlanarOutline, source: Source) -> Patches:
    import shapely

    if shape.is_ellipse:
        return _ellipse(shape.to_world, source)
    rings = [shapely.Polygon(loop) for loop in shape.loops]
    region = reduce(shapely.symmetric_difference, rings)  # even-odd: a loop within a loop is an island
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(region))
    corners = np.stack([shapely.get_coordinates(triangle)[:3] for triangle in triangles])
    return _triangles(corners @ shape.to_world[:3, :2].T + shape.origin, source)


def _body(shape: Geometry, source: Source) -> Patches:
    if isinstance(shape, Mesh):
        return _triangles(shape.vertices[shape.faces], source)
    if isinstance(shape, Cylinder):
        return _body(strip(shape, source, 1e-5 * float(np.linalg.norm(shape.to_world[:3, :2]))), source)
    if isinstance(shape, Disk):
        return _ellipse(shape.to_world, source)
    return _cap(shape, source)


def _triangles(corners: Reals, source: Source) -> Patches:
    """Of corners (m, 3, 3), the vertex opposite the shortest side first: no cell is then long and thin."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1), axis=2)
    order = (sides.argmin(axis=1)[:, None] + np.arange(3)) % 3
    origin, A, B = np.moveaxis(np.take_along_axis(corners, order[:, :, None], axis=1), 1, 0)
    area = _away(np.cross(A - origin, B - origin), corners.mean(axis=1), source)
    some = (area != 0).any(axis=1)
    n = int(some.sum())
    return Patches(np.full(n, TRIANGLE), origin[some], (A - origin)[some], (B - origin)[some], area[some], np.zeros(n))


def _ellipse(to_world: Reals, source: Source) -> Patches:
    X, Y, origin = to_world[None, :3, 0], to_world[None, :3, 1], to_world[None, :3, 3]
    area = _away(2 * np.pi * np.cross(X, Y), origin, source)
    return Patches(np.array([ELLIPSE]), origin, X, Y, area, np.zeros(1))


def _cap(sphere: Sphere, source: Source) -> Patches:
    centre, radius, axis = tangent_circle(sphere, source)
    x, y = (sphere.radius * v[None] for v in across(axis))
    height = float((sphere.centre - centre) @ axis)
    widest = np.arctan2(radius, height)
    return Patches(np.array([CAP]), sphere.centre[None], x, y, -sphere.radius * axis[None], np.array([widest]))


def _away(area: Reals, x: Reals, source: Source) -> Reals:
    """Area vectors (m, 3) at x turned away from the source."""
    light = -toward(source, x)
    return np.where(((area * light).sum(1) < 0)[:, None], -area, area)


class Surface(NamedTuple):
    """Patches on the device, in Float64."""

    records: Any

    @staticmethod
    def of(patches: Patches) -> Surface:
        rows = [patches.origin, patches.kind[:, None], patches.X, patches.widest[:, None], patches.Y]
        zero = np.zeros((len(patches), 1))
        return Surface(types(double=True).buffer(np.concatenate([*rows, zero, patches.Z, zero], axis=1)))

    def at(self, patch: Any, u: Any, v: Any) -> tuple[Any, Any]:
        """The point and the area element, a vector away from the source, per du dv."""
        double = types(double=True)
        V = double.Vector
        a, b, c, d = (dr.gather(double.Packet, self.records, 4 * patch + j) for j in range(4))
        origin, X, Y, Z = V(a.x, a.y, a.z), V(b.x, b.y, b.z), V(c.x, c.y, c.z), V(d.x, d.y, d.z)
        sin, cos = dr.sincos(2 * np.pi * v)
        triangle, cap = a.w == TRIANGLE, a.w == CAP
        along = dr.select(triangle, 1 - v, cos) * X + dr.select(triangle, v, sin) * Y
        theta = u * b.w
        round_ = dr.sin(theta) * along + dr.cos(theta) * Z
        x = origin + dr.select(cap, round_, u * along)
        element = dr.select(cap, -2 * np.pi * b.w * dr.sin(theta) * dr.norm(Z) * round_, u * Z)
        return x, element

    def uniform(self, patch: Any, u: Any, v: Any) -> tuple[Any, Any]:
        """The same where the patch is covered evenly: every du dv has the same area."""
        b = dr.gather(types(double=True).Packet, self.records, 4 * patch + 1)
        kind = dr.gather(types(double=True).Packet, self.records, 4 * patch).w
        cap = kind == CAP
        theta = 2 * dr.asin(dr.sqrt(u) * dr.sin(0.5 * b.w))  # 1 - cos θ grows evenly
        root = dr.sqrt(u)
        x, element = self.at(patch, dr.select(cap, theta / dr.maximum(b.w, 1e-300), root), v)
        # dθ/du and d√u/du
        slope = dr.select(cap, 2 * dr.square(dr.sin(0.5 * b.w)) / dr.maximum(dr.sin(theta) * b.w, 1e-300), 0.5 / root)
        return x, element * slope
