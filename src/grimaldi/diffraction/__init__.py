"""Diffraction models, one a file, behind one interface (`model.Model`)."""

from __future__ import annotations

from importlib import import_module
from typing import get_args

from grimaldi.conventions import ModelName, did_you_mean
from grimaldi.diffraction.model import Model
from grimaldi.errors import InputError


def model(name: str) -> Model:
    """The model called `name`, one of `ModelName`, imported when first asked for.

    Raises InputError for any other name, with the nearest of these.
    """
    names = sorted(get_args(ModelName))
    if not isinstance(name, str) or name not in names:
        raise InputError(f"diffraction: {name!r} is no model; {did_you_mean(name, names)}")
    found: Model = getattr(import_module(f"{__name__}.{name}"), name)
    return found
