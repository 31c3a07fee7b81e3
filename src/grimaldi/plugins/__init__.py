"""Grimaldi's Mitsuba plugins: one a file, each with `register(V)` for a variant module V."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules


@cache
def register_all() -> None:
    """Register every plugin for every variant that this machine can load.

    Mitsuba's registries are per variant, and its dict loader asks scalar_rgb for a plugin's type whatever
    the variant; so all of them, which takes about 0.1 s.
    """
    import mitsuba as mi

    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    plugins = [module for module in modules if hasattr(module, "register")]
    for name in mi.variants():
        try:
            variant = getattr(mi, name)
        except ImportError:  # a backend that does not answer: no GPU, or no libLLVM
            continue
        for plugin in plugins:
            plugin.register(variant)
