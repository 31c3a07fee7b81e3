"""Multi-layer OpenEXR files: the picture, the complex field, its phase and error, all float32."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.files import replacing

if TYPE_CHECKING:
    import xarray as xr

PHASE_CONVENTION = "phase = arg U in radians, -pi..pi; U ~ exp(i k r - i omega t)"


def write(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a rendered `dataset` to `path`, losslessly.

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

    The header holds the dataset's attributes under their own names (text, so that no digit is lost;
    counts as integers), and ``phase_convention`` and ``max_error``.
    """
    import OpenEXR

    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        **{name: _attribute(value) for name, value in dataset.attrs.items()},
        "phase_convention": PHASE_CONVENTION,
        "max_error": repr(float(dataset["error"].max())),
    }
    with replacing(path) as temporary:
        OpenEXR.File(header, channels(dataset)).write(str(temporary))


def channels(dataset: xr.Dataset) -> dict[str, NDArray[np.float32]]:
    """The channels of `write` by name, each float32 (y, x)."""
    picture = dataset["picture"].transpose("y", "x", "channel")
    field = dataset["U"].transpose("wavelength", "group", "y", "x")
    layers = {
        name: picture.sel(channel=name if name in picture["channel"].values else "L").values for name in ("R", "G", "B")
    }
    layers["intensity"] = dataset["intensity"].transpose("y", "x").values
    layers["phase"] = np.angle(field.values[0, 0])
    layers["error"] = dataset["error"].max(("wavelength", "group")).transpose("y", "x").values
    for g, group in enumerate(field["group"].values):
        for i in range(field.sizes["wavelength"]):
            name = f"U.{group}" if field.sizes["wavelength"] == 1 else f"U.{group}.{i}"
            layers[f"{name}.re"] = field.values[i, g].real
            layers[f"{name}.im"] = field.values[i, g].imag
    return {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in layers.items()}


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
