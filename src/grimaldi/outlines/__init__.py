"""Outlines: the edges that bound a source's light, as that source sees them."""

from __future__ import annotations

from typing import Any

from grimaldi.one_at_a_time import one_at_a_time
from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Source


@one_at_a_time
def outline(scene: Any, source: Source | str | None = None) -> Outline:
    """The lit outlines that a source of a scene sees.

    Args:
        scene: whatever `grimaldi.load` takes.
        source: a source of the scene or its name; may be left out where there is only one.

    Returns:
        The outline as segments; of smooth shapes a polygon within 1e-4 of their size.

    Raises:
        InputError: the scene is wrong, or has no such source.
    """
    from grimaldi.outlines.extract import outline as extract
    from grimaldi.scene import load
    from grimaldi.scene.sources import pick_source

    loaded = load(scene)
    chosen = source if isinstance(source, Source) else pick_source(loaded, source)
    return extract(loaded.before(chosen), chosen)
