"""Wavelengths as users write them, and options as users misspell them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pint
import pytest

from grimaldi.conventions import check_options, parse_wavelengths
from grimaldi.errors import InputError


@pytest.mark.parametrize(
    ("wavelength", "scene_unit", "expected"),
    [
        (0.4, None, (0.4,)),
        (1, None, (1.0,)),
        (np.float32(0.5), None, (0.5,)),
        ([0.4, 0.5], None, (0.4, 0.5)),
        (np.array([0.4, 0.5]), None, (0.4, 0.5)),
        ("0.4", None, (0.4,)),
        (" 0.4, 5e-1 ", None, (0.4, 0.5)),
        ("0.4", "1 mm", (0.4,)),
        ("532 nm", "1 nm", (532.0,)),
        ("532 nm", "1 um", (0.532,)),
        ("532nm", "um", (0.532,)),
        ("450 nm, 550 nm", "1 um", (0.45, 0.55)),
        ("550e-9 m", "1 um", (0.55,)),
        ("5320 angstrom", "1 um", (0.532,)),
        ("0.5 µm", "0.25 um", (2.0,)),
        (["532 nm", 0.3], "0.5 um", (1.064, 0.3)),
    ],
)
def test_wavelengths_in_scene_units(wavelength: Any, scene_unit: str | None, expected: tuple) -> None:
    assert parse_wavelengths(wavelength, scene_unit) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("wavelength", "scene_unit", "named"),
    [
        (0, None, "wavelength: 0 is not positive"),
        (-0.4, None, "wavelength: -0.4 is not positive"),
        (math.nan, None, "wavelength: nan is not positive"),
        (math.inf, None, "wavelength: inf is not positive"),
        ("nan", None, "wavelength: 'nan' is not positive"),
        ("-inf", None, "wavelength: '-inf'"),
        ("1e-400", None, "wavelength: '1e-400' is not positive"),
        (1e-320, None, "wavelength: 1e-320 is out of reach; give one from 1e-18 to 1e+18 scene units"),
        ("1e40", None, "wavelength: '1e40' is out of reach"),
        ("1 nm", "1e30 km", "wavelength: '1 nm' is out of reach"),
        ("0 nm", "1 um", "wavelength: '0 nm' is not positive"),
        ([0.4, -1], None, "wavelength: -1 is not positive"),
        ([], None, "wavelength: the list is empty"),
        ("", None, "wavelength: ''"),
        ("450 nm,", "1 um", "wavelength: ''"),
        (None, None, "wavelength: there is none; give one"),
        (True, None, "wavelength: True is no length"),
        (1j, None, "wavelength: 1j is neither"),
        ("green", None, "wavelength: 'green' has no number"),
        ("532 nm", None, "give scene_unit"),
        ("532 nmm", "1 um", "wavelength: unknown unit 'nmm'"),
        ("532 s", "1 um", "wavelength: 's' is no length"),
        ("2 ** 3 nm", "1 um", "wavelength: '2 ** 3 nm' is not a number with a unit"),
        ("532 nm", "1", "scene_unit: '1' has no unit"),
        ("532 nm", "", "scene_unit: ''"),
        ("532 nm", "0 um", "scene_unit: '0 um' is not positive"),
        ("532 nm", "-1 um", "scene_unit: '-1 um' is not positive"),
        ("532 nm", "1 blub", "scene_unit: unknown unit 'blub'"),
        ("532 nm", "1 kg", "scene_unit: 'kg' is no length"),
        (0.4, "nonsense", "scene_unit: unknown unit 'nonsense'"),
        (0.4, 1.0, "scene_unit: 1.0 has no unit"),
    ],
)
def test_wrong_wavelengths_say_what_and_why(wavelength: Any, scene_unit: Any, named: str) -> None:
    with pytest.raises(InputError) as error:
        parse_wavelengths(wavelength, scene_unit)
    assert named in str(error.value)
    assert ";" in str(error.value)  # the remedy
    assert "\n" not in str(error.value)


def test_a_misspelt_option_names_the_nearest() -> None:
    check_options(["tolerance", "n"], ["n", "tolerance"])
    with pytest.raises(InputError, match="tolerence: no such option; did you mean 'tolerance'"):
        check_options(["tolerence"], ["n", "precision", "tolerance"])
    with pytest.raises(InputError, match="xyz: no such option; known are n, precision"):
        check_options(["xyz"], ["precision", "n"])


@pytest.mark.parametrize("unit", ["m", "mm", "um", "µm", "nm"])
@pytest.mark.parametrize("scene_unit", ["1 m", "2 mm", "um", "5 nm"])
def test_usual_units_are_pints(unit, scene_unit):
    (computed,) = parse_wavelengths(f"0.00053 {unit}", scene_unit)
    expected = pint.UnitRegistry().convert(0.00053, unit, "m") / pint.Quantity(scene_unit).m_as("m")
    assert computed == pytest.approx(expected, rel=1e-14)
