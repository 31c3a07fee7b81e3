"""What was rendered, as plain arrays: `grimaldi.render` hands it out as a dataset, `film` writes it to files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Layers:
    """The variables, coordinates and attributes of the dataset that `grimaldi.render` describes."""

    picture: NDArray[np.float32]  # (y, x, channel)
    U: NDArray[np.complex64]  # (wavelength, group, y, x)
    intensity: NDArray[np.float32]  # (y, x)
    error: NDArray[np.float32]  # (wavelength, group, y, x)
    channels: tuple[str, ...]
    wavelengths: tuple[float, ...]
    groups: tuple[str, ...]
    attrs: Mapping[str, Any]

    @staticmethod
    def of(dataset: xr.Dataset) -> Layers:
        """Those of a dataset, whatever the order of its dimensions."""
        of_field = ("wavelength", "group", "y", "x")
        return Layers(
            dataset["picture"].transpose("y", "x", "channel").values,
            dataset["U"].transpose(*of_field).values,
            dataset["intensity"].transpose("y", "x").values,
            dataset["error"].transpose(*of_field).values,
            tuple(dataset["channel"].values.tolist()),
            tuple(dataset["wavelength"].values.tolist()),
            tuple(dataset["group"].values.tolist()),
            dataset.attrs,
        )

    def dataset(self) -> xr.Dataset:
        import xarray as xr  # with pandas the longest import of all: a command that writes files does without

        of_field = ("wavelength", "group", "y", "x")
        data = {
            "picture": (("y", "x", "channel"), self.picture),
            "U": (of_field, self.U),
            "intensity": (("y", "x"), self.intensity),
            "error": (of_field, self.error),
        }
        coords = {"wavelength": list(self.wavelengths), "group": list(self.groups), "channel": list(self.channels)}
        return xr.Dataset(data, coords, self.attrs)
