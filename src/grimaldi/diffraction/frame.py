"""The ray from a source to a point, seen from the outlines: computed in Float64, used in either precision."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from grimaldi.diffraction.arrays import types
from grimaldi.scene.model import Source, Spot, Vector

if TYPE_CHECKING:
    from grimaldi.diffraction.table import Table

ASIDE = (0.36161, 0.48757, 0.79467)  # no direction in which people place corners


class Frame(NamedTuple):
    """The ray S→P as Dr.Jit arrays, seen from its foot near the outlines."""

    a: Any  # unit direction
    foot: Any  # foot of the outlines' centre on the ray, relative to the centre
    z1: Any  # along the ray from S to the foot; unused for a plane wave
    z2: Any  # from the foot to P
    plane: bool


def constant(Vector3: Any, v: Vector) -> Any:
    """A NumPy vector as a Dr.Jit one."""
    return Vector3(*(float(x) for x in v))


def frame(source: Source, p: Any, table: Table) -> Frame:
    """The frame of every ray source → p (Float64), about the outlines' centre, in the precision of their table.

    The cancellation q = X - S - z1 a is done here, against the foot of the centre on the ray, so that Float32
    coordinates stay small however far S and P are (THEORY 2, "Consequences"). The ray is moved aside by what
    rounding leaves open: through a corner exactly, the edges that meet there could not agree on its side.
    """
    V, out = types(double=True).Vector, table.types
    c = constant(V, table.centre)
    if source.is_plane:
        assert source.direction is not None
        a = constant(V, source.direction)
        z1 = type(p.x)(0)
        z2 = dr.dot(p - c, a)
        foot = p - z2 * a - c
    else:
        assert source.position is not None
        s = constant(V, source.position)
        d = p - s
        distance = dr.norm(d)
        a = d / distance
        z1 = dr.dot(c - s, a)
        z2 = distance - z1
        foot = s - c + z1 * a
    aside = constant(V, (1e-12 if dr.itemsize_v(out.Float) == 8 else 5e-7) * np.array(ASIDE))
    foot += (table.reach + dr.norm(foot)) * (aside - dr.dot(aside, a) * a)
    return Frame(out.Vector(a), out.Vector(foot), out.Float(z1), out.Float(z2), source.is_plane)


def incident(source: Source, p: Any, k: float) -> tuple[Any, Any, Any]:
    """U0 at p (Float64) by eq. 1-2: its modulus, cosine and sine of its phase, reduced in Float64."""
    V = types(double=True).Vector
    if source.is_plane:
        assert source.direction is not None
        path = dr.dot(p - constant(V, source.origin), constant(V, source.direction))
        modulus = type(path)(source.amplitude)
    else:
        assert source.position is not None
        d = p - constant(V, source.position)
        path = dr.norm(d)
        modulus = source.amplitude / path
        if source.spot is not None:
            modulus *= dr.sqrt(profile(source.spot, d / path))
    turns = path * (k / (2 * np.pi))
    phase = 2 * np.pi * (turns - dr.round(turns)) + source.phase
    sin, cos = dr.sincos(phase)
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
