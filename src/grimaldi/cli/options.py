"""Arguments and options that several commands share, and how they reach the library."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from grimaldi.conventions import ModelName
from grimaldi.errors import InputError

Scene = Annotated[
    str,
    typer.Argument(
        help="A scene file of Mitsuba (.xml) or pbrt (.pbrt), or a built-in scene: young, slit, arago, knife-edge, "
        "creature.",
        show_default=False,
    ),
]
Wavelength = Annotated[
    str | None,
    typer.Option(help="In scene units (0.4), or with a unit ('532 nm', '450 nm, 550 nm').", metavar="LENGTH"),
]
SceneUnit = Annotated[
    str | None,
    typer.Option(help="Length of one scene unit ('1 um'); for wavelengths with a unit.", metavar="LENGTH"),
]
Diffraction = Annotated[
    ModelName | None,
    typer.Option(help="The model of diffraction.  [default: boundary]"),
]
Interference = Annotated[
    bool | None,
    typer.Option("--interference/--no-interference", help="Whether sources of one group add as fields."),
]
Tolerance = Annotated[float | None, typer.Option(help="Largest error of M for each source and point.  [default: 1e-3]")]
Precision = Annotated[Literal["auto", "double"] | None, typer.Option(help="Of the edge integrals.")]
Occlusion = Annotated[
    Literal["graded", "binary", "none"] | None,
    typer.Option(help="How bodies block the way from an outline to a point.  [default: graded]"),
]
Rim = Annotated[
    Literal["sharp", "smooth"] | None,
    typer.Option(help="Of smooth bodies: as black screens, or with creeping waves.  [default: sharp]"),
]
N = Annotated[
    str | None,
    typer.Option(
        "--n", help="Sources an edge (or 'nyquist') of the model huygens, samples a point of area.", metavar="NUMBER"
    ),
]
Weights = Annotated[
    Literal["report", "length", "kernel"] | None, typer.Option(help="Of huygens' sources.  [default: report]")
]
Epsilon = Annotated[
    float | None, typer.Option(help="Of the report's silhouette test, in scene units.", metavar="LENGTH")
]
Data = Annotated[Path | None, typer.Option(help="Folder of the benchmark data.  [default: ../shared, if there]")]
Fast = Annotated[
    bool | None,
    typer.Option(
        "--fast/--no-fast", help="Whether one FFT may serve a plane behind holes, and M be interpolated over a picture."
    ),
]
Smooth = Annotated[
    int | None,
    typer.Option(help="Divide meshes with vertex normals into curved surfaces.  [default: 0]", metavar="LEVELS"),
]
Variant = Annotated[
    str | None, typer.Option(help="Mitsuba's variant, such as llvm_ad_rgb.  [default: the best that works]")
]


def given(**options: Any) -> dict[str, Any]:
    """The options that were given: the library's own defaults serve for the rest."""
    return {name: value for name, value in options.items() if value is not None}


def number(text: str | None) -> int | str | None:
    """A whole number where it is one; the library says what else may stand there."""
    return int(text) if text is not None and text.removeprefix("-").isdecimal() else text


def check_output(path: Path, suffixes: tuple[str, ...]) -> None:
    """Raise InputError where `path` could not be written, before anything is computed."""
    from grimaldi.files import check_writable

    if path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: unknown kind of file {path.suffix!r}; end the name in {', '.join(suffixes)}")
    check_writable(path, folder=path.suffix.lower() == ".zarr")


def set_variant(name: str | None) -> None:
    """Set Mitsuba's variant to `name`, if one is named."""
    if name is None:
        return
    import mitsuba as mi

    from grimaldi.conventions import did_you_mean
    from grimaldi.variants import check_variant, ensure_variant

    if name not in mi.variants():
        raise InputError(f"--variant: no variant {name!r}; {did_you_mean(name, mi.variants())}")
    check_variant(name)
    try:
        mi.set_variant(name)
    except ImportError:
        raise InputError(f"--variant: {name} does not work here; run 'grimaldi doctor' to see why") from None
    ensure_variant("rgb")


def benchmark_data(given: Path | None, what: str) -> Path | None:
    """The folder given, which has `what` in it; else `shared` beside the repository or the current folder, if there."""
    if given is not None:
        if not given.is_dir():
            raise InputError(f"--data: {given} is no folder; name the one that has {what} in it")
        return given
    for start in (Path.cwd(), *Path(__file__).resolve().parents[2:4]):
        folder = start.parent / "shared"
        if (folder / "scenes").is_dir():
            return folder
    return None
