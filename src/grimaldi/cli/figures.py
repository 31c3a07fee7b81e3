"""`grimaldi figures`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grimaldi.cli import options
from grimaldi.errors import InputError


def figures(
    output: Annotated[Path, typer.Option("--output", "-o", help="A folder, made where it is missing.")],
    only: Annotated[
        str | None, typer.Option(help="Some of the figures: '1,3'.  [default: all of 1 to 7]", metavar="KEYS")
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="The report's sizes and samples: hours.")] = False,
    data: options.Data = None,
) -> None:
    """Draw every figure of the 2006 report by its own method and by Grimaldi's, into one page."""
    from grimaldi.files import check_writable

    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: is a file; name a folder")
    data = options.benchmark_data(data, "scenes/killeroo.xml")
    check_writable(output / "index.html" if output.is_dir() else output, folder=not output.is_dir())

    from grimaldi.figures import chosen, draw
    from grimaldi.figures.drawing import Clock
    from grimaldi.figures.model import Settings

    keys = chosen([name.strip() for name in only.split(",")] if only is not None else [])
    settings = Settings(output, full, data)
    if settings.killeroo is None and {"4", "5"} & set(keys):
        print("killeroo: the benchmark data is not at hand; left out")
    output.mkdir(exist_ok=True)
    clock = Clock()
    for figure in draw(settings, keys):
        print(f"{figure.key}  {figure.title}: {clock}", flush=True)
        clock = Clock()
    print(f"{output / 'index.html'}")
