"""Holes: circles, rectangles, slits, polygons, near and far."""

from __future__ import annotations

import numpy as np

import grimaldi
from grimaldi.reference import airy, lommel, rectangle, slit
from grimaldi.reference import circle as reference
from grimaldi.validation.computing import K, box, circle, difference, factor, line, paraxial
from grimaldi.validation.model import Case, Curve

OFFSET = "x across the axis [λ]"


def hole_on_axis() -> Case:
    """a = 12 λ from 2 λ to 3,000 λ behind it."""
    z, tolerance = np.geomspace(2, 3e3, 201), 1e-9
    m, seconds = factor(line(0 * z, z), tolerance, outlines=[circle(12)])
    expected = reference.kirchhoff(12, z, 1)
    return Case(
        "hole-on-axis",
        "exact",
        "circle.kirchhoff",
        difference(m, expected),
        tolerance,
        0.0,
        seconds,
        "a = 12 λ, plane wave, on the axis from 2 λ to 3000 λ behind",
        Curve(np.log10(z), m, expected, "log₁₀ z/λ", "M"),
    )


def hole_by_area() -> Case:
    """a = 12 λ in a point source's light, off its axis, by brute force over its area."""
    x, tolerance = np.linspace(-24, 24, 121), 1e-9
    points = line(x, 60, 0.7)
    m, seconds = factor(points, tolerance, outlines=[circle(12)], source_distance=40)
    expected = reference.kirchhoff_area(12, points, 1, 40)
    return Case(
        "hole-by-area",
        "exact",
        "circle.kirchhoff_area",
        difference(m, expected),
        tolerance,
        0.0,
        seconds,
        "a = 12 λ, source 40 λ before and receivers 60 λ behind, through the shadow's rim",
        Curve(x, m, expected, OFFSET, "M"),
    )


def hole_near() -> Case:
    """A hole of 5 λ with receivers 2 λ behind it: nothing is paraxial here."""
    x, tolerance = np.linspace(-8, 8, 121), 1e-10
    points = line(x, 2, 0.3)
    m, seconds = factor(points, tolerance, outlines=[circle(5)])
    expected = reference.kirchhoff_area(5, points, 1)
    return Case(
        "hole-near",
        "exact",
        "circle.kirchhoff_area",
        difference(m, expected),
        tolerance,
        0.0,
        seconds,
        "a = 5 λ, plane wave, receivers 2 λ behind: nothing is paraxial",
        Curve(x, m, expected, OFFSET, "M"),
    )


def lommel_hole() -> Case:
    """Fresnel's number 4 for a point source, from the axis into the shadow."""
    z, tolerance = 1e11, 1e-8
    a = np.sqrt(2 * z)
    rho = np.linspace(0, 2, 121) * a  # in the hole's plane; twice that at the receivers
    m, seconds = factor(line(2 * rho, z), tolerance, outlines=[circle(a)], source_distance=z)
    expected = lommel.hole(a, rho, z, 1, z)
    return Case(
        "lommel-hole",
        "Fresnel",
        "lommel.hole",
        difference(m, expected),
        tolerance,
        2 * paraxial(3 * a, z),
        seconds,
        f"N = 4, source and receivers {z:g} λ away, to twice the radius",
        Curve(rho / a, m, expected, "ρ/a", "M"),
    )


def rectangle_hole() -> Case:
    """A rectangle beside whose middle the receivers pass."""
    z, tolerance = 1e9, 1e-8
    w, h = 2 * np.sqrt(z), 1.4 * np.sqrt(z)
    x, y = np.linspace(-1, 1, 121) * w, 0.3 * w
    m, seconds = factor(line(x, z, y), tolerance, outlines=[box(w, h)])
    expected = rectangle.factor(w, h, x, y, z, 1)
    return Case(
        "rectangle",
        "Fresnel",
        "rectangle.factor",
        difference(m, expected),
        tolerance,
        paraxial(float(np.hypot(1.5 * w, y + h / 2)), z),
        seconds,
        f"2 by 1.4 √(λz), z = {z:g} λ, through its rim",
        Curve(x / np.sqrt(z), m, expected, "x/√(λz)", "M"),
    )


def single_slit() -> Case:
    return _slits("slit", 1)


def several_slits() -> Case:
    return _slits("slits", 5)


def _slits(name: str, count: int) -> Case:
    """Slits 12.5 widths long: their length is the other factor of the product."""
    z, tolerance = 1e11, 1e-8
    width, spacing = 0.8 * np.sqrt(z), 2 * np.sqrt(z)
    length = 10 * np.sqrt(z)
    middles = spacing * (np.arange(count) - (count - 1) / 2)
    far = middles[-1] + width
    x = np.linspace(-1.5, 1.5, 401 * count) * far
    m, seconds = factor(line(x, z), tolerance, outlines=[box(width, length, c) for c in middles])
    expected = slit.several(count, width, spacing, x, z, 1) * slit.factor(length, 0.0, z, 1)
    each = "a slit" if count == 1 else f"{count} slits 2 √(λz) apart,"
    return Case(
        name,
        "Fresnel",
        "slit.factor" if count == 1 else "slit.several",
        difference(m, expected),
        tolerance,
        paraxial(float(np.hypot(2.5 * far, length / 2)), z),
        seconds,
        f"{each} 0.8 √(λz) wide and 10 √(λz) long, z = {z:g} λ; the length is the product's other factor",
        Curve(x / np.sqrt(z), m, expected, "x/√(λz)", "M"),
    )


def airy_rings() -> Case:
    """A hole of 50 λ from so far away that N = 1e-4."""
    a, z, tolerance = 50.0, 2.5e7, 1e-10
    w = np.linspace(0, 16, 161)
    rho = z * np.tan(np.arcsin(w / (K * a)))
    m, seconds = factor(line(rho, z), tolerance, outlines=[circle(a)])
    expected = airy.factor(a, rho, z, 1)
    axis = float(abs(expected[0]))
    return Case(
        "airy",
        "far field",
        "airy.factor",
        difference(m, expected),
        tolerance,
        0.5 * axis**2,
        seconds,
        f"N = 1e-4: the remainder (πN)²/2 is {0.5 * axis:.1g} of the axis' |M| = {axis:.2g}",
        Curve(w, m, expected, "k a sinθ", "M", is_logarithmic=True),
    )


def kite() -> Case:
    return _polygon("kite", np.array([[0, -11], [6, 0], [0, 5], [-6, 0]], float))


def star() -> Case:
    angle = np.pi / 5 * np.arange(10)
    radius = np.where(np.arange(10) % 2, 4.0, 10.0)
    return _polygon("star", np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))


def _polygon(name: str, corners: np.ndarray) -> Case:
    """A polygon by its outline and by its area."""
    x, tolerance = np.linspace(-20, 20, 121), 1e-9
    points, outline = line(x, 30, 1.3), [grimaldi.PlanarOutline(corners)]
    m, seconds = factor(points, tolerance, outlines=outline)
    expected = factor(points, tolerance, outlines=outline, diffraction="area").m
    return Case(
        name,
        "exact",
        "diffraction='area'",
        difference(m, expected),
        tolerance,
        0.0,
        seconds,
        f"{len(corners)} corners, about 10 λ, plane wave, 30 λ behind",
        Curve(x, m, expected, OFFSET, "M"),
    )
