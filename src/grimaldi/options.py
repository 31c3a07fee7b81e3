"""The options that `field`, `render` and the integrator `wave` share: checked in one place, described in one."""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, get_args

from grimaldi.conventions import SIGNS, did_you_mean
from grimaldi.errors import InputError

if TYPE_CHECKING:
    from grimaldi.diffraction.model import Options
    from grimaldi.scene.model import Scene


def checked_options(tolerance: Any, precision: Any, occlusion: Any = True) -> Options:
    """The options of every model; InputError names the one that is wrong."""
    from grimaldi.diffraction.model import Options, Precision

    try:
        tolerance = float(tolerance)
    except (TypeError, ValueError):
        raise InputError(f"tolerance: {tolerance!r} is no number; give one such as 1e-3") from None
    if not 1e-12 <= tolerance < 1 or not math.isfinite(tolerance):
        raise InputError(f"tolerance: {tolerance:g} is out of reach; give a number from 1e-12 to 1")
    if precision not in get_args(Precision):
        raise InputError(f"precision: {precision!r} is unknown; {did_you_mean(precision, get_args(Precision))}")
    return Options(tolerance, precision, bool(occlusion))


def describe(scene: Scene, *, diffraction: str, interference: bool, options: Options) -> dict[str, Any]:
    """What a result says of itself: units, conventions, options and versions, as attributes that any file keeps."""
    return {
        "scene": scene.name,
        "scene_unit": scene.unit or "",
        "units": "lengths in scene units; U is the square root of irradiance",
        "time_convention": SIGNS,
        "diffraction": diffraction,
        "interference": str(bool(interference)).lower(),
        "tolerance": options.tolerance,
        "precision": options.precision,
        "occlusion": str(options.occlusion).lower(),
        "grimaldi": version("grimaldi"),
        "mitsuba": version("mitsuba"),
    }
