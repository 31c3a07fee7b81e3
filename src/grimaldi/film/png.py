"""8 bit sRGB pictures of what was rendered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grimaldi.files import replacing
from grimaldi.film import phase
from grimaldi.film.colour import automatic_exposure, decode_srgb, encode_srgb, to_bytes
from grimaldi.film.layers import Layers

VIEWS = ("picture", "phase", "phase-cyclic", "phase-intensity")


def write(layers: Layers, path: str | Path, view: str, exposure: float | None) -> None:
    """Write one of VIEWS of `layers` to `path`; see `pixels`."""
    from PIL import Image

    with replacing(path) as temporary:
        Image.fromarray(pixels(layers, view, exposure)).save(temporary, format="png")


def pixels(layers: Layers, view: str, exposure: float | None) -> NDArray[np.uint8]:
    """One of VIEWS of `layers` as sRGB bytes (y, x, 3).

    The phase is that of the first group's field at the first wavelength. `exposure` multiplies the
    linear values of "picture" and "phase-intensity"; None takes `automatic_exposure` of this picture.
    """
    if view == "picture":
        rgb = np.broadcast_to(layers.picture, (*layers.picture.shape[:2], 3))
        return to_bytes(encode_srgb(_exposed(rgb, exposure)))
    field = layers.U[0, 0]
    if view == "phase":
        return to_bytes(phase.two_colours(field))
    if view == "phase-cyclic":
        return to_bytes(phase.cyclic(field))
    intensity = _exposed(layers.intensity, exposure)
    return to_bytes(encode_srgb(decode_srgb(phase.two_colours(field)) * intensity[..., None]))


def _exposed(linear: NDArray[np.float32], exposure: float | None) -> NDArray[np.float64]:
    return np.float64(automatic_exposure(linear) if exposure is None else exposure) * linear
