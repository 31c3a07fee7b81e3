"""What a field says of itself: the tolerance not reached, with the edge; light fainter than it."""

from __future__ import annotations

import warnings

import mitsuba as mi
import numpy as np
import pytest

import grimaldi
from grimaldi.accuracy import warn_of_faint_light
from grimaldi.errors import GrimaldiWarning

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
SUN = {"type": "coherent_directional", "direction": [0, 0, 1]}


@pytest.fixture(autouse=True)
def _variant() -> None:
    mi.set_variant("llvm_ad_mono")


def behind(half: float, hole: bool = True):
    return grimaldi.load({"type": "scene", "sun": SUN}, outlines=[grimaldi.PlanarOutline(half * SQUARE, hole=hole)])


def test_a_tolerance_that_rounding_forbids_names_point_and_edge():
    """A receiver 1e-9 λ behind and beside an edge 2,000 λ long: coordinates have no more digits."""
    points = np.array([[0.0, 0, 50], [1000 + 1e-9, 3, 1e-9]])
    with pytest.warns(GrimaldiWarning) as told:
        result = grimaldi.field(behind(1000), points, wavelength=1.0, tolerance=1e-10, precision="double")
    (message,) = [str(w.message) for w in told]
    assert message.startswith("tolerance 1e-10 is not reached at 1 of 2 points: the error of M may be ")
    assert (
        "at (1000, 3, 1e-09), beside the edge of 'planar outline 0' from (1000, -1000, 0) to (1000, 1000, 0)" in message
    )
    assert result.error.values[0, 0, 0] < 1e-10 < result.error.values[0, 0, 1]


def test_a_polygon_too_coarse_for_its_circle_is_told():
    """At most 65,536 segments stand for a circle; where that leaves more than asked, `error` and a warning say so."""
    hole = grimaldi.PlanarOutline.ellipse(np.diag([1e7, 1e7, 1, 1]))
    scene = grimaldi.load({"type": "scene", "sun": SUN}, outlines=[hole])
    point = np.array([[0.99e7, 0, 1e7]])
    with pytest.warns(GrimaldiWarning, match="tolerance 1e-10 is not reached"):
        result = grimaldi.field(scene, point, wavelength=1.0, tolerance=1e-10, fast=False)
    assert result.error.values.max() > 1e-10


def test_faint_light_names_the_tolerance_to_ask_for():
    """Deep behind a mask |M| is below 1e-3, where the default tolerance leaves no digit."""
    points = np.array([[x, 0.0, 20] for x in np.linspace(-20, 20, 9)])
    with pytest.warns(
        GrimaldiWarning, match=r"below 0\.003 of what it is .* at 9 of 9 points.*ask for tolerance=1e-0[5-7]"
    ):
        grimaldi.field(behind(3e5, hole=False), points, wavelength=1.0)


@pytest.mark.filterwarnings("error")
def test_ordinary_shadows_say_nothing():
    points = np.array([[x, 0.0, 500] for x in np.linspace(-100, 100, 41)])
    grimaldi.field(behind(30), points, wavelength=1.0)


@pytest.mark.parametrize(("dark", "counted"), [(0.3, 0), (0.45, 0), (0.55, 110_000), (1.0, 200_000)])
def test_of_many_points_some_tell_whether_most_are_faint(dark, counted):
    """And all of them are counted only where that may be."""
    count = 200_000
    U = np.where(np.arange(count) < round(dark * count), 1e-6 + 0j, 1.0)[None, None]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warn_of_faint_light(U, np.ones((1, count)), 1e-3)
    assert [f"at {counted} of 200000 points" in str(w.message) for w in told] == [True] * (counted > 0)
