"""How time grows with the number of bodies, all of one mesh and size, at one density and field of view."""

from __future__ import annotations

import math
from collections.abc import Sequence

import grimaldi
from grimaldi.bench.error import HOW, PATIENCE, Film, loosest, picture
from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.scenes import WAVELENGTH, bodies
from grimaldi.bench.timing import LONG, anew, beside, timed, written

NUMBERS = (10, 100, 1_000, 10_000)
MOST = 0.5  # the exponent over the last two decades


def measure(settings: Settings) -> Result:
    if settings.quick:
        return growth((2, 4, 8), Film(16, 1, settings.seed), settings.runs)
    return growth(NUMBERS, Film(256, 4, settings.seed), settings.runs)


def growth(numbers: Sequence[int], film: Film, runs: int, patience: float = PATIENCE) -> Result:
    """Times on `film` for each of at least three numbers of bodies.

    A picture that is expected to take longer than `patience` [s] is left out: by the power of the number that its time
    grew with before, or in proportion to it.
    """
    times: dict[int, float] = {}
    alone: dict[int, float] = {}  # of the outlines
    lines = []
    for n in numbers:
        expected = max(_expected(times, n), _expected(alone, n))
        if expected > patience:
            lines.append({"bodies": f"{n:,}", "time": f"left out: about {expected:.2g} s expected"})
        else:
            line, alone[n], times[n] = _one(n, film, runs, patience)
            lines.append(line)
    text = (
        "Bodies of 500 triangles and about 33 silhouette edges, each its own shape of radius 1, one to 16 square units "
        f"of a layer 10 above a floor, in one plane wave of λ = {WAVELENGTH:g}. The camera sees 16² of the floor under "
        f"the middle of the layer, at {film}. Times include outlines and visibility, not loading; a picture is timed "
        f"once where all runs would take more than {LONG:g} s, and left out where it is expected to take more than "
        f"{patience:g} s. {HOW}"
    )
    figure = f"exponent from {numbers[-3]:,} to {numbers[-1]:,} bodies"
    return Result(text, tuple(lines), (Target(figure, _slope(times, numbers[-3], numbers[-1]), MOST),))


def _one(n: int, film: Film, runs: int, patience: float) -> tuple[dict[str, str], float, float]:
    """The table's line for n bodies, and the seconds of their outlines alone and of the picture."""
    scene, loading = timed(lambda: grimaldi.load(bodies(n, seed=film.seed, size=film.size, spp=film.spp)))
    outline, alone = timed(lambda: grimaldi.outline(scene))
    found = loosest(scene, WAVELENGTH, film, patience)
    wave, rays, done = beside(
        runs,
        found.time,
        lambda: picture(anew(scene), WAVELENGTH, film, tolerance=found.tolerance),
        lambda: picture(scene, WAVELENGTH, film, diffraction="none"),
    )
    line = {
        "bodies": f"{n:,}",
        "outline segments": f"{len(outline):,}",
        "making and loading": written(loading),
        "outlines alone, once": written(alone),
        **found.cells(),
        "without diffraction": written(rays),
        "runs": f"{done}",
        "time": written(wave),
    }
    return line, alone, wave


def _expected(times: dict[int, float], n: int) -> float:
    """The time for n by the power of n that the last two showed, by n where there is but one; 0 where there is none."""
    if not times:
        return 0.0
    *before, last = times
    power = max(_slope(times, before[-1], last) or 0.0, 0.0) if before else 1.0
    return times[last] * (n / last) ** power


def _slope(times: dict[int, float], low: int, high: int) -> float | None:
    """d log time / d log n; None where one of them is missing."""
    if low not in times or high not in times:
        return None
    return math.log(times[high] / times[low]) / math.log(high / low)
