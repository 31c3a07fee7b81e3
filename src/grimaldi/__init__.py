"""Grimaldi: waves for Mitsuba 3.

`import grimaldi` suffices, before or after Mitsuba: it registers its plugins (integrator `wave`, emitters
`coherent_point`, `coherent_directional` and `coherent_area`, BSDF `aperture`, some shapes) for every variant, and costs
nothing until one of the names below is used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

import _grimaldi_libllvm as _grimaldi_libllvm  # does what its .pth did, where that is not installed
from grimaldi._import_hook import after_import

if TYPE_CHECKING:
    from grimaldi.outlines import outline as outline
    from grimaldi.pipeline import field as field
    from grimaldi.rendering import render as render
    from grimaldi.scene import PlanarOutline as PlanarOutline
    from grimaldi.scene import load as load

__version__ = "0.1.0"
__all__ = ["PlanarOutline", "field", "load", "outline", "render"]

_HOMES = {
    "PlanarOutline": "grimaldi.scene",
    "field": "grimaldi.pipeline",
    "load": "grimaldi.scene",
    "outline": "grimaldi.outlines",
    "render": "grimaldi.rendering",
}


def __getattr__(name: str) -> Any:
    """The public names, each imported when first used (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'grimaldi' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _register_plugins() -> None:
    from grimaldi.plugins import register_all

    register_all()


if "mitsuba" in sys.modules:
    _register_plugins()
else:
    after_import("mitsuba", _register_plugins)
