"""Extracting the outlines of many triangles as one source sees them."""

from __future__ import annotations

import grimaldi
from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.scenes import bodies, box
from grimaldi.bench.timing import anew, medians, timed, written

MOST = 3.0  # seconds


def measure(settings: Settings) -> Result:
    if settings.quick:
        return extract(4, 4, settings)
    return extract(289, 2_000, settings)


def extract(split: int, joined: int, settings: Settings) -> Result:
    """`grimaldi.outline` of a box of 12 split² triangles, and of so many bodies of 500 in one mesh."""
    scenes = {
        f"a box of {12 * split**2:,} triangles": timed(lambda: grimaldi.load(box(split, seed=settings.seed))),
        f"{joined:,} bodies in one mesh of {500 * joined:,}": timed(
            lambda: grimaldi.load(bodies(joined, seed=settings.seed, joined=True))
        ),
    }
    times = medians(settings.runs, *(lambda scene=scene: grimaldi.outline(anew(scene)) for scene, _ in scenes.values()))
    lines = tuple(
        {
            "": name,
            "making and loading, once": written(loading),
            "outline segments": f"{len(grimaldi.outline(scene)):,}",
            "time": written(time),
        }
        for (name, (scene, loading)), time in zip(scenes.items(), times, strict=True)
    )
    targets = tuple(Target(name, time, MOST, "s") for name, time in zip(scenes, times, strict=True))
    text = (
        "`grimaldi.outline` of loaded scenes, in Float64; no error but rounding. Loading puts the triangles of a plane "
        "side together, which leaves the box twelve."
    )
    return Result(text, lines, targets)
