"""pbrt's lights as Mitsuba emitters."""

from __future__ import annotations

from typing import Any

import numpy as np

from grimaldi.scene.pbrt.materials import rgb
from grimaldi.scene.pbrt.parameters import Colour, Parameters
from grimaldi.scene.pbrt.transforms import Reals, point

WHITE: Colour = (1.0, 1.0, 1.0)


def scaled(p: Parameters, name: str) -> Reals:
    """A light's colour times its `scale`, a number in version 4 and a colour in version 3."""
    scale = (p.one("scale", 1.0),) * 3 if p.type("scale") == "float" else p.colour("scale", WHITE)
    return np.array(p.colour(name, WHITE)) * scale


def emission(value: Reals) -> dict[str, Any]:
    return rgb((float(value[0]), float(value[1]), float(value[2])))


def light(kind: str, p: Parameters, to_world: Reals) -> dict[str, Any] | None:
    """A Mitsuba emitter; None where there is none like it."""
    match kind:
        case "point":
            position = point(to_world, _vector(p, "from", (0, 0, 0)))
            return {"type": "point", "position": position.tolist(), "intensity": emission(scaled(p, "I"))}
        case "distant":
            along = to_world[:3, :3] @ _way(p)
            return {"type": "directional", "direction": along.tolist(), "irradiance": emission(scaled(p, "L"))}
        case "spot":
            return _spot(p, to_world)
        case "infinite" if not (p.has("mapname") or p.has("filename")):
            return {"type": "constant", "radiance": emission(scaled(p, "L"))}
        case _:
            return None


def _spot(p: Parameters, to_world: Reals) -> dict[str, Any]:
    import mitsuba as mi

    start = _vector(p, "from", (0, 0, 0))
    eye, target = point(to_world, start), point(to_world, start + _way(p))
    aside = np.eye(3)[np.abs(target - eye).argmin()]
    cone = p.one("coneangle", 30.0)
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at(eye.tolist(), target.tolist(), aside.tolist()),
        "intensity": emission(scaled(p, "I")),
        "cutoff_angle": cone,
        "beam_width": max(cone - p.one("conedeltaangle", 5.0), 0.0),
    }


def _way(p: Parameters) -> Reals:
    """Which way the light of a `distant` or `spot` goes; InputError where from and to are one point."""
    way = _vector(p, "to", (0, 0, 1)) - _vector(p, "from", (0, 0, 0))
    if not way.any():
        raise p.place.error("from and to are the same point; give the way the light goes")
    return way


def _vector(p: Parameters, name: str, default: tuple[float, float, float]) -> Reals:
    rows = p.array(name, 3)
    return np.array(default, np.float64) if rows is None else rows[0]


def of_sphere(radiance: Reals, radius: float, centre: Reals) -> dict[str, Any]:
    """A point with the light of a sphere that shines with `radiance`: the same irradiance wherever it is not hidden."""
    intensity = emission(radiance * (np.pi * radius**2))
    return {"type": "point", "position": centre.tolist(), "intensity": intensity}


def of_surface(radiance: Reals) -> dict[str, Any]:
    return {"type": "area", "radiance": emission(radiance)}
