"""Mitsuba's emitters as sources of waves."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.conventions import did_you_mean
from grimaldi.errors import GrimaldiWarning, InputError
from grimaldi.scene.bodies import front, planar_outline
from grimaldi.scene.model import Scene, Source, Spot
from grimaldi.scene.triangles import LARGEST

COHERENT_GROUP = "0"
ZERO_DIRECTION = "direction is zero; give the way the wave travels"

_MITSUBAS = ("PointLight", "SpotLight", "DirectionalEmitter")
_DIFFRACTING = ("coherent_point", "coherent_directional", "coherent_area", *_MITSUBAS)


def sources(mi_scene: Any, *, coherent: Collection[str] = ()) -> tuple[Source, ...]:
    """The scene's sources of waves (THEORY eq. 1, 2), in the order of `mi.Scene.emitters()`.

    `coherent_point`, `coherent_directional` and `coherent_area` bring amplitude, phase and group. Of Mitsuba's
    `point`, `spot` and `directional` the amplitude is the square root of the intensity or irradiance, averaged over
    the colour channels, the phase is 0, and each is a group of its own, named after it. A `spot` with a texture
    stays ordinary light.

    Args:
        mi_scene: a Mitsuba scene in a mono or rgb variant.
        coherent: ids of Mitsuba's `point`, `spot` and `directional` that join group "0".

    Raises:
        InputError: a position that is not finite or too far away, a direction that is zero or not finite; an
            intensity that is negative or not finite; an id in `coherent` that no such emitter has; a
            `coherent_area` that is not part of a planar shape.

    Warns:
        GrimaldiWarning: naming the emitters that stay ordinary light.
    """
    found: list[Source] = []
    ordinary: list[str] = []
    names = _unique_names(mi_scene.emitters())
    for emitter, name in zip(mi_scene.emitters(), names, strict=True):
        if diffracts(emitter):
            found.append(_source(emitter, name, coherent, mi_scene))
        else:
            ordinary.append(f"{name} ({emitter.class_name()})")
    _check_ids(coherent, [source.name for source in found])
    if ordinary:
        warnings.warn(
            f"{', '.join(ordinary)}: stays ordinary light and does not diffract yet",
            GrimaldiWarning,
            stacklevel=2,
        )
    return tuple(found)


def diffracts(emitter: Any) -> bool:
    """Whether a Mitsuba emitter is a source of waves; the others stay ordinary light."""
    return _kind(emitter) in _DIFFRACTING and not _is_textured(emitter)


def _is_textured(emitter: Any) -> bool:
    import mitsuba as mi

    if _kind(emitter) != "SpotLight":
        return False
    names = {name for name, _ in mi.traverse(emitter) if name.startswith("texture.")}
    return names != {"texture.value"}


def _kind(emitter: Any) -> str:
    """Our plugin's name, or Mitsuba's class (our classes' own is `Emitter` there)."""
    return getattr(emitter, "plugin_name", emitter.class_name())


def _source(emitter: Any, name: str, coherent: Collection[str], mi_scene: Any) -> Source:
    kind = _kind(emitter)
    place: dict[str, Any]
    if kind == "coherent_point":
        place = {"position": _checked_position(_numbers(emitter.position), name)}
    elif kind == "coherent_directional":
        place = {"direction": _unit(_numbers(emitter.direction), name)}
    elif kind == "coherent_area":
        place = _out_of_shape(emitter, name, mi_scene)
    elif kind == "PointLight":
        place = {"position": _checked_position(_numbers(_parameter(emitter, "position")), name)}
    elif kind == "SpotLight":
        spot = _spot(emitter, name)
        place = {"position": _checked_position(_to_world(emitter)[:3, 3].copy(), name), "spot": spot}
    else:
        to_world = _to_world(emitter)
        direction = _unit(to_world[:3, 2], name)
        place = {"direction": direction, "origin": _checked_position(to_world[:3, 3].copy(), name)}
    if kind in _MITSUBAS:
        wave = _from_power(_power(emitter, name), COHERENT_GROUP if name in coherent else name)
    else:
        wave = _own(emitter)
    return Source(name, **wave, **place)


def _out_of_shape(emitter: Any, name: str, mi_scene: Any) -> dict[str, Any]:
    """Direction, origin and aperture of a `coherent_area`."""
    for index, shape in enumerate(mi_scene.shapes()):
        if shape.emitter() is emitter:
            aperture = planar_outline(shape, shape.id() or name)
            direction = aperture.normal * np.sign(aperture.normal @ front(shape))
            return {"direction": direction, "origin": aperture.origin, "aperture": aperture, "shape": index}
    raise InputError(f"{name}: the shape of this coherent_area is not in the scene; put it there")


def _spot(emitter: Any, name: str) -> Spot:
    cutoff, beam_width = (
        float(np.radians(_numbers(_parameter(emitter, angle))[0])) for angle in ("cutoff_angle", "beam_width")
    )
    if not 0 <= beam_width <= cutoff <= np.pi:
        raise InputError(f"{name}: its beam_width and cutoff_angle make no beam; give 0 <= beam_width <= cutoff_angle")
    return Spot(_unit(_to_world(emitter)[:3, 2], name), beam_width, cutoff)


def _to_world(emitter: Any) -> NDArray[np.float64]:
    return _numbers(_parameter(emitter, "to_world").matrix).reshape(4, 4)


def _from_power(power: NDArray[np.float64], group: str) -> dict[str, Any]:
    mean = float(power.mean())
    tint = tuple((power / mean).tolist()) if mean > 0 else (1.0,) * len(power)
    return {"group": group, "amplitude": float(np.sqrt(mean)), "phase": 0.0, "tint": tint}


def _own(emitter: Any) -> dict[str, Any]:
    """What all coherent emitters have."""
    return {
        "group": emitter.group,
        "amplitude": float(_numbers(emitter.amplitude)[0]),
        "phase": float(_numbers(emitter.phase)[0]),
        "tint": (1.0,) * _channels(),
    }


def _power(emitter: Any, name: str) -> NDArray[np.float64]:
    """Radiant intensity of a `point`, that of a `spot` on its axis, irradiance of a `directional`, per channel."""
    import drjit as dr
    import mitsuba as mi

    it = dr.zeros(mi.SurfaceInteraction3f)
    is_point = _kind(emitter) in ("PointLight", "SpotLight")
    if is_point:
        if _kind(emitter) == "SpotLight":
            position, axis = _to_world(emitter)[:3, 3], _unit(_to_world(emitter)[:3, 2], name)
        else:
            position, axis = _numbers(_parameter(emitter, "position")), np.array([1.0, 0.0, 0.0])
        # As far away as the position's own size: there Float32 keeps the distance.
        it.p = mi.Point3f((position + max(1.0, float(np.abs(position).max())) * axis).tolist())
    ds, weight = emitter.sample_direction(it, mi.Point2f(0.5))
    power = _numbers(weight)
    if is_point:
        power = power * _numbers(ds.dist) ** 2
    if not (np.isfinite(power).all() and (power >= 0).all()):
        raise InputError(f"{name}: the light's power is {power.tolist()}; give finite values of 0 or more")
    return power


def _parameter(emitter: Any, name: str) -> Any:
    import mitsuba as mi

    return mi.traverse(emitter)[name]


def _numbers(value: Any) -> NDArray[np.float64]:
    """A Dr.Jit value, or a plain number, as a flat array."""
    return np.array(value, dtype=np.float64).reshape(-1)


def _checked_position(position: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    if not (np.abs(position) < LARGEST).all():  # negated, so that NaN counts as bad
        wrong = f"too large, ({', '.join(f'{x:g}' for x in position)})" if np.isfinite(position).all() else "not finite"
        raise InputError(f"{name}: position is {wrong}; give coordinates below {LARGEST:g}")
    return position


def _unit(direction: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    if not np.isfinite(direction).all():
        raise InputError(f"{name}: direction is not finite; give three numbers, not all 0")
    if not direction.any():
        raise InputError(f"{name}: {ZERO_DIRECTION}")
    return direction / np.linalg.norm(direction)


def _channels() -> int:
    import mitsuba as mi

    return 1 if mi.is_monochromatic else 3


def _unique_names(emitters: Iterable[Any]) -> list[str]:
    """Each emitter's id, or its kind; none twice, and none that is the coherent group's name."""
    taken = {COHERENT_GROUP}
    names: list[str] = []
    for emitter in emitters:
        base = name = emitter.id() or _kind(emitter)
        count = 1
        while name in taken:
            count += 1
            name = f"{base}-{count}"
        taken.add(name)
        names.append(name)
    return names


def _check_ids(coherent: Collection[str], names: list[str]) -> None:
    for name in coherent:
        if name not in names:
            advice = did_you_mean(name, names, otherwise=f"the scene has {', '.join(names) or 'none'}")
            raise InputError(f"coherent: no source has the id {name!r}; {advice}")


def pick_source(scene: Scene, name: str | None = None) -> Source:
    """The scene's source of that name, or its only one.

    Raises InputError naming the nearest, or all where none was asked for.
    """
    names = [source.name for source in scene.sources]
    if name is None and len(names) == 1:
        return scene.sources[0]
    if name is None:
        raise InputError(f"{scene.name}: has {len(names)} sources; name one of {', '.join(names)}")
    if name not in names:
        advice = did_you_mean(name, names, otherwise=f"the scene has {', '.join(names) or 'none'}")
        raise InputError(f"{scene.name}: has no source {name!r}; {advice}")
    return scene.sources[names.index(name)]
