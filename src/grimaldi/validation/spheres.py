"""Spheres: a black outline against partial waves. Statements about the model."""

from __future__ import annotations

import numpy as np

from grimaldi.reference import sphere
from grimaldi.validation.computing import K, difference, factor, line, rms
from grimaldi.validation.model import Case, Curve

SIZE = 200.0  # ka
BEHIND = 10.0  # radii


def soft() -> Case:
    return _sphere("soft")


def hard() -> Case:
    return _sphere("hard")


def absorbing() -> Case:
    return _sphere("absorbing")


def _sphere(boundary: sphere.Boundary) -> Case:
    radius, tolerance = SIZE / K, 1e-6
    x = np.linspace(-2, 2, 201) * radius
    points = line(x, BEHIND * radius)
    m, seconds = factor(points, tolerance, bodies={"ball": {"type": "sphere", "radius": radius}})
    expected = sphere.field(points, radius, 1, boundary) * np.exp(-1j * K * points[:, 2])
    middle = len(x) // 2
    ratio = float(abs(m[middle] / expected[middle]) ** 2)
    return Case(
        f"sphere-{boundary}",
        "other model",
        "sphere.field",
        difference(m, expected),
        tolerance,
        0.0,
        seconds,
        f"ka = {SIZE:g}, {BEHIND:g} radii behind: rms {rms(m, expected):.2g}; "
        f"a black one has a spot {ratio:.2g} times as bright",
        Curve(x / radius, m, expected, "x/a", "M"),
    )
