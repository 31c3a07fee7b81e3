"""Diffraction models, one a file, behind one interface (`model.Model`)."""

from __future__ import annotations

from grimaldi.conventions import ModelName, did_you_mean
from grimaldi.diffraction.model import Model
from grimaldi.errors import InputError


def model(name: str) -> Model:
    """The model called `name`, one of `ModelName`.

    Raises InputError for any other name, with the nearest of these.
    """
    from grimaldi.diffraction.area import area
    from grimaldi.diffraction.boundary import boundary
    from grimaldi.diffraction.huygens import huygens
    from grimaldi.diffraction.none import none

    models: dict[ModelName, Model] = {"area": area, "boundary": boundary, "huygens": huygens, "none": none}
    if name not in models:
        raise InputError(f"diffraction: {name!r} is no model; {did_you_mean(name, models)}")
    return models[name]
