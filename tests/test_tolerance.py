"""`tolerance` is a promise: the true error stays below it on random scenes, at the places that are hardest."""

from __future__ import annotations

import drjit as dr
import mitsuba
import numpy as np
import oracle
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from optics import emitter

import grimaldi
from grimaldi.diffraction import model
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.model import Options, Precision, Receivers
from grimaldi.scene.model import Scene

mi = mitsuba
mi.set_variant("llvm_ad_mono")

ASKED: tuple[tuple[float, Precision], ...] = (
    (1e-2, "auto"),
    (1e-3, "auto"),
    (1e-4, "auto"),
    (1e-6, "auto"),
    (1e-8, "double"),
    (1e-10, "double"),
)
PLACES = ("on the rim", "beside it", "anywhere", "just behind", "on an edge's line", "far off the axis")


def factors(scene: Scene, points: NDArray[np.float64], options: Options) -> tuple[NDArray, NDArray]:
    """M and its estimated error, without U0, whose phase a distance of 1e5 λ leaves only 1e-10 of."""
    double = types(double=True)
    p = double.Vector(*(double.buffer(points[:, i]) for i in range(3)))
    seen = grimaldi.outline(scene, scene.sources[0])
    evaluate = model("boundary")(scene, scene.sources[0], seen, 2 * np.pi, options)
    m = evaluate(Receivers(p, dr.zeros(mi.Vector3f, len(points)), dr.mask_t(p.x)(True)))
    return np.array(m.real) + 1j * np.array(m.imag), np.array(m.error)


def polygon(rng: np.random.Generator) -> NDArray[np.float64]:
    """A star-shaped polygon in z = 0, 0.2 to 2,000 wavelengths wide."""
    n = int(rng.integers(3, 9))
    while True:
        angle = np.sort(rng.uniform(0, 2 * np.pi, n))
        if np.diff(np.append(angle, angle[0] + 2 * np.pi)).max() < 2.6:
            break
    radius = 10 ** rng.uniform(-1, 3) * rng.uniform(0.3, 1, n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)


def lamp(rng: np.random.Generator) -> oracle.Source:
    """A point 1 to 1e5 wavelengths away, or a plane wave, at up to 70° from the axis."""
    tilt, azimuth = rng.uniform(0, 1.2), rng.uniform(0, 2 * np.pi)
    d = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    return oracle.Plane(d) if rng.random() < 0.5 else oracle.Spherical(-(10 ** rng.uniform(0, 5)) * d)


def receiver(place: str, light: oracle.Source, loop: NDArray[np.float64], rng: np.random.Generator) -> NDArray:
    """A point behind the plane of the polygon; `place` is said of the ray to it, or of itself."""
    size = np.abs(loop).max()
    i = int(rng.integers(len(loop)))
    first, second = loop[i], loop[(i + 1) % len(loop)]
    e = (second - first) / np.linalg.norm(second - first)
    x = first + rng.uniform(0, 1) * (second - first)
    z = 10 ** rng.uniform(-1, 5)
    aside = 0.0
    match place:
        case "beside it":
            aside = 10 ** rng.uniform(-9, -1) * size * rng.choice([-1, 1])
        case "just behind":
            z = 10 ** rng.uniform(-9, -0.5)
            aside = 10 ** rng.uniform(-9, -1) * size * rng.choice([-1, 1])
        case "anywhere":
            aside = rng.uniform(-3, 3) * size
        case "on an edge's line":
            x = second + 10 ** rng.uniform(-2, 1) * size * e
            aside = 10 ** rng.uniform(-9, -3) * size
        case "far off the axis":
            aside = 10 ** rng.uniform(0, 2) * size + rng.uniform(0, 3) * z
    ray = np.asarray(light.direction, float) if isinstance(light, oracle.Plane) else x - np.asarray(light.position)
    return x + ray * (z / ray[2]) + aside * np.array([e[1], -e[0], 0])


@settings(max_examples=500, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 2**32 - 1))
def test_the_error_stays_below_what_is_asked(seed):
    """Where rounding leaves less than that, `error` says so, and is not too small itself."""
    rng = np.random.default_rng(seed)
    loop, light = polygon(rng), lamp(rng)
    points = np.stack([receiver(place, light, loop, rng) for place in PLACES])
    exact = oracle.polygon_factor(light, points, loop, 1.0)
    hole = grimaldi.PlanarOutline(loop[:, :2], np.eye(4))
    scene = grimaldi.load({"type": "scene", "light": emitter(light)}, outlines=[hole])
    for tolerance, precision in ASKED:
        m, error = factors(scene, points, Options(tolerance, precision))
        wrong = np.abs(m - exact) > np.maximum(tolerance, error)
        worst = {PLACES[i]: (abs(m[i] - exact[i]), error[i]) for i in np.flatnonzero(wrong)}
        assert not worst, f"tolerance {tolerance:g}: {worst}"
        beside = np.array(PLACES) == "just behind"  # there coordinates themselves run out
        assert (error[~beside] <= tolerance).all()


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 2**32 - 1))
def test_long_ways_wide_outlines_and_large_coordinates(seed):
    """Ways of up to 1e8 λ, outlines 0.2 to 2e5 λ wide, and all of it moved by up to 1e6 outlines through to_world."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-1, 5)
    loop = polygon(rng)
    loop *= size / np.abs(loop).max()
    least = np.log10(max(size**2 / 3e3, 1.0))  # fewer fringes than the reference can count
    d = np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), 1.0])
    lamp = -(10 ** rng.uniform(least, 8)) * d
    light = oracle.Spherical(lamp)
    rim = loop[0] + rng.uniform(0, 1, 4)[:, None] * (loop[1] - loop[0])
    aside = np.array([0, 1e-6, -1e-2, 1.0])[:, None] * size * rng.normal(size=(4, 3)) * [1, 1, 0]
    points = rim + (rim - lamp) * (10 ** rng.uniform(least, 8) / -lamp[2]) + aside
    exact = oracle.polygon_factor(light, points, loop, 1.0)
    offset = np.round(10 ** rng.uniform(0, 6) * size * rng.normal(size=3))
    to_world = np.eye(4)
    to_world[:3, 3] = offset
    source = {"type": "coherent_point", "position": (lamp + offset).tolist()}
    scene = grimaldi.load({"type": "scene", "light": source}, outlines=[grimaldi.PlanarOutline(loop[:, :2], to_world)])
    for tolerance in (1e-3, 1e-6):
        m, error = factors(scene, points + offset, Options(tolerance))
        assert (np.abs(m - exact) <= np.maximum(tolerance, error)).all()
        assert (error <= tolerance).all()


def test_a_starshade():
    """22 petals of 400 corners, as a mask a few Fresnel zones wide: 1e-10 in the deep of its shadow."""
    share = np.linspace(0, 1, 200)
    radius, width = 6 + 7 * share, np.exp(-((1.2 * share) ** 6) * 3)
    angle = np.pi / 22 * width
    petal = np.concatenate(
        [np.stack([radius, -angle], 1), np.stack([radius, angle], 1)[:0:-1]]
    )  # its last corner is the next one's first
    loop = np.concatenate([np.stack([r := petal[:, 0], petal[:, 1] + 2 * np.pi * i / 22], 1) for i in range(22)])
    loop = 1e3 * np.stack([loop[:, 0] * np.cos(loop[:, 1]), loop[:, 0] * np.sin(loop[:, 1]), 0 * r.repeat(22)], 1)
    points = np.array([[0, 0, 1e7], [300, -200, 1e7], [2000, 900, 1e7]])
    light = oracle.Plane((0, 0, 1))
    exact = 1 - oracle.polygon_factor(light, points, loop, 1.0)
    mask = grimaldi.PlanarOutline(loop[:, :2], np.eye(4), hole=False)
    scene = grimaldi.load({"type": "scene", "light": emitter(light)}, outlines=[mask])
    m, error = factors(scene, points, Options(1e-10, "double"))
    assert abs(exact[0]) < 0.1
    np.testing.assert_allclose(m, exact, rtol=0, atol=1e-10)
    assert error.max() <= 1e-10


@pytest.mark.parametrize("place", PLACES)
def test_the_reference_itself(place):
    """The reference of these tests is Kirchhoff's area integral, which knows no edges."""
    rng = np.random.default_rng(11)
    loop = np.array([[-3, -2, 0], [2.5, -2.2, 0], [3, 2, 0], [-1, 2.8, 0.0]])
    light = oracle.Spherical((1, -2, -30))
    p = receiver(place, light, loop, rng)[None]
    p[0, 2] = max(p[0, 2], 5.0)
    by_area = oracle.area_factor(light, p, oracle.polygon_area(loop), 1.0)
    np.testing.assert_allclose(oracle.polygon_factor(light, p, loop, 1.0), by_area, atol=1e-9)
