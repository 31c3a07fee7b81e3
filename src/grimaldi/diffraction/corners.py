"""A segment's wave from its two corners alone, each shared with a neighbour (THEORY eq. 7): one phase a segment.

Serves where the whole integral is not needed (`segment.segment_wave` has that), by one of two forms:

- short: ψ = kΔ bends by little between the corners, and the ray is several lengths away. With ψ linear and Δφ exact,
  Filon's rule (Proc. R. Soc. Edinburgh 49, 38 (1928)) gives ∫ C e^{iψ} dφ; what ψ bends by enters to first order;
- far: ψ runs one way and fast. The ends' leading terms C φ' e^{iψ}/(iψ') are all that is left (stationary phase).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from grimaldi.diffraction.arrays import Types
from grimaldi.diffraction.frame import Frame, way
from grimaldi.diffraction.segment import Corners
from grimaldi.diffraction.sines import rounded, sincos


class Corner(NamedTuple):
    """A point of an outline as a ray S→P sees it."""

    q: Any  # across the ray
    h: Any  # along it
    d2: Any  # |q|²
    along: Any  # ∇Δ along the ray
    inv: Any  # 1/r + 1/s: ∇Δ across is q times it
    C: Any
    cos: Any  # of ψ = kΔ
    sin: Any
    on_ray2: Any  # |q|² between S and P, infinite beyond
    to_p2: Any  # squared distance of P


class Ends(NamedTuple):
    """The wave between two corners, whether it serves, and a·(q × q'), which has the sign of κ."""

    real: Any
    imag: Any
    serves: Any
    turn: Any


def corner(frame: Frame, X: Any, k: Any, types: Types | None = None) -> Corner:
    """The corner X, relative to the outlines' centre, with Δ and its slope free of cancellation; rounded to other
    types at last, if there are any."""
    x = X - frame.foot
    h = dr.dot(x, frame.a)
    return seen(frame, x - h * frame.a, h, k, types)


def seen(frame: Frame, q: Any, h: Any, k: Any, types: Types | None = None) -> Corner:
    """The point at q across the ray and h along it."""
    d2 = dr.squared_norm(q)
    z2 = frame.z2 - h
    between = z2 > 0
    delta, along, inv = way(z2, d2)
    if frame.plane:
        C = 0.5 + 0.5 * z2 * inv
    else:
        z1 = frame.z1 + h
        between &= z1 > 0
        delta_r, along_r, inv_r = way(z1, d2)
        C = 0.5 + 0.5 * (z1 * z2 - d2) * inv_r * inv
        delta, along, inv = delta + delta_r, along - along_r, inv + inv_r
    on_ray2, to_p2 = dr.select(between, d2, dr.inf), dr.fma(z2, z2, d2)
    if types is None:
        sin, cos = sincos(k * delta)
        return Corner(q, h, d2, along, inv, C, cos, sin, on_ray2, to_p2)
    F = types.Float
    sin, cos = rounded((0.5 / np.pi) * k * delta, F)
    return Corner(types.Vector(q), F(h), F(d2), F(along), F(inv), F(C), cos, sin, F(on_ray2), F(to_p2))


class Slopes(NamedTuple):
    """A segment between two corners: its length², d² φ', and ψ' where it begins and ends, times the length."""

    length2: Any
    turn: Any
    a: Any
    b: Any


def slopes(ray: Any, a: Corner, b: Corner, k: Any) -> Slopes:
    """How φ and ψ = kΔ grow from corner a to b, about a ray of that direction."""
    d, h = b.q - a.q, b.h - a.h
    return Slopes(
        dr.fma(h, h, dr.squared_norm(d)),
        dr.dot(ray, dr.cross(a.q, d)),
        k * dr.fma(h, a.along, dr.dot(a.q, d) * a.inv),
        k * dr.fma(h, b.along, dr.dot(b.q, d) * b.inv),
    )


def between(ray: Any, a: Corner, b: Corner, k: Any, rule: Corners) -> Ends:
    """∫ C e^{ikΔ} dφ from corner a to b, about a ray of that direction."""
    at = slopes(ray, a, b, k)
    length2, turn, slope_a, slope_b = at
    short_real, short_imag = short(a, b, at)
    serves = is_short(a, b, at, rule)

    # far: i C φ'/ψ' e^{iψ} at a, less the same at b
    end_a = turn * a.C * dr.rcp(a.d2 * slope_a)
    end_b = turn * b.C * dr.rcp(b.d2 * slope_b)
    least = 2 * rule.far * k * length2
    is_far = (slope_a * slope_b > 0) & (dr.square(slope_a) > least * a.inv) & (dr.square(slope_b) > least * b.inv)
    return Ends(
        dr.select(serves, short_real, end_b * b.sin - end_a * a.sin),
        dr.select(serves, short_imag, end_a * a.cos - end_b * b.cos),
        serves | is_far,
        turn,
    )


def is_short(a: Corner, b: Corner, at: Slopes, rule: Corners) -> Any:
    """Whether `short` serves."""
    return (dr.abs(at.b - at.a) < rule.bend) & (at.length2 < rule.near2 * dr.minimum(a.d2, b.d2))


def short(a: Corner, b: Corner, at: Slopes) -> tuple[Any, Any]:
    """∫ C e^{ikΔ} dφ along a short segment, real and imaginary part."""
    # Δφ = atan(turn / a·b), shared out so that dφ/dt is in the ratio of 1/d²
    x = at.turn * dr.rcp(dr.dot(a.q, b.q))
    x2 = x * x
    phi = x * (1 - x2 * (1 / 3 - x2 / 5))
    share = 2 * phi * dr.rcp(a.d2 + b.d2)
    delta = 0.5 * (at.a + at.b)
    re, im = _filon(delta, dr.fma(a.cos, b.cos, a.sin * b.sin), dr.fma(b.sin, a.cos, -b.cos * a.sin))
    # -i bend/2 ∫ x(1-x) e^{iδx} dx, about the middle of the phases
    bent = (at.b - at.a) * dr.rcp(24 * dr.square(dr.fma(delta, delta * (1 / 40), 1)))
    im_a, im_b = im - bent, -im - bent
    near_a, near_b = share * b.d2 * a.C, share * a.d2 * b.C
    return (
        near_a * (re * a.cos - im_a * a.sin) + near_b * (re * b.cos - im_b * b.sin),
        near_a * (re * a.sin + im_a * a.cos) + near_b * (re * b.sin + im_b * b.cos),
    )


def by_halves(frame: Frame, a: Corner, b: Corner, k: Any, rule: Corners) -> tuple[Any, Any, Any]:
    """∫ C e^{ikΔ} dφ along two short halves of a segment, and whether they are that."""
    middle = seen(frame, 0.5 * (a.q + b.q), 0.5 * (a.h + b.h), k)
    first, second = slopes(frame.a, a, middle, k), slopes(frame.a, middle, b, k)
    (re0, im0), (re1, im1) = short(a, middle, first), short(middle, b, second)
    serves = is_short(a, middle, first, rule) & is_short(middle, b, second, rule)
    return re0 + re1, im0 + im1, serves


def leading(ray: Any, at: Corner, e: Any, k: Any) -> tuple[Any, Any]:
    """i C φ'/ψ' e^{iψ} at a corner of a line along e: what a far run sends from where it begins, less the same there
    where it stops."""
    h = dr.dot(e, ray)
    d = e - h * ray
    slope = k * dr.fma(h, at.along, dr.dot(at.q, d) * at.inv)
    size = dr.dot(ray, dr.cross(at.q, d)) * at.C / (at.d2 * slope)
    return -size * at.sin, size * at.cos


def _filon(delta: Any, cos: Any, sin: Any) -> tuple[Any, Any]:
    """∫ (1-x) e^{iδx} dx over 0..1, given e^{iδ}."""
    d2 = delta * delta
    inv = dr.rcp(d2)
    small = d2 < 0.25
    re = dr.select(small, 0.5 - d2 * (1 / 24 - d2 / 720), (1 - cos) * inv)
    im = dr.select(small, delta * (1 / 6 - d2 * (1 / 120 - d2 / 5040)), (delta - sin) * inv)
    return re, im
