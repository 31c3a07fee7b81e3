"""Figure 4: the shadow mask, as a light from the side sees it."""

from __future__ import annotations

import grimaldi
from grimaldi.figures.drawing import Clock
from grimaldi.figures.model import Answer, Figure, Picture, Settings
from grimaldi.outlines.write import write


def draw(settings: Settings) -> Figure:
    pictures, results = [], {}
    scenes = {"creature": "creature"} | ({"killeroo": str(settings.killeroo)} if settings.killeroo else {})
    for name, scene in scenes.items():
        clock = Clock()
        loaded = grimaldi.load(scene)
        source = loaded.sources[0]
        outline = grimaldi.outline(loaded, source)
        write(outline, loaded, source, settings.folder / f"figure-4-{name}.png")
        results[name] = f"{len(outline):,} lit segments, {clock}"
        pictures.append(
            Picture(f"figure-4-{name}.png", f"{name}: mask in grey, lit outlines in red, as the light sees them")
        )
    return Figure(
        "4",
        "Shadow mask",
        "What a light that shines from the side sees of the body, and the outlines that diffract it: silhouettes in "
        "front of other lit parts count too.",
        tuple(pictures),
        {"outlines": "exact, in double precision; cut where one passes behind another"},
        results,
        (
            Answer(
                "Silhouettes of meshes are found by rays offset from their edges (figure 4).",
                "bettered",
                "An edge is an outline where all its faces lie on one side of it in the light's view, and it is cut at "
                "exact crossings: no offset ε, no gaps.",
            ),
        ),
    )
