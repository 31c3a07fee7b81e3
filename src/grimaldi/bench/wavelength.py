"""How time depends on the wavelength, in one scene and at one tolerance."""

from __future__ import annotations

import grimaldi
from grimaldi.bench.error import field_error
from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.scenes import box, floor_points
from grimaldi.bench.timing import anew, medians, written

LONGEST = 0.1
SHORTER = 100
SPLIT = 9  # of the box's edges
TOLERANCE = 1e-3
MOST = 2.0


def measure(settings: Settings) -> Result:
    return shorten(50 if settings.quick else 10_000, settings)


def shorten(points: int, settings: Settings) -> Result:
    """`grimaldi.field` at so many points behind a box at LONGEST and at a wavelength SHORTER times shorter."""
    scene = grimaldi.load(box(SPLIT, seed=settings.seed))
    where = floor_points(points, settings.seed)
    wavelengths = (LONGEST, LONGEST / SHORTER)

    def field(wavelength: float) -> None:
        grimaldi.field(anew(scene), where, wavelength=wavelength, tolerance=TOLERANCE)

    times = medians(settings.runs, *(lambda wavelength=wavelength: field(wavelength) for wavelength in wavelengths))
    lines = tuple(
        {
            "λ": f"{wavelength:g}",
            "field": written(time),
            "error": f"{field_error(scene, where[:200], wavelength, TOLERANCE):.1e}",
        }
        for wavelength, time in zip(wavelengths, times, strict=True)
    )
    text = (
        f"A turned box, 4 × 3 × 2 units, 10 above a floor: `grimaldi.field` at {points:,} points, tolerance "
        f"{TOLERANCE:g}. The error is the largest |ΔM| at {min(points, 200)} of them against a hundredth of the "
        "tolerance."
    )
    return Result(text, lines, (Target(f"field time, λ/{SHORTER} / λ", times[1] / times[0], MOST, "×"),))
