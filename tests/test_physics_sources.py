"""Interference of sources in free space: eq. 1-3, over path lengths of up to 1e6 wavelengths."""

from typing import NamedTuple

import numpy as np
import oracle
import pytest

import grimaldi
from grimaldi.errors import GrimaldiWarning
from grimaldi.reference import superposition

FAR = 1e6


class Sources(NamedTuple):
    positions: list[list[float]]
    amplitudes: list[float]
    phases: list[float]
    groups: list[str]


SOURCES = {
    "two in phase": Sources([[4, 0, 0], [-4, 0, 0]], [1, 1], [0, 0], ["0", "0"]),
    "two out of step": Sources([[4, 0, 0], [-4, 1, 2.5]], [1, 0.7], [0.3, 2.1], ["0", "0"]),
    "three in two groups": Sources(
        [[30, 0, 0], [-25, 1, 0.5], [0, 40, -8]], [2, 3, 5], [0.1, -1.2, 2.9], ["left", "right", "left"]
    ),
}


def scene(sources):
    return {"type": "scene"} | {
        f"source{i}": {
            "type": "coherent_point",
            "position": position,
            "amplitude": amplitude,
            "phase": phase,
            "group": group,
        }
        for i, (position, amplitude, phase, group) in enumerate(zip(*sources, strict=True))
    }


@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.parametrize("distance", [10.0, FAR])
def test_point_sources_add_as_eq_1_to_3(name, distance):
    sources = SOURCES[name]
    x, y = np.random.default_rng(1).uniform(-0.5, 0.5, (2, 200)) * distance
    points = np.stack([x, y, 0 * x + distance], axis=1)
    for wavelength in (1.0, 0.37):
        result = grimaldi.field(scene(sources), points, wavelength=wavelength)
        expected = superposition.fields(*sources, points, wavelength)
        assert set(result.group.values) == set(expected)
        # Float64 holds R to R ε, whose phase is 2π R/λ ε: 4e-9 at 1e6 wavelengths of 0.37
        accuracy = 1e-8 * sum(sources.amplitudes) / distance
        for group, field in expected.items():
            np.testing.assert_allclose(result.U.sel(group=group).values[0], field, rtol=0, atol=accuracy)
        np.testing.assert_allclose(
            result.intensity, superposition.intensity(expected), rtol=0, atol=50 * accuracy / distance
        )


def test_without_interference_every_source_is_a_group_of_its_own():
    sources = SOURCES["two out of step"]
    points = np.array([[0, 0, 70.0], [5, 6, 80.0]])
    result = grimaldi.field(scene(sources), points, wavelength=1, interference=False)
    apart = superposition.fields(*sources._replace(groups=["a", "b"]), points, 1)
    assert result.sizes["group"] == 2
    np.testing.assert_allclose(result.intensity, superposition.intensity(apart), rtol=1e-12)


def test_plane_waves_add_as_eq_2():
    directions, phases = [[0, 0, 1], [0.6, 0, 0.8]], [0.4, -2.0]
    waves = {
        f"wave{i}": {"type": "coherent_directional", "direction": d, "amplitude": 2, "phase": phase}
        for i, (d, phase) in enumerate(zip(directions, phases, strict=True))
    }
    points = np.random.default_rng(2).uniform(-FAR, FAR, (200, 3))
    result = grimaldi.field({"type": "scene", **waves}, points, wavelength=1)
    expected = sum(
        2 * np.exp(1j * phase) * oracle.Plane(d).wave(points, 2 * np.pi)[0]
        for d, phase in zip(directions, phases, strict=True)
    )
    np.testing.assert_allclose(result.U.values[0, 0], expected, atol=4e-8)


def test_lights_of_mitsuba_are_incoherent_with_amplitude_root_of_intensity():
    lights = {
        "one": {"type": "point", "position": [1, 0, 0], "intensity": 4.0},
        "two": {"type": "point", "position": [-1, 0, 0], "intensity": 9.0},
        "sky": {"type": "directional", "direction": [0, 0, 1], "irradiance": 0.25},
    }
    points = np.array([[0, 0, 7.0], [3, 1, 5.0]])
    result = grimaldi.field({"type": "scene", **lights}, points, wavelength=1)
    assert result.sizes["group"] == 3
    squares = [((points - [x, 0, 0]) ** 2).sum(axis=1) for x in (1, -1)]
    np.testing.assert_allclose(result.intensity, 4 / squares[0] + 9 / squares[1] + 0.25, rtol=1e-6)


def test_a_field_is_finite_however_short_the_wave():
    """Phases of 1e10 radians: |U| past a ball stays at most a few times |U0|."""
    scene = {
        "type": "scene",
        "light": {"type": "coherent_point", "position": [0, 0, 5]},
        "ball": {"type": "sphere"},
    }
    points = np.array([[0, 0, -5], [2, 0, -5], [9, 0, -5.0]])
    with pytest.warns(GrimaldiWarning, match="tolerance 0.001 is not reached"):
        field = grimaldi.field(scene, points, wavelength=1e-9)
    assert abs(field.U.values).max() < 1
