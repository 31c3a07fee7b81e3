"""`grimaldi outline`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grimaldi.cli import options
from grimaldi.errors import InputError

if TYPE_CHECKING:
    from grimaldi.scene.model import Scene, Source


def outline(
    scene: options.Scene,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="OUT.svg, OUT.png (the shadow mask), or OUT.ply.")
    ],
    source: Annotated[
        str | None, typer.Option(help="Which source, by name; needed where the scene has several.")
    ] = None,
    variant: options.Variant = None,
) -> None:
    """Write the outlines and the shadow mask that a source sees."""
    options.check_output(output, (".svg", ".png", ".ply"))
    options.set_variant(variant)

    import grimaldi
    from grimaldi.outlines.write import write
    from grimaldi.variants import ensure_variant

    ensure_variant("mono")
    loaded = grimaldi.load(scene)
    seen_from = choose_source(loaded, source)
    write(grimaldi.outline(loaded, seen_from), loaded, seen_from, output)


def choose_source(scene: Scene, name: str | None) -> Source:
    """The source called `name`, or the only one."""
    names = ", ".join(source.name for source in scene.sources)
    if not scene.sources:
        raise InputError(f"{scene.name}: no source that diffracts; add a coherent_point, or a point emitter")
    if name is None and len(scene.sources) > 1:
        raise InputError(f"{scene.name}: has several sources; name one with --source: {names}")
    for source in scene.sources:
        if name is None or source.name == name:
            return source
    raise InputError(f"--source: {scene.name} has no source {name!r}; it has {names}")
