"""`grimaldi render`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from grimaldi.cli import options
from grimaldi.errors import InputError


def render(
    scene: options.Scene,
    output: Annotated[
        list[Path],
        typer.Option("--output", "-o", help="OUT.exr (every layer) or OUT.png; again for more of the same."),
    ],
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
    max_depth: Annotated[int | None, typer.Option(help="Longest camera path; 2 is direct light.")] = None,
    spp: Annotated[int | None, typer.Option(help="Samples per pixel.  [default: the scene's]")] = None,
    size: Annotated[
        str | None, typer.Option(help="Pixels, 700x500.  [default: the scene's]", metavar="WIDTHxHEIGHT")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of the random numbers.")] = None,
    view: Annotated[
        Literal["picture", "phase", "phase-cyclic", "phase-intensity"],
        typer.Option(help="What a .png shows."),
    ] = "picture",
    smooth: options.Smooth = None,
    variant: options.Variant = None,
) -> None:
    """Render SCENE with interference and diffraction."""
    from grimaldi import film

    views = ["picture" if path.suffix.lower() == ".exr" else view for path in output]
    for path, shown in zip(output, views, strict=True):
        film.check(path, shown)
    settings = options.given(
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
    )
    chosen = options.given(
        smooth=smooth, max_depth=max_depth, spp=spp, size=None if size is None else parse_size(size), seed=seed
    )
    options.set_variant(variant)

    from grimaldi.rendering import layers

    rendered = layers(scene, settings, **chosen)
    for path, shown in zip(output, views, strict=True):
        film.write(rendered, path, shown)


def parse_size(text: str) -> tuple[int, int]:
    """Width and height in pixels from "700x500", or "700" for a square."""
    width, _, height = text.lower().partition("x")
    try:
        size = int(width), int(height or width)
    except ValueError:
        size = (0, 0)
    if min(size) < 1:
        raise InputError(f"--size: {text!r} is no size in pixels; write it like 700x500")
    return size
