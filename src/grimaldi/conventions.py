"""Signs and units, and how options are read: what every public call has in common."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from functools import cache
from operator import index
from typing import TYPE_CHECKING, Any, Literal

from grimaldi.errors import InputError

if TYPE_CHECKING:
    import pint

SIGNS = "exp(-i omega t): U = A exp(i phase) exp(+i k R)/R, so phase grows with the distance from the source"

Wavelength = float | str | Sequence[float | str]
ModelName = Literal["none", "boundary", "huygens", "area"]
LONGEST_PATH = (1 << 31) - 1  # segments
PLUGINS = (  # what `grimaldi.plugins` adds to Mitsuba's
    "aperture",
    "coherent_area",
    "coherent_directional",
    "coherent_point",
    "cone",
    "gltf",
    "polygons",
    "stl",
    "wave",
)

_SHORTEST, _LONGEST = 1e-18, 1e18  # scene units; beyond them phases overflow or divide by zero

_DECIMALS = {"m": 0, "mm": 3, "um": 6, "µm": 6, "μm": 6, "nm": 9}  # the usual units, without pint: a third of a second

# A number, then perhaps one unit's name: pint's own expressions ("2**9**9 nm") are none of our business.
_QUANTITY = re.compile(r"\s*(?P<number>[-+]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)?\s*(?P<unit>[^\W\d_]+)?\s*")


def parse_wavelengths(wavelength: Wavelength | None, scene_unit: str | None = None) -> tuple[float, ...]:
    """Wavelengths in scene units.

    Args:
        wavelength: a number or several, in scene units; or text: lengths with a unit ("532 nm",
            "450 nm, 550 nm"), or bare numbers in scene units ("0.4").
        scene_unit: length of one scene unit as text ("1 um", or "um"); needed for text with a unit.

    Raises:
        InputError: naming `wavelength` or `scene_unit`: no positive finite number, one outside 1e-18 to 1e18
            scene units, an unknown unit, a unit that is no length, a unit without `scene_unit`, one that is given
            twice, or none at all.
    """
    if wavelength is None:
        raise InputError("wavelength: there is none; give one, such as wavelength=0.5 in scene units or '532 nm'")
    scale = None if scene_unit is None else _scene_unit(scene_unit)
    if isinstance(wavelength, str):
        items: Iterable[Any] = wavelength.split(",")
    elif isinstance(wavelength, Iterable) and getattr(wavelength, "ndim", 1) and not isinstance(wavelength, bytes):
        items = wavelength
    else:
        items = (wavelength,)
    result = tuple(_one(item, scale) for item in items)
    if not result:
        raise InputError("wavelength: the list is empty; give at least one, such as 0.5")
    for i, value in enumerate(result):
        if value in result[:i]:
            raise InputError(f"wavelength: {value:g} is given twice; give each once")
    return result


def whole(value: Any) -> int | None:
    """A whole number, of NumPy's too; None where it is none."""
    if isinstance(value, bool):
        return None
    try:
        return index(value)
    except TypeError:
        return None


def checked_flag(name: str, value: Any) -> bool:
    """True or False; InputError for what is neither."""
    if not isinstance(value, bool) and (str(getattr(value, "dtype", "")) != "bool" or value.ndim):
        raise InputError(f"{name}: {value!r} is neither True nor False; give one of these")
    return bool(value)


def check_options(given: Iterable[str], allowed: Iterable[str]) -> None:
    """Raise InputError for the first name of `given` that is not in `allowed`, with the nearest that is."""
    allowed = sorted(allowed)
    for name in given:
        if name not in allowed:
            raise InputError(f"{name}: no such option; {did_you_mean(name, allowed)}")


def did_you_mean(name: object, known: Iterable[str], otherwise: str | None = None) -> str:
    """Advice on a name that is not `known`: the nearest that is, else `otherwise`, or else all of them."""
    known = tuple(known)
    nearest = get_close_matches(str(name), known, n=1, cutoff=0.5)
    if nearest:
        return f"did you mean {nearest[0]!r}?"
    return otherwise or f"known are {', '.join(known)}"


def _one(item: Any, scale: tuple[float, str] | None) -> float:
    """One wavelength in scene units, from a number or text."""
    unit = None
    value = item
    if isinstance(item, str):
        value, unit = _quantity("wavelength", item)
        if value is None:
            raise InputError(f"wavelength: {item.strip()!r} has no number; write it like '532 nm'")
    if isinstance(value, bool):
        raise InputError(f"wavelength: {value} is no length; give a positive number")
    try:
        value = float(value)
    except (TypeError, ValueError):
        raise InputError(
            f"wavelength: {item!r} is neither a number nor text such as '532 nm'; give one of these"
        ) from None
    if unit is not None:
        if scale is None:
            raise InputError(
                f"wavelength: {item.strip()!r} needs the length of a scene unit; give scene_unit, as '1 um'"
            )
        value = _convert("wavelength", value, unit, scale[1]) / scale[0]
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"wavelength: {item!r} is not positive and finite; give a length above zero")
    if not _SHORTEST <= value <= _LONGEST:
        raise InputError(
            f"wavelength: {item!r} is out of reach; give one from {_SHORTEST:g} to {_LONGEST:g} scene units"
        )
    return value


def _scene_unit(text: str) -> tuple[float, str]:
    """Number and unit of `scene_unit`."""
    if not isinstance(text, str):
        raise InputError(f"scene_unit: {text!r} has no unit; write it like '1 um'")
    number, unit = _quantity("scene_unit", text)
    if unit is None:
        raise InputError(f"scene_unit: {text!r} has no unit; write it like '1 um'")
    number = 1.0 if number is None else number
    metres = _convert("scene_unit", number, unit, "m")
    if not (math.isfinite(metres) and metres > 0):
        raise InputError(f"scene_unit: {text!r} is not positive and finite; write it like '1 um'")
    return number, unit


def _quantity(name: str, text: str) -> tuple[float | None, str | None]:
    """The number and the unit written in `text`, each None where absent."""
    match = _QUANTITY.fullmatch(text)
    if match is None or not text.strip():
        raise InputError(f"{name}: {text.strip()!r} is not a number with a unit; write it like '532 nm'")
    number, unit = match["number"], match["unit"]
    if unit is not None and number is None and unit.lower() in ("nan", "inf", "infinity"):
        return float(unit), None
    return (None if number is None else float(number)), unit


def _convert(name: str, value: float, unit: str, to: str) -> float:
    if unit in _DECIMALS and to in _DECIMALS:
        places = _DECIMALS[to] - _DECIMALS[unit]
        return value * 10.0**places if places > 0 else value / 10.0**-places  # powers of ten are exact
    import pint

    try:
        return float(_registry().convert(value, unit, to))
    except pint.UndefinedUnitError:
        raise InputError(f"{name}: unknown unit {unit!r}; use nm, um, mm or m") from None
    except pint.DimensionalityError:
        raise InputError(f"{name}: {unit!r} is no length; use nm, um, mm or m") from None


@cache
def _registry() -> pint.UnitRegistry[float]:
    import pint

    return pint.UnitRegistry()
