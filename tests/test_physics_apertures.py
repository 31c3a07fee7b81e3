"""Holes in a screen against the Kirchhoff area integral, on and off the axis (eq. 4 and 6)."""

import numpy as np
import oracle
import pytest
from optics import APERTURE, affine, factor, line, shape

import grimaldi
from grimaldi.reference import circle, rectangle

LAMP = oracle.Spherical((3, -2, -40))
LIGHTS = {"point": LAMP, "plane": oracle.Plane((0, 0, 1)), "oblique plane": oracle.Plane((0.6, 0, 0.8))}
ACROSS = np.concatenate([line((-40, 0.7, 60), (40, 0.7, 60), 17), [[2, -0.7, 25], [-30, 5, 7]]])
ACCURACY = {"auto": (1e-5, 1e-4), "double": (1e-7, 1e-6)}  # tolerance asked for, error allowed

DISC = affine(12)
ELLIPSE = affine((10, 5, 1), at=(2, -1, 0), turn=[[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
SLITS = [affine((2, 16, 1), at=(x, 0, 0)) for x in (-5, 5)]
CONCAVE = np.array([[-10, -9], [11, -8], [2, 1], [9, 12], [-12, 10]])


def world(loop):
    return np.concatenate([loop, np.zeros((len(loop), 1))], axis=1)


HOLES = {
    "circle": ([shape("disk", DISC, APERTURE)], [], oracle.disc_area(DISC)),
    "tilted ellipse": ([shape("disk", ELLIPSE, APERTURE)], [], oracle.disc_area(ELLIPSE)),
    "rectangle": (
        [shape("rectangle", affine((9, 4, 1)), APERTURE)],
        [],
        oracle.square_area(affine((9, 4, 1))),
    ),
    "double slit": (
        [shape("rectangle", slit, APERTURE) for slit in SLITS],
        [],
        oracle.square_area(SLITS[0]) + oracle.square_area(SLITS[1]),
    ),
    "polygon": ([], [grimaldi.PlanarOutline(CONCAVE)], oracle.polygon_area(world(CONCAVE))),
    "polygon with an island": (
        [],
        [grimaldi.PlanarOutline([CONCAVE, 0.25 * CONCAVE])],
        oracle.polygon_area(world(CONCAVE)) + -oracle.polygon_area(world(0.25 * CONCAVE)),
    ),
}


@pytest.mark.parametrize("precision", ACCURACY)
@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("hole", HOLES)
def test_a_hole_passes_the_area_integral(hole, light, precision):
    shapes, outlines, opening = HOLES[hole]
    tolerance, allowed = ACCURACY[precision]
    expected = oracle.area_factor(LIGHTS[light], ACROSS, opening, 1)
    computed = factor(LIGHTS[light], ACROSS, *shapes, outlines=outlines, tolerance=tolerance, precision=precision)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=allowed)


def test_the_reported_error_bounds_the_error():
    scene = {
        "type": "scene",
        "light": {"type": "coherent_point", "position": [3, -2, -40], "amplitude": 5.0},
        "hole": shape("disk", DISC, APERTURE),
    }
    distance = np.linalg.norm(ACROSS - np.array([3, -2, -40]), axis=1)
    expected = oracle.area_factor(LAMP, ACROSS, HOLES["circle"][2], 1) * 5 / distance
    expected = expected * np.exp(2j * np.pi * distance)
    for tolerance in (1e-2, 1e-3, 1e-5):
        result = grimaldi.field(scene, ACROSS, wavelength=1, tolerance=tolerance)
        error = result.error.values[0, 0]
        assert (abs(result.U.values[0, 0] - expected) <= error).all()
        assert (error <= tolerance * 5 / distance * (1 + 1e-12)).all()


@pytest.mark.parametrize("z1", [40.0, np.inf])
def test_circle_on_axis(z1):
    light = oracle.Spherical((0, 0, -z1)) if np.isfinite(z1) else LIGHTS["plane"]
    z = np.array([5.0, 30, 72, 144, 1000, 1e5])
    computed = factor(
        light,
        np.stack([0 * z, 0 * z, z], axis=1),
        shape("disk", DISC, APERTURE),
        tolerance=1e-7,
        precision="double",
    )
    np.testing.assert_allclose(computed, circle.kirchhoff(12, z, 1, z1), rtol=0, atol=1e-6)


def test_figure_2_of_the_report_on_axis():
    # A disc of a = 7000/6 λ seen from 10000/6 λ: I = 1.7215 by Kirchhoff's integral.
    hole = grimaldi.PlanarOutline.ellipse(affine(7000 / 6))
    computed = factor(LIGHTS["plane"], [[0, 0, 1e4 / 6]], outlines=[hole], tolerance=1e-5)
    assert abs(computed[0]) ** 2 == pytest.approx(1.7215, abs=1e-4)


@pytest.mark.parametrize("z1", [1e5, np.inf])
def test_rectangle_by_fresnel_integrals(z1):
    light = oracle.Spherical((0, 0, -z1)) if np.isfinite(z1) else LIGHTS["plane"]
    x, y = np.array([[0, 0], [40, 10], [100, 0], [130, -70]], float).T
    z2 = 4e4
    points = np.stack([x * (1 + z2 / z1), y * (1 + z2 / z1), 0 * x + z2], axis=1)
    computed = factor(light, points, shape("rectangle", affine((100, 60, 1)), APERTURE), tolerance=1e-5)
    # The closed form leaves out phases of 1e-4 (test_reference.py).
    np.testing.assert_allclose(computed, rectangle.factor(200, 120, x, y, z2, 1, z1), rtol=0, atol=1.2e-4)


@pytest.mark.parametrize("hole", HOLES)
def test_nothing_changes_on_the_side_of_the_source(hole):
    shapes, outlines, _ = HOLES[hole]
    before = np.concatenate([line((-30, 1, -5), (30, 1, -5), 7), line((0, 0, -39), (0, 0, -0.5), 5)])
    computed = factor(LAMP, before, *shapes, outlines=outlines)
    np.testing.assert_allclose(computed, 1, rtol=0, atol=1e-12)


def test_a_hole_far_aside_passes_little():
    aside = line((-4e3, 5e3, 60), (4e3, 5e3, 60), 5)
    expected = oracle.area_factor(LAMP, aside, HOLES["circle"][2], 1)
    assert abs(expected).max() < 0.02
    computed = factor(LAMP, aside, shape("disk", DISC, APERTURE), tolerance=1e-5)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-4)
