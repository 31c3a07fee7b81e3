"""The built-in scenes, one a file: Mitsuba scene dicts with a `wave` integrator and its wavelength."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from grimaldi.conventions import did_you_mean
from grimaldi.errors import InputError
from grimaldi.scene.builtin import arago, creature, knife_edge, slit, young

_SCENES: dict[str, Callable[..., dict[str, Any]]] = {
    "young": young.build,
    "slit": slit.build,
    "arago": arago.build,
    "knife-edge": knife_edge.build,
    "creature": creature.build,
}


def names() -> tuple[str, ...]:
    """The names that `build` takes, simplest scene first."""
    return tuple(_SCENES)


def build(name: str, **parameters: float) -> dict[str, Any]:
    """The scene as a dict for `grimaldi.load`, which takes its `scene_unit` off again.

    Args:
        name: one of `names()`.
        parameters: of that scene's own `build`, lengths in its scene unit.

    Raises:
        InputError: no such scene, or no such parameter of it.
    """
    if name not in _SCENES:
        raise InputError(f"{name}: no built-in scene; {did_you_mean(name, _SCENES)}")
    known = inspect.signature(_SCENES[name]).parameters
    for parameter in parameters:
        if parameter not in known:
            raise InputError(f"{name}: no parameter {parameter!r}; {did_you_mean(parameter, known)}")
    return _SCENES[name](**parameters)
