"""Figure 5 a, b: a mesh by rays, by the report's sources and by the boundary integral."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.camera import seen
from grimaldi.conventions import parse_wavelengths
from grimaldi.diffraction.huygens import huygens
from grimaldi.diffraction.model import Options
from grimaldi.engine.points import at_points
from grimaldi.figures.drawing import Clock, side_by_side
from grimaldi.figures.model import Answer, Figure, Picture, Settings
from grimaldi.film.colour import automatic_exposure
from grimaldi.film.png import pixels
from grimaldi.outlines.offset_test import offset_outline
from grimaldi.propagate import propagate
from grimaldi.scene.builtin import creature

A_EDGE = 3  # sources, as in the report
REPORTS = f"the report: {A_EDGE} sources an edge"
REPORT = {"without": 34.0, "with": 6510.0, "sources": 5000}  # its times [s]
COUNTS = (6, 18, 54)  # sources an edge, of the time's growth
PERCENTILES = (10, 90)  # of the outline's length


def draw(settings: Settings) -> Figure:
    pictures: list[Picture] = []
    results: dict[str, str] = {}
    size = (700, 525) if settings.full else (280, 210)
    low, high = _three_ways(settings, "creature", creature.build(), None, size, pictures, results)
    if settings.killeroo:
        square = (700, 700) if settings.full else (240, 240)
        _three_ways(settings, "killeroo", str(settings.killeroo), 4.0, square, pictures, results)
    slope = exponent(COUNTS, sum_times(COUNTS, 512))
    results["the report's way, time against sources an edge"] = f"grows as n^{slope:.2f}"
    return Figure(
        "5",
        "A mesh and its shadow",
        "The report's picture, made three ways. Its sources have equal strength, so a finely meshed head gets more of "
        "them and shines into its own shadow; the boundary integral does not know how an edge is cut.",
        tuple(pictures),
        {
            "report": f"{A_EDGE} sources a silhouette edge, about {REPORT['sources']:,} in all; "
            f"{REPORT['without']:.0f} s without, {REPORT['with']:,.0f} s with diffraction (191×)",
            "samples": "as written; --full for the report's size",
        },
        results,
        (
            Answer(
                "Sources along silhouette edges show diffraction on a mesh (figure 5 a, b).",
                "reproduced",
                "By `--diffraction huygens`, with 3 sources an edge; its fringes and shadows are not Kirchhoff's.",
            ),
            Answer(
                "The head comes out too bright, because its mesh is finer.",
                "bettered",
                f"Along the creature's outline the report's sources are {low:.2g} to {high:.2g} times as strong as "
                "their length asks for (10th to 90th percentile). The boundary integral adds dφ: cutting changes "
                "nothing, to rounding.",
            ),
            Answer(
                "34 s without, 6,510 s with diffraction; the cost grows as the number of sources.",
                "bettered",
                f"The same sum grows as n^{slope:.2f} here too, and by the report's weights no n converges to "
                "Kirchhoff's field; the boundary integral's cost depends neither on λ nor on n.",
            ),
        ),
    )


def sum_times(counts: Sequence[int], points: int, runs: int = 1) -> list[float]:
    """Median seconds that the report's sum alone takes, with so many sources an edge, at points round the creature.

    Outlines are found and kernels compiled before the clock starts.
    """
    scene = grimaldi.load("creature")
    source = scene.sources[0]
    view = seen(scene, scene.mitsuba.sensors()[0]).points
    where = np.resize(view, (points, 3))
    k = 2 * np.pi / parse_wavelengths(scene.wavelength)[0]
    times = []
    for n in counts:
        wave = propagate(scene, source, huygens, k, Options(n=n), view)
        taken = []
        for _ in range(runs + 1):
            clock = Clock()
            for _ in at_points(wave, scene, source, where):
                pass
            taken.append(clock.seconds)
        times.append(float(np.median(taken[1:])))
    return times


def exponent(counts: Sequence[int], times: Sequence[float]) -> float:
    """Of the power of n that times grow as."""
    return float(np.polyfit(np.log(counts), np.log(times), 1)[0])


def _three_ways(
    settings: Settings,
    name: str,
    scene: Any,
    wavelength: float | None,
    size: tuple[int, int],
    pictures: list[Picture],
    results: dict[str, str],
) -> tuple[float, float]:
    """Render, draw and time; how much too weak and too strong the report's sources are along the first body."""
    spp = 16 if settings.full else 2
    loaded = grimaldi.load(scene)
    ways: dict[str, dict[str, Any]] = {
        "by rays": {"diffraction": "none", "spp": spp},
        f"the report: {A_EDGE} sources an edge": {
            "diffraction": "huygens",
            "n": A_EDGE,
            "spp": 16 if settings.full else 1,
        },
        "boundary integral": {"spp": spp},
    }
    times, shots = [], []
    for way in ways.values():
        clock = Clock()
        shots.append(grimaldi.render(loaded, wavelength=wavelength, size=size, **way))
        times.append(clock.seconds)
    exposure = automatic_exposure(shots[0]["picture"])
    shown = [(title, pixels(shot, "picture", exposure)) for title, shot in zip(ways, shots, strict=True)]
    side_by_side(settings.folder / f"figure-5-{name}.png", shown)
    outline = offset_outline(loaded, loaded.sources[0])
    sources = A_EDGE * len(outline)
    samples = size[0] * size[1]
    whole = times[1] * (700 * 700) / (samples * ways[REPORTS]["spp"])
    samples_a_pixel = ", ".join(str(way["spp"]) for way in ways.values())
    results[f"{name}: time by rays, report, boundary"] = (
        f"{times[0]:.2g}, {times[1]:.3g}, {times[2]:.3g} s at {size[0]} × {size[1]} and {samples_a_pixel} samples"
    )
    results[f"{name}: the report's way"] = (
        f"{sources:,} sources; at one sample a pixel of 700 × 700 this would be {whole:.0f} s (the report: 6,510 s)"
    )
    results[f"{name}: boundary, error"] = (
        f"{float(shots[2].error.mean() / abs(shots[2].U).max()):.1g} of the largest |U| on average"
    )
    caption = f"{name}: by rays, by the report's sources, by the boundary integral"
    pictures.append(Picture(f"figure-5-{name}.png", caption))
    return strengths(np.linalg.norm(outline.end - outline.start, axis=1)[outline.body == 0])


def strengths(lengths: NDArray[np.float64]) -> tuple[float, float]:
    """The 10th and 90th percentile, along an outline, of equal sources' strength over what edges (n,) that long ask."""
    order = np.argsort(-lengths)
    along = np.cumsum(lengths[order]) / lengths.sum()
    low, high = (int(np.searchsorted(along, percent / 100)) for percent in PERCENTILES)
    mean = lengths.mean()
    return float(mean / lengths[order][low]), float(mean / lengths[order][high])
