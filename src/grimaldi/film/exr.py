"""Multi-layer OpenEXR files: the picture, the complex field, its phase and error, all float32."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.files import replacing
from grimaldi.film.layers import Layers

PHASE_CONVENTION = "phase = arg U in radians, -pi..pi; U ~ exp(i k r - i omega t)"


def write(layers: Layers, path: str | Path) -> None:
    """Write rendered `layers` to `path`, losslessly.

    Channels (y, x):

    ===================== ==================================================================
    ``R G B``             the picture, linear radiance; one channel ``L`` is written to all
                          three, which is what every viewer shows
    ``intensity``         eq. 3
    ``phase``             of the first group's field at the first wavelength [rad]
    ``error``             the largest error estimate of any group and wavelength
    ``U.<group>.re``,     the field, averaged over the pixel; with several wavelengths
    ``U.<group>.im``      ``U.<group>.<index>.re`` and ``.im``
    ===================== ==================================================================

    The header holds the attributes under their own names (text, so that no digit is lost;
    counts as integers), and ``phase_convention`` and ``max_error``.
    """
    import OpenEXR

    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        **{name: _attribute(value) for name, value in layers.attrs.items()},
        "phase_convention": PHASE_CONVENTION,
        "max_error": repr(float(np.fmax.reduce(layers.error, axis=None))),
    }
    with replacing(path) as temporary:
        OpenEXR.File(header, channels(layers)).write(str(temporary))


def channels(layers: Layers) -> dict[str, NDArray[np.float32]]:
    """The channels of `write` by name, each float32 (y, x)."""
    at = layers.channels.index
    found = {name: layers.picture[..., at(name if name in layers.channels else "L")] for name in ("R", "G", "B")}
    found["intensity"] = layers.intensity
    found["phase"] = np.angle(layers.U[0, 0])
    found["error"] = np.fmax.reduce(layers.error, axis=(0, 1))  # NaN where none is known
    for g, group in enumerate(layers.groups):
        for i in range(len(layers.wavelengths)):
            name = f"U.{group}" if len(layers.wavelengths) == 1 else f"U.{group}.{i}"
            found[f"{name}.re"] = layers.U[i, g].real
            found[f"{name}.im"] = layers.U[i, g].imag
    return {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in found.items()}


def _attribute(value: Any) -> str | int:
    """Counts stay integers; a list becomes "0.4, 0.5"; all else is text."""
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, int | np.integer) and abs(int(value)) < 2**31:
        return int(value)
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, list | tuple | np.ndarray):
        return ", ".join(str(_attribute(item)) for item in value)
    return str(value)
