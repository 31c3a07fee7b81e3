"""Straight edges: one, one with boundary conditions, two behind each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from grimaldi.reference import double_edge, fresnel_edge
from grimaldi.reference import half_plane as sommerfeld
from grimaldi.validation.computing import K, difference, factor, half_plane, line, paraxial, rms
from grimaldi.validation.model import Case, Curve

FAR = 1e9  # of the receivers [λ]
SIZE = 1e8  # of the mask that stands for a half plane [λ]


def edge() -> Case:
    """A half plane's edge, from the light into the shadow."""
    v, tolerance = np.linspace(-3, 3, 121), 1e-8
    x = v * np.sqrt(FAR / 2)
    m, seconds = factor(line(x, FAR), tolerance, outlines=[half_plane(SIZE)])
    expected = fresnel_edge.factor(v)
    ends = 2 * FAR / (4 * np.pi**2 * SIZE**2)
    return Case(
        "edge",
        "Fresnel",
        "fresnel_edge.factor",
        difference(m, expected),
        tolerance,
        paraxial(float(x.max()), FAR) + ends,
        seconds,
        f"plane wave, z = {FAR:g} λ, v from -3 to 3",
        Curve(v, m, expected, "Fresnel's v", "M"),
    )


def sommerfeld_soft() -> Case:
    return _sommerfeld("soft")


def sommerfeld_hard() -> Case:
    return _sommerfeld("hard")


def _sommerfeld(boundary: sommerfeld.Boundary) -> Case:
    """A black screen against one with boundary conditions: at 10 λ, where it is plotted, and at 100 λ."""
    tolerance, errors, total = 1e-8, [], 0.0
    x = np.linspace(-8, 8, 801)
    for z in (100.0, 10.0):
        at = x * np.sqrt(z)
        m, seconds = factor(line(at, z), tolerance, outlines=[half_plane(1e6)])
        expected = sommerfeld.field(at, z, 1, boundary) * np.exp(-1j * K * z)
        errors.append(difference(m, expected))
        total += seconds
    return Case(
        f"sommerfeld-{boundary}",
        "other model",
        "half_plane.field",
        errors[1],
        tolerance,
        0.0,
        total,
        f"a black half plane is {errors[1]:.2g} from a {boundary} one 10 λ behind it, {errors[0]:.2g} at 100 λ",
        Curve(x * np.sqrt(10), m, expected, "x [λ], shadow right", "M"),
    )


def double_knife_edge() -> Case:
    """The wave of one edge past another against the double integral: edges 20 λ out of line, and in line."""
    x, tolerance = np.linspace(-120, 60, 181) + 0.25, 1e-5
    points, apart = line(x, 1000), 1000.0
    aligned, more = factor(points, tolerance, bodies=_screens(0.0, 0.0, apart))
    in_line = difference(aligned, double_edge.factor(0, 0, apart, x, 1000, 1))
    m, seconds = factor(points, tolerance, bodies=_screens(0.0, 20.0, apart))
    expected = double_edge.factor(0, 20, apart, x, 1000, 1)
    return Case(
        "double-edge",
        "other model",
        "double_edge.factor",
        difference(m, expected),
        tolerance,
        0.0,
        seconds + more,
        f"one edge past another, {apart:g} λ apart and 20 λ out of line, is rms {rms(m, expected):.2g} from double "
        f"diffraction; up to {in_line:.2g} where they are in line",
        Curve(x, m, expected, "x [λ], shadow right", "M"),
    )


def _screens(first: float, second: float, apart: float) -> dict[str, Any]:
    return {"first": _screen(first, -apart), "second": _screen(second, 0.0)}


def _screen(edge: float, z: float) -> dict[str, Any]:
    """An opaque square of half side 2^16 λ with one side at x = edge, to Float32's last bit."""
    import mitsuba as mi

    scalar: Any = mi.scalar_rgb
    half = 2.0**16
    transform = scalar.ScalarTransform4f().translate([edge + half, 0, z]).scale([half, half, 1])
    return {"type": "rectangle", "to_world": transform}
