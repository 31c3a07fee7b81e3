"""The options that `field`, `render` and the integrator `wave` share: checked in one place, described in one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, get_args

from grimaldi.conventions import SIGNS, Wavelength, checked_flag, did_you_mean, whole
from grimaldi.errors import InputError

if TYPE_CHECKING:
    from grimaldi.diffraction.model import Options
    from grimaldi.scene.model import Scene

MOST = 1 << 24  # sources an edge, or samples a point


@dataclass(frozen=True)
class Settings:
    """What the integrator `wave` was asked for; see its manual page."""

    wavelength: Wavelength | None = None
    scene_unit: str | None = None
    diffraction: str = "boundary"
    interference: bool = True
    tolerance: float = 1e-3
    precision: str = "auto"
    occlusion: bool | str = True
    rim: str = "sharp"
    n: int | str | None = None
    weights: str = "report"
    epsilon: float | None = None
    fast: bool = True
    coherent: tuple[str, ...] = ()

    def check(self) -> None:
        """Raise InputError for what is wrong whatever the scene."""
        from grimaldi.diffraction import model

        model(self.diffraction)
        checked_flag("interference", self.interference)
        self.options()

    def options(self) -> Options:
        """The options of the model."""
        return checked_options(
            tolerance=self.tolerance,
            precision=self.precision,
            occlusion=self.occlusion,
            rim=self.rim,
            n=self.n,
            weights=self.weights,
            epsilon=self.epsilon,
            fast=self.fast,
        )


def checked_options(
    *, tolerance: Any, precision: Any, occlusion: Any, rim: Any, n: Any, weights: Any, epsilon: Any, fast: Any
) -> Options:
    """The options of every model; InputError names the one that is wrong."""
    from grimaldi.diffraction.model import NYQUIST, Occlusion, Options, Precision, Rim, Weights

    try:
        tolerance = float(tolerance)
    except (TypeError, ValueError):
        raise InputError(f"tolerance: {tolerance!r} is no number; give one such as 1e-3") from None
    if not 1e-12 <= tolerance < 1 or not math.isfinite(tolerance):
        raise InputError(f"tolerance: {tolerance:g} is out of reach; give a number from 1e-12 to 1")
    if isinstance(occlusion, bool):
        occlusion = "graded" if occlusion else "none"
    kinds = {
        "precision": (precision, Precision),
        "occlusion": (occlusion, Occlusion),
        "rim": (rim, Rim),
        "weights": (weights, Weights),
    }
    for name, (value, known) in kinds.items():
        if not isinstance(value, str) or value not in get_args(known):
            raise InputError(f"{name}: {value!r} is unknown; {did_you_mean(value, get_args(known))}")
    if n is not None and not (isinstance(n, str) and n == NYQUIST):
        count = whole(n)
        if count is None or not 1 <= count <= MOST:
            raise InputError(f"n: {n!r} is no number of sources; give an integer from 1 to {MOST}, or {NYQUIST!r}")
        n = count
    epsilon, fast = _positive("epsilon", epsilon), checked_flag("fast", fast)
    return Options(tolerance, precision, occlusion, rim, n, weights, epsilon, fast)


def _positive(name: str, value: Any) -> float | None:
    """A positive finite number, or None where there is none."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise InputError(f"{name}: {value!r} is no length; give a positive number of scene units")
    return float(value)


def describe(scene: Scene, *, diffraction: str, interference: bool, options: Options) -> dict[str, Any]:
    """What a result says of itself: units, conventions, options and versions, as attributes that any file keeps."""
    return {
        "scene": scene.name,
        "scene_unit": scene.unit or "",
        "smooth": scene.smooth,
        "units": "lengths in scene units; U is the square root of irradiance",
        "time_convention": SIGNS,
        "diffraction": diffraction,
        "interference": str(bool(interference)).lower(),
        "tolerance": options.tolerance,
        "precision": options.precision,
        "occlusion": options.occlusion,
        "rim": options.rim,
        "n": "" if options.n is None else options.n,
        "weights": options.weights,
        "epsilon": "" if options.epsilon is None else options.epsilon,
        "fast": str(options.fast).lower(),
        "grimaldi": version("grimaldi"),
        "mitsuba": version("mitsuba"),
    }
