"""Where rays meet surfaces, in Float64: Mitsuba's points are Float32, and their rounding may be wavelengths."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import on_device, types
from grimaldi.scene.bodies import indices, one_of, vertices
from grimaldi.scene.model import Cylinder, Disk, Joined, Mesh, Scene, Sphere

Reals = NDArray[np.float64]

FLAT, CURVED = 1.0, 2.0  # shapes of other kinds: 0
NOTHING = Mesh(np.zeros((1, 3)), np.zeros((1, 3), np.int64))

ROUNDINGS = 32  # of Float32, that Mitsuba's point may lie off the surface that it names
GRAZING = 1e-2  # sine of the angle between ray and surface below which a point may not move any further along the ray


class Hits(NamedTuple):
    """A scene's surfaces on the device: planes n·x = h, and quadrics |A x + b|² = 1 with three rows each."""

    shapes: Any  # kind, first record, records a primitive, largest coordinate; by Mitsuba's index of the shape
    count: Any
    planes: Any  # n, h
    quadrics: Any  # rows of A, b; None where there are none
    parts: Any  # numbers of the parts of joined meshes, one for each of its planes; None where there are none

    def surface(self, si: Any, active: Any) -> Any:
        """A number above 0 for each surface, the parts of joined meshes among them, that interactions lie on; else 0.

        It tells which are the same.
        """
        index: Any = dr.reinterpret_array(mi.UInt32, si.shape)
        if self.parts is None:
            return dr.select(active, index, 0)
        known = active & (index < self.count)
        shape = dr.gather(types(double=True).Packet, self.shapes, index, known)
        part = dr.gather(mi.UInt32, self.parts, mi.UInt32(shape.y) + si.prim_index, known & (shape.x == FLAT))
        return dr.select(active, dr.select(part > 0, part, index), 0)

    def point(self, ray: Any, si: Any, active: Any) -> Any:
        """The point (`mi.Point3d`) where a ray meets the surface that Mitsuba's interaction names.

        The ray's Float32 numbers count as exact. Mitsuba's own point is kept on shapes of other kinds, and where
        the surface is not within Float32's rounding of it. Rays: `mi.Ray3f`, interactions: `mi.SurfaceInteraction3f`.
        """
        double = types(double=True)
        F, V, P = double.Float, double.Vector, double.Packet
        index: Any = dr.reinterpret_array(mi.UInt32, si.shape)
        active = active & (index < self.count)
        shape = dr.gather(P, self.shapes, index, active)
        record = mi.UInt32(shape.y) + mi.UInt32(shape.z) * si.prim_index
        o, d, t = V(ray.o), V(ray.d), F(si.t)
        x = dr.fma(t, d, o)

        # the surface is met s further along the ray, where a s² + 2 b s + c = 0; what is not gathered is 0
        plane = dr.gather(P, self.planes, record, active & (shape.x == FLAT))
        n = V(plane.x, plane.y, plane.z)
        a, b, c = F(0), 0.5 * dr.dot(n, d), dr.dot(n, x) - plane.w - dr.select(shape.x == CURVED, F(1), 0)
        for i in range(3) if self.quadrics is not None else ():
            row = dr.gather(P, self.quadrics, 3 * record + i, active & (shape.x == CURVED))
            A = V(row.x, row.y, row.z)
            y, e = dr.dot(A, x) + row.w, dr.dot(A, d)
            a, b, c = dr.fma(e, e, a), dr.fma(y, e, b), dr.fma(y, y, c)
        b += b if self.quadrics is None else dr.mulsign(dr.sqrt(b * b - a * c), b)
        s = F(mi.Float(-c) / mi.Float(b))  # no more than Float32's rounding of the way: its own is far below

        scale = dr.max(dr.abs(o)) + shape.w + t
        sine = dr.maximum(dr.abs(dr.dot(si.n, ray.d)), GRAZING)
        near = dr.abs(s) * sine <= ROUNDINGS * dr.epsilon(mi.Float) * scale  # false for NaN: met nowhere
        return mi.Point3d(dr.select(active & near, dr.fma(s, d, x), V(si.p)))


def hits(scene: Scene) -> Hits:
    """All surfaces of a scene that are flat or quadrics, for the Mitsuba variant in use."""
    index = indices(scene.mitsuba)
    shapes = np.zeros((int(index.max(initial=0)) + 1, 4))
    flat, quadrics = [NOTHING], [np.zeros((0, 3, 4))]  # the device cannot gather from nothing
    parts, count = [np.zeros(1, int)], len(shapes)
    faces = 1
    for i, surface in zip(index, scene.surfaces, strict=True):
        if surface is None:
            continue
        reach = np.abs(vertices(surface)).max()
        if isinstance(surface, (Mesh, Disk)):
            shapes[i] = FLAT, faces, isinstance(surface, Mesh), reach
            flat.append(surface if isinstance(surface, Mesh) else _triangle(surface))
            faces += len(flat[-1].faces)
            if isinstance(surface, Joined):
                of_each = np.diff(surface.begin)
                parts.append(count + np.repeat(np.arange(len(of_each)), of_each))
                count += len(of_each)
            else:
                parts.append(np.zeros(len(flat[-1].faces), int))
        else:
            shapes[i] = CURVED, len(quadrics) - 1, 0, reach
            quadrics.append(_quadric(surface))
    buffer = types(double=True).buffer
    return Hits(
        buffer(shapes),
        on_device(mi.UInt32, len(shapes)),
        _planes(one_of(flat)),
        buffer(np.concatenate(quadrics)) if len(quadrics) > 1 else None,
        mi.UInt32(np.concatenate(parts).astype(np.uint32)) if count > len(shapes) else None,
    )


def _triangle(disk: Disk) -> Mesh:
    """One in its plane."""
    X, Y, _, origin = disk.to_world[:3].T
    return Mesh(np.stack([origin, origin + X, origin + Y]), np.array([[0, 1, 2]]))


def _planes(mesh: Mesh) -> Any:
    """Unit normal and h of each face, as packets; NaN where its corners lie in line."""
    double = types(double=True)
    F, V, P = double.Float, double.Vector, double.Packet
    corners, faces = double.buffer(mesh.vertices), mi.UInt32(mesh.faces.astype(np.uint32).ravel())
    i = dr.arange(mi.UInt32, len(mesh.faces))
    a, b, c = (dr.gather(V, corners, dr.gather(mi.UInt32, faces, 3 * i + corner)) for corner in range(3))
    n = dr.cross(b - a, c - a)
    size = dr.norm(n)
    n = n * dr.rcp(dr.maximum(size, 1e-300))
    planes = dr.zeros(F, 4 * len(mesh.faces))
    dr.scatter(planes, P(n.x, n.y, n.z, dr.select(size > 0, dr.dot(n, a), dr.nan)), i)
    dr.eval(planes)
    return planes


def _quadric(surface: Sphere | Cylinder) -> Reals:
    """The map (1, 3, 4) of the surface to |x|² = 1; NaN where it is flattened. A tube's does not see along its axis."""
    if isinstance(surface, Sphere):
        A, origin = np.eye(3) / surface.radius, surface.centre
    else:
        X, Y, Z, origin = surface.to_world[:3].T
        with np.errstate(divide="ignore", invalid="ignore"):
            A = np.stack([np.cross(Y, Z), np.cross(Z, X), np.zeros(3)]) / np.linalg.det(surface.to_world[:3, :3])
    return np.column_stack([A, -A @ origin])[None]
