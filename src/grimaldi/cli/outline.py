"""`grimaldi outline`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grimaldi.cli import options


def outline(
    scene: options.Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="OUT.svg, OUT.png (the shadow mask), or OUT.ply.")],
    source: Annotated[
        str | None, typer.Option(help="Which source, by name; needed where the scene has several.")
    ] = None,
    smooth: options.Smooth = None,
    variant: options.Variant = None,
) -> None:
    """Write the outlines and the shadow mask that a source sees."""
    options.check_output(output, (".svg", ".png", ".ply"))
    options.set_variant(variant)

    import grimaldi
    from grimaldi.outlines.write import write
    from grimaldi.scene.sources import pick_source

    loaded = grimaldi.load(scene, **options.given(smooth=smooth))
    seen_from = pick_source(loaded, source)
    write(grimaldi.outline(loaded, seen_from), loaded, seen_from, output)
