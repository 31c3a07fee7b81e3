"""How time depends on how finely a body is meshed, where its silhouette stays the same."""

from __future__ import annotations

from collections.abc import Sequence

import grimaldi
from grimaldi.bench.error import field_error
from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.scenes import WAVELENGTH, box, floor_points
from grimaldi.bench.timing import anew, medians, timed, written
from grimaldi.scene.model import Scene

SPLITS = (9, 29, 91, 289)  # of a box's edges: 1e3, 1e4, 1e5 and 1e6 triangles
TOLERANCE = 1e-3
MOST = 1.5


def measure(settings: Settings) -> Result:
    if settings.quick:
        return refine((2, 4), 50, settings)
    return refine(SPLITS, 10_000, settings)


def refine(splits: Sequence[int], points: int, settings: Settings) -> Result:
    """`grimaldi.field` at so many points behind a box of 12 split² triangles, for each of the splits."""
    scenes, loading = zip(
        *(timed(lambda split=split: grimaldi.load(box(split, seed=settings.seed))) for split in splits), strict=True
    )
    where = floor_points(points, settings.seed)

    def field(scene: Scene) -> None:
        grimaldi.field(anew(scene), where, wavelength=WAVELENGTH, tolerance=TOLERANCE)

    times = medians(settings.runs, *(lambda scene=scene: field(scene) for scene in scenes))
    outlines = medians(settings.runs, *(lambda scene=scene: grimaldi.outline(anew(scene)) for scene in scenes))
    lines = tuple(
        {
            "triangles": f"{12 * split**2:,}",
            "making and loading, once": written(load),
            "outline segments": f"{len(grimaldi.outline(scene)):,}",
            "field": written(time),
            "outlines alone": written(alone),
            "error": f"{field_error(scene, where[:200], WAVELENGTH, TOLERANCE):.1e}",
        }
        for split, load, scene, time, alone in zip(splits, loading, scenes, times, outlines, strict=True)
    )
    text = (
        f"A turned box over a floor, its twelve edges and six sides divided: `grimaldi.field` at {points:,} points, "
        f"tolerance {TOLERANCE:g}, outlines included. Loading puts the triangles of a side together. The error is the "
        f"largest |ΔM| at {min(points, 200)} of them against a hundredth of the tolerance."
    )
    finest = f"{12 * splits[-1] ** 2:.0e}".replace("e+0", "e")
    coarsest = f"{12 * splits[0] ** 2:.0e}".replace("e+0", "e")
    return Result(
        text, lines, (Target(f"field time, {finest} / {coarsest} triangles", times[-1] / times[0], MOST, "×"),)
    )
