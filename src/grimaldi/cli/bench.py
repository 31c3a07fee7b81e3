"""`grimaldi bench`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grimaldi.cli import options
from grimaldi.errors import InputError


def bench(
    only: Annotated[
        str | None, typer.Option(help="Some of the rows: 'killeroo,start'.  [default: all]", metavar="NAMES")
    ] = None,
    list_rows: Annotated[bool, typer.Option("--list", help="Name the rows, and measure nothing.")] = False,
    seed: Annotated[int, typer.Option(help="Of scenes and random numbers.")] = 0,
    runs: Annotated[int, typer.Option(help="Timed runs, whose median counts.")] = 5,
    quick: Annotated[bool, typer.Option("--quick", help="Small sizes: to see that all works.")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Put each row, as it is done, into performance.md in this folder.", metavar="DIR"
        ),
    ] = None,
    data: options.Data = None,
    peers: Annotated[
        str | None, typer.Option(help="A Python that has LightPipes or diffractio.  [default: this one]")
    ] = None,
    variant: options.Variant = None,
) -> None:
    """Time every figure of speed beside its yardstick, and say what is reached."""
    import shutil

    from grimaldi.bench import ROWS, chosen

    if list_rows:
        width = max(map(len, ROWS))
        print("\n".join(f"{name:{width}}  {title}" for name, title in ROWS.items()))
        return
    names = chosen([name.strip() for name in only.split(",")] if only is not None else [])
    _check_number("--runs", runs, 1, 1000)
    _check_number("--seed", seed, 0, 2**32 - 1)
    if output is not None and not output.is_dir():
        raise InputError(f"{output}: is no folder; make it first")
    data = options.benchmark_data(data, "scenes/killeroo.xml")
    if peers is not None and shutil.which(peers) is None:
        raise InputError(f"--peers: {peers} is no program; name a Python that has LightPipes or diffractio")

    from grimaldi.bench import report, run
    from grimaldi.bench.model import Settings
    from grimaldi.files import check_writable

    if output is not None:
        check_writable(output / report.PAGE)
    options.set_variant(variant)
    settings = Settings(seed, runs, data, peers, quick)
    for name, row in run(names, settings):
        if output is not None:
            report.write(name, row, settings, output)
        print(report.section(name, row, settings), flush=True)
    print(report.facts(report.machine()))
    if output is not None:
        print(output / report.PAGE)


def _check_number(name: str, value: int, least: int, most: int) -> None:
    if not least <= value <= most:
        raise InputError(f"{name}: {value} is out of reach; give a number from {least} to {most}")
