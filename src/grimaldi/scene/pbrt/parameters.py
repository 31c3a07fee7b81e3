"""The parameter lists of pbrt's directives: `"type name" value`, each value asked for by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from grimaldi.scene.pbrt.tokens import Place, Token

Reals = NDArray[np.float64]
Colour = tuple[float, float, float]

# Of each type, what its values are and how many belong together.
_TYPES: dict[str, tuple[Literal["number", "text", "bool"], int]] = {
    "integer": ("number", 1), "float": ("number", 1), "point": ("number", 3), "point3": ("number", 3),
    "point2": ("number", 2), "vector": ("number", 3), "vector3": ("number", 3), "vector2": ("number", 2),
    "normal": ("number", 3), "normal3": ("number", 3), "color": ("number", 3), "rgb": ("number", 3),
    "xyz": ("number", 3), "blackbody": ("number", 1), "string": ("text", 1), "texture": ("text", 1),
    "bool": ("bool", 1), "spectrum": ("number", 1),
}  # fmt: skip

_XYZ_TO_RGB = np.array(  # IEC 61966-2-1 (sRGB)
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


@dataclass(frozen=True)
class _Value:
    type: str
    values: tuple[Any, ...]


@dataclass
class Parameters:
    """The parameters of one directive; which were asked for is kept, so that the rest can be told."""

    place: Place
    values: dict[str, _Value] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)

    def add(self, declared: Token, tokens: Sequence[Token]) -> None:
        """One parameter, from `"type name"` and its values; InputError where they do not fit."""
        match declared.text.split():
            case [kind, name] if kind in _TYPES:
                pass
            case [kind, _]:
                raise declared.place.error(f"unknown parameter type {kind!r}; known are {', '.join(_TYPES)}")
            case _:
                raise declared.place.error(f'{declared.text!r} declares no parameter; write it like "float radius"')
        expected, together = _TYPES[kind]
        named = kind in ("spectrum", "blackbody") and any(token.kind == "text" for token in tokens)
        values = tuple(_read(token, "text" if named else expected, name) for token in tokens)
        if not values or (len(values) % together and expected == "number"):
            raise declared.place.error(f"{name} has {len(values)} values; give {together} for each {kind}")
        self.values[name] = _Value(kind, values)

    def has(self, name: str) -> bool:
        return name in self.values

    def type(self, name: str) -> str:
        """The type that a parameter was declared with; "" where it is not there."""
        return self.values[name].type if name in self.values else ""

    def one(self, name: str, default: Any) -> Any:
        """A number, text or bool of the default's kind; InputError for another kind."""
        value = self._get(name)
        if value is None:
            return default
        expected = type(default)
        if isinstance(default, (bool, str)) != isinstance(value[0], (bool, str)):
            raise self.place.error(f"{name} is {value[0]!r}; give a {expected.__name__}")
        return expected(value[0])

    def array(self, name: str, columns: int) -> Reals | None:
        """Numbers (n, columns); None where there are none."""
        value = self._get(name)
        if value is None:
            return None
        if len(value) % columns or isinstance(value[0], (bool, str)):
            raise self.place.error(f"{name} has {len(value)} values; give numbers, {columns} for each")
        return np.array(value, np.float64).reshape(-1, columns)

    def colour(self, name: str, default: Colour) -> Colour:
        """A colour as linear RGB; of a spectrum or temperature, which are left out, white."""
        kind, value = self.type(name), self._get(name)
        if value is None:
            return default
        if kind == "xyz":
            value = tuple(_XYZ_TO_RGB @ np.array(value[:3]))
        if kind in ("blackbody", "spectrum"):
            self.asked.discard(name)
            return (1.0, 1.0, 1.0)
        if isinstance(value[0], (bool, str)) or len(value) not in (1, 3):
            raise self.place.error(f"{name} is no colour; give three numbers")
        r, g, b = (max(float(v), 0.0) for v in (value * 3 if len(value) == 1 else value))
        return r, g, b

    def unused(self) -> list[str]:
        """The names that nobody asked for."""
        return [name for name in self.values if name not in self.asked]

    def _get(self, name: str) -> tuple[Any, ...] | None:
        self.asked.add(name)
        return self.values[name].values if name in self.values else None


def _read(token: Token, expected: str, name: str) -> Any:
    if expected == "bool" and token.text in ("true", "false"):
        return token.text == "true"
    if expected == "number" and token.kind == "number":
        return token.number
    if expected == "text" and token.kind == "text":
        return token.text
    raise token.place.error(f"{name}: {token.text!r} is no {expected}; correct it there")
