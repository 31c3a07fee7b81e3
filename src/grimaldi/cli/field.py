"""`grimaldi field`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grimaldi.cli import options
from grimaldi.errors import InputError


def field(
    scene: options.Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="OUT.nc, OUT.zarr or OUT.npz.")],
    points: Annotated[Path | None, typer.Option(help="Points x, y, z in rows: .npy or .csv.", metavar="FILE")] = None,
    plane: Annotated[
        str | None,
        typer.Option(
            help="A grid instead: a corner, the ends of the two sides that start there, and the points "
            "along each: '-5,-5,10; 5,-5,10; -5,5,10; 100x100'.",
            metavar="GRID",
        ),
    ] = None,
    wavelength: options.Wavelength = None,
    scene_unit: options.SceneUnit = None,
    diffraction: options.Diffraction = None,
    interference: options.Interference = None,
    tolerance: options.Tolerance = None,
    precision: options.Precision = None,
    occlusion: options.Occlusion = None,
    rim: options.Rim = None,
    n: options.N = None,
    weights: options.Weights = None,
    epsilon: options.Epsilon = None,
    fast: options.Fast = None,
    smooth: options.Smooth = None,
    variant: options.Variant = None,
) -> None:
    """Compute the complex field of SCENE at points."""
    from grimaldi.cli.field_files import SUFFIXES, write
    from grimaldi.cli.points import parse_plane, read_points

    options.check_output(output, SUFFIXES)
    if (points is None) == (plane is None):
        raise InputError("field: give the points, by --points FILE or by --plane GRID")
    where, layout = (read_points(points), {}) if points is not None else parse_plane(plane or "")
    chosen = options.given(
        wavelength=wavelength,
        scene_unit=scene_unit,
        diffraction=diffraction,
        interference=interference,
        tolerance=tolerance,
        precision=precision,
        occlusion=occlusion,
        rim=rim,
        n=options.number(n),
        weights=weights,
        epsilon=epsilon,
        fast=fast,
        smooth=smooth,
    )
    options.set_variant(variant)

    import grimaldi

    dataset = grimaldi.field(scene, where, **chosen)
    if diffraction == "area" and n is not None:
        error, size = (float((abs(dataset[name]) ** 2).mean()) ** 0.5 for name in ("error", "U"))
        print(f"{n} samples a point: standard error {error:.3g} (variance {error**2:.3g}), |U| {size:.3g}, both rms")
    write(dataset.assign_attrs(layout), output)
