"""Reads a plugin's parameters, each refused with its plugin's and its own name where it makes no sense."""

from __future__ import annotations

import math
from typing import Any

from grimaldi.conventions import LONGEST_PATH
from grimaldi.errors import InputError


def number(props: Any, name: str, default: float) -> float:
    """A finite float."""
    value = props.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"{props.plugin_name()}: {name} is {value!r}; give a finite number")
    return float(value)


def amplitude(props: Any) -> float:
    """A >= 0, 1 unless given; a phase, not a sign, turns a wave round."""
    value = number(props, "amplitude", 1.0)
    if value < 0:
        raise InputError(f"{props.plugin_name()}: amplitude is {value:g}; give 0 or more (phase = π negates)")
    return value


def vector(props: Any, name: str) -> list[float]:
    """Three finite floats in double precision; there is no default."""
    value = props.get(name, None)
    if value is None:
        raise InputError(f"{props.plugin_name()}: {name} is missing; give three numbers")
    try:
        numbers = [float(value[i]) for i in range(3)]
    except (TypeError, ValueError, IndexError):
        numbers = []
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise InputError(f"{props.plugin_name()}: {name} is {value!r}; give three finite numbers")
    return numbers


def group(props: Any) -> str:
    """The coherence group's name, "0" unless given."""
    value = props.get("group", "0")
    if isinstance(value, bool) or not isinstance(value, (str, int)) or not str(value).strip():
        raise InputError(f"{props.plugin_name()}: group is {value!r}; give a name or an integer")
    return str(value)


def names(props: Any, name: str) -> tuple[str, ...]:
    """Names separated by commas; none unless given."""
    return tuple(part.strip() for part in str(props.get(name, "")).split(",") if part.strip())


def depth(props: Any, name: str, default: int, *, least: int) -> int:
    """A path length, or -1 for no limit."""
    value = props.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or value > LONGEST_PATH or (value < least and value != -1):
        raise InputError(f"{props.plugin_name()}: {name} is {value!r}; give {least} or more, or -1 for no limit")
    return value
