"""Discs, and Poisson's spot."""

from __future__ import annotations

import numpy as np

from grimaldi.reference import arago, lommel
from grimaldi.validation.computing import circle, difference, factor, line, paraxial
from grimaldi.validation.model import Case, Curve

HEIGHTS = np.geomspace(2, 3e3, 201)


def spot() -> Case:
    """On the axis of a disc, by Kirchhoff's integral."""
    tolerance = 1e-9
    m, seconds = factor(line(0 * HEIGHTS, HEIGHTS), tolerance, outlines=[circle(12, hole=False)])
    expected = arago.kirchhoff(12, HEIGHTS, 1)
    return Case(
        "arago",
        "exact",
        "arago.kirchhoff",
        difference(m, expected),
        tolerance,
        0.0,
        seconds,
        "a = 12 λ, plane wave, on the axis from 2 λ to 3000 λ behind",
        Curve(np.log10(HEIGHTS), m, expected, "log₁₀ z/λ", "M"),
    )


def spot_rayleigh_sommerfeld() -> Case:
    """The same spot by the first Rayleigh-Sommerfeld integral, which sets U itself to 0 on the disc."""
    tolerance = 1e-9
    m, seconds = factor(line(0 * HEIGHTS, HEIGHTS), tolerance, outlines=[circle(12, hole=False)])
    computed, expected = np.square(abs(m)), arago.rayleigh_sommerfeld(12, HEIGHTS)
    apart = abs(computed - expected)
    return Case(
        "arago-rs",
        "other model",
        "arago.rayleigh_sommerfeld",
        difference(computed, expected),
        tolerance,
        0.0,
        seconds,
        f"of I/I₀ by Rayleigh and Sommerfeld; {float(np.interp(120, HEIGHTS, apart)):.2g} ten radii behind",
        Curve(np.log10(HEIGHTS), computed, expected, "log₁₀ z/λ", "I/I₀"),
    )


def lommel_disc() -> Case:
    """A disc of Fresnel's number 4 in a plane wave, from the spot into the light."""
    z, tolerance = 1e11, 1e-8
    a = np.sqrt(4 * z)
    rho = np.linspace(0, 2, 121) * a
    m, seconds = factor(line(rho, z), tolerance, outlines=[circle(a, hole=False)])
    expected = lommel.disc(a, rho, z, 1)
    return Case(
        "lommel-disc",
        "Fresnel",
        "lommel.disc",
        difference(m, expected),
        tolerance,
        paraxial(3 * a, z),
        seconds,
        f"N = 4, plane wave, z = {z:g} λ, to twice the radius",
        Curve(rho / a, m, expected, "ρ/a", "M"),
    )
