"""What was rendered, as files: EXR with every layer, PNG with one view."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from grimaldi.conventions import did_you_mean
from grimaldi.errors import InputError
from grimaldi.files import check_writable
from grimaldi.film import exr, png
from grimaldi.film.colour import automatic_exposure
from grimaldi.film.layers import Layers

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["automatic_exposure", "write"]


def write(
    dataset: xr.Dataset | Layers, path: str | Path, view: str = "picture", *, exposure: float | None = None
) -> None:
    """Write what `grimaldi.render` returned to `path`: all layers to .exr, one view to .png.

    Args:
        dataset: of `grimaldi.render`, or its plain arrays.
        path: ends in .exr (layers and header: see `film.exr.write`) or .png (8 bit sRGB).
        view: of a PNG: "picture", "phase" (red for 0..π, blue for π..2π, as in the report),
            "phase-cyclic" (even cyclic map), or "phase-intensity" (phase colour times intensity).
        exposure: factor on the linear values of a PNG. None chooses it so that the 99th percentile
            of the lit values is 0.9; give two pictures `automatic_exposure(one["picture"])` to
            compare them.

    Raises:
        InputError: unknown suffix or view, an exposure that is not a positive number, or a folder
            that is missing or not writable.
    """
    check(path, view, exposure=exposure)
    layers = dataset if isinstance(dataset, Layers) else Layers.of(dataset)
    if Path(path).suffix.lower() == ".exr":
        exr.write(layers, path)
    else:
        png.write(layers, path, view, exposure)


def check(path: str | Path, view: str = "picture", *, exposure: float | None = None) -> None:
    """Raise the InputError that `write` would, before any time is spent on rendering."""
    path = Path(path)
    if path.suffix.lower() not in (".exr", ".png"):
        raise InputError(f"{path}: unknown kind of picture {path.suffix!r}; end the name in .exr or .png")
    if view not in png.VIEWS:
        raise InputError(f"view: no view {view!r}; {did_you_mean(view, png.VIEWS)}")
    if path.suffix.lower() == ".exr" and view != "picture":
        raise InputError(f"view: {path} holds every layer, so it takes no view {view!r}; write a .png for one")
    if exposure is not None and not 0 < exposure < float("inf"):
        raise InputError(f"exposure: {exposure} is not a positive number; give a factor such as 1.0")
    check_writable(path)
