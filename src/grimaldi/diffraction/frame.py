"""The ray from a source to a point, seen from the outlines: computed in Float64, used in either precision."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from grimaldi.diffraction.arrays import Types, on_device, types
from grimaldi.diffraction.sines import rounded
from grimaldi.scene.model import Source, Spot, Vector
from grimaldi.scene.planar import PlanarOutline

if TYPE_CHECKING:
    from grimaldi.diffraction.table import Table

HORIZON = 1e-4  # sine of the angle over a receiver's surface, above which it hears what an outline sends
ROUNDINGS = 32  # by which a ray is moved aside: what edges that meet in a corner may differ in
ASIDE = (0.36161, 0.48757, 0.79467)  # no direction in which people place corners


class Frame(NamedTuple):
    """The ray S→P as Dr.Jit arrays, seen from its foot near the outlines."""

    a: Any  # unit direction
    foot: Any  # foot of the outlines' centre on the ray, relative to the centre
    z1: Any  # along the ray from S to the foot; unused for a plane wave
    z2: Any  # from the foot to P
    lever: Any  # what its rounding is relative to
    plane: bool
    exact: Any = None  # the same one in the precision of phases, if that is another


class Frames(NamedTuple):
    """Frames of many rays as three packets each, which are read sooner than their nine numbers."""

    packets: Any
    types: Types
    plane: bool

    @staticmethod
    def of(fr: Frame, n: int, types: Types) -> Frames:
        """Those of n rays, evaluated."""
        index = dr.arange(dr.uint32_array_t(types.Float), n)
        packets = dr.zeros(types.Float, 12 * n)
        for j, numbers in enumerate(((*fr.a, fr.z1), (*fr.foot, fr.z2), (fr.lever, 0, 0, 0))):
            dr.scatter(packets, types.Packet(*numbers), 3 * index + j)
        dr.eval(packets)
        return Frames(packets, types, fr.plane)

    def some(self, index: Any) -> Frame:
        """Those at places of the arrays."""
        V, (a, b, c) = self.types.Vector, (dr.gather(self.types.Packet, self.packets, 3 * index + j) for j in range(3))
        return Frame(V(a.x, a.y, a.z), V(b.x, b.y, b.z), a.w, b.w, c.x, self.plane)


def constant(Vector3: Any, v: Vector) -> Any:
    """A NumPy vector as a Dr.Jit one, no part of the kernel: another scene runs the same."""
    return Vector3(*(on_device(dr.value_t(Vector3), float(x)) for x in v))


def frame(source: Source, p: Any, table: Table, screen: PlanarOutline | None = None) -> Frame:
    """The frame of every ray source → p (Float64), about the outlines' centre, in the precision of their table.

    screen: where all outlines lie in one plane, one of them: nothing is then nearer to the ray than that plane.

    The cancellation q = X - S - z1 a is done here, against the foot of the centre on the ray, so that Float32
    coordinates stay small however far S and P are (THEORY 2, "Consequences"). The ray is moved aside by what
    rounding leaves open: through a corner exactly, the edges that meet there could not agree on its side.
    """
    V, out = types(double=True).Vector, table.types
    c, reach = constant(V, table.centre), on_device(dr.value_t(V), table.reach)
    if source.is_plane:
        assert source.direction is not None
        a = constant(V, source.direction)
        z1 = type(p.x)(0)
        z2 = dr.dot(p - c, a)
        z2 = dr.select(dr.abs(z2) < reach, 0, z2)  # beside P count from P itself
        foot = p - c - z2 * a
    else:
        assert source.position is not None
        s = constant(V, source.position)
        d = p - s
        distance = dr.norm(d)
        a = d / distance
        z2 = dr.dot(p - c, a)
        z2 = dr.select(dr.abs(z2) < reach, 0, z2)  # beside P count from P itself
        z1 = distance - z2
        z1 = dr.select(dr.abs(z1) < reach, 0, z1)  # and beside S from there
        z2 = distance - z1
        foot = dr.select(z1 == 0, s - c, p - c - z2 * a)
    lever = reach + dr.norm(foot)
    if screen is not None and dr.itemsize_v(out.precise.Float) == 8:
        normal = constant(V, screen.normal)
        along = dr.dot(p - constant(V, screen.origin), normal) / dr.dot(a, normal)
        lever = dr.minimum(lever, dr.abs(along))
    aside = constant(V, ROUNDINGS * dr.epsilon(out.precise.Float) * np.array(ASIDE))
    foot += lever * (aside - dr.dot(aside, a) * a)
    exact = Frame(a, foot, z1, z2, lever, source.is_plane)
    numbers = out.Vector(a), out.Vector(foot), out.Float(z1), out.Float(z2), out.Float(lever)
    return Frame(*numbers, source.is_plane, exact if out.phases else None)


def way(z: Any, d2: Any) -> tuple[Any, Any, Any]:
    """√(z² + d²) - z without cancellation, the same over √(z² + d²), and 1/√(z² + d²)."""
    length2 = dr.maximum(dr.fma(z, z, d2), 1e-30)
    inv = dr.rsqrt(length2)
    reach = length2 * inv + dr.abs(z)
    excess = dr.select(z > 0, d2 * dr.rcp(reach), reach)
    return excess, excess * inv, inv


def incident(source: Source, p: Any, k: float, precision: Types) -> tuple[Any, Any, Any]:
    """U0 at p by eq. 1-2: its modulus, cosine and sine of its phase, which is reduced in the precision of p."""
    V, F = type(p), precision.Float
    modulus = on_device(F, source.amplitude)
    if source.is_plane:
        assert source.direction is not None
        path = dr.dot(p - constant(V, source.origin), constant(V, source.direction))
    else:
        assert source.position is not None
        d = p - constant(V, source.position)
        path = dr.norm(d)
        modulus /= F(path)
        if source.spot is not None:
            modulus *= F(dr.sqrt(profile(source.spot, d / path)))
    turns = path * on_device(type(path), k / (2 * np.pi)) + on_device(type(path), source.phase / (2 * np.pi))
    sin, cos = rounded(turns, F)
    return modulus, cos, sin


def profile(spot: Spot, d: Any) -> Any:
    """The share of a spot's intensity that goes along unit vectors d: Mitsuba's own."""
    angle = dr.safe_acos(dr.dot(d, constant(type(d), spot.axis)))
    return dr.clip((spot.cutoff - angle) / max(spot.cutoff - spot.beam_width, 1e-12), 0, 1)


def toward(source: Source, p: Any) -> Any:
    """Unit vectors (Float32) from points to a source."""
    if source.position is not None:
        return dr.normalize(constant(mi.Point3f, source.position) - p)
    assert source.direction is not None
    return constant(mi.Vector3f, -source.direction)
