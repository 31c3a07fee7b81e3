"""`grimaldi validate`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from grimaldi.cli import options
from grimaldi.errors import InputError


def validate(
    only: Annotated[
        str | None, typer.Option(help="Some of the cases: 'airy,edge'.  [default: all]", metavar="NAMES")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of the table.")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Write accuracy.md, of these cases, and a plot of each into this folder.",
            metavar="DIR",
        ),
    ] = None,
    data: options.Data = None,
) -> None:
    """Hold the field against every closed form, and print the digits reached.

    Exit status 1 where a promise is missed.
    """
    from grimaldi.files import check_writable

    if output is not None and not output.is_dir():
        raise InputError(f"{output}: is no folder; make it first")
    if output is not None:
        check_writable(output / "accuracy.md")
    data = options.benchmark_data(data, "data/starshade")

    from grimaldi.validation import STARSHADE, chosen, report, run
    from grimaldi.validation.model import Settings

    names = [name.strip() for name in only.split(",")] if only is not None else []
    settings = Settings(data)
    checks = chosen(names, settings)
    if not as_json:
        print(report.header([*checks]))
    cases = []
    for case in run(checks):
        cases.append(case)
        if not as_json:
            print(report.row(case, [*checks]), flush=True)
    if as_json:
        print(json.dumps(report.as_json(cases), indent=2, ensure_ascii=False))
    elif not names and STARSHADE not in checks:
        print(f"{STARSHADE}: the benchmark data is not at hand; left out")
    if output is not None:
        written = report.write(cases, output)
        if not as_json:
            print(written)
    if any(case.verdict == "MISSED" for case in cases):
        raise typer.Exit(1)
