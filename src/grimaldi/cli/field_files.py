"""Field data as files: NetCDF, Zarr and NumPy, all of them exact."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from grimaldi.files import replacing, replacing_folder

if TYPE_CHECKING:
    import xarray as xr

SUFFIXES = (".nc", ".zarr", ".npz")


def write(dataset: xr.Dataset, path: Path) -> None:
    """Write the result of `grimaldi.field` to .nc, .zarr or .npz.

    .nc and .zarr read back with `xarray.open_dataset` (.nc with engine="h5netcdf"); an .npz holds an array
    for each variable and coordinate, and the attributes as JSON text under "attrs".
    """
    match path.suffix.lower():
        case ".nc":
            with replacing(path) as temporary:
                dataset.assign_attrs(_without_bools(dataset.attrs)).to_netcdf(temporary, engine="h5netcdf")
        case ".zarr":
            with replacing_folder(path) as temporary:
                # Format 2: in 3 neither texts nor consolidated metadata are specified yet.
                dataset.to_zarr(temporary, mode="w", zarr_format=2)
        case _:
            arrays: dict[str, Any] = {str(name): array.values for name, array in dataset.variables.items()}
            with replacing(path) as temporary:
                np.savez(temporary, **arrays, attrs=np.array(json.dumps(dataset.attrs, default=_plain)))


def _without_bools(attributes: dict[Any, Any]) -> dict[Any, Any]:
    """NetCDF knows neither bool nor None: 0 and 1, and nothing."""
    numbers = {name: int(value) if isinstance(value, bool) else value for name, value in attributes.items()}
    return {name: value for name, value in numbers.items() if value is not None}


def _plain(value: Any) -> Any:
    """NumPy numbers and arrays as JSON's."""
    return value.tolist()
