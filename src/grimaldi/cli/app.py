"""The commands put together."""

from __future__ import annotations

from typing import Annotated

import typer

from grimaldi import __version__
from grimaldi.cli import bench, doctor, field, figures, outline, render, validate


def _version(asked: bool) -> None:
    if asked:
        print(f"grimaldi {__version__}")
        raise typer.Exit


def _callback(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Say the version.")
    ] = False,
) -> None:
    """Waves for Mitsuba 3: interference and diffraction.

    Exit status: 0 done, 2 the input is wrong (one line says where and what to do), 1 anything else.
    """


app = typer.Typer(
    callback=_callback,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command("render")(render.render)
app.command("field")(field.field)
app.command("outline")(outline.outline)
app.command("figures")(figures.figures)
app.command("validate")(validate.validate)
app.command("bench")(bench.bench)
app.command("doctor")(doctor.doctor)
