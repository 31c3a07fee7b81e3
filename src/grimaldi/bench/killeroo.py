"""The report's mesh on a floor before a wall: time with diffraction beside Mitsuba's `direct`."""

from __future__ import annotations

from typing import Any

import grimaldi
from grimaldi.bench.error import ALLOWED, Film, loosest, picture
from grimaldi.bench.model import Result, Settings, Skipped, Target
from grimaldi.bench.timing import medians, written

WAVELENGTHS = (0.4, 4.0)
MOST = 5.0  # times the time of `direct`


def measure(settings: Settings) -> Result | Skipped:
    path = settings.file("scenes", "killeroo.xml")
    if path is None:
        return Skipped("the benchmark data is not at hand; give its folder by --data")
    if settings.quick:
        return compare(path, Film(48, 1, settings.seed), Film(24, 1, settings.seed), settings.runs)
    return compare(path, Film(700, 16, settings.seed), Film(settings.reference, 4, settings.seed), settings.runs)


def compare(path: Any, film: Film, small: Film, runs: int) -> Result:
    """Both renderers on `film`; the tolerance and its error found on the `small` one."""
    import drjit as dr
    import mitsuba as mi

    rays = mi.load_file(str(path), spp=film.spp, res=film.size)
    waves = grimaldi.load(path)

    def direct() -> None:
        dr.eval(mi.render(rays, spp=film.spp, seed=mi.UInt32(film.seed)))

    lines, targets = [], []
    for wavelength in WAVELENGTHS:
        found = loosest(waves, wavelength, small)

        def wave(wavelength: float = wavelength, tolerance: float = found.tolerance) -> None:
            picture(waves, wavelength, film, tolerance=tolerance)

        ours, theirs = medians(runs, wave, direct)
        name = f"λ = {wavelength:g}"
        lines.append(
            {
                "": name,
                "tolerance": f"{found.tolerance:g}",
                "error": f"{found.error:.1%}",
                "error measured at": str(found.film),
                "with diffraction": written(ours),
                "`direct`": written(theirs),
                "ratio": f"{ours / theirs:.3g}",
            }
        )
        targets += [
            Target(f"{name}: time / `direct`", ours / theirs, MOST, "×"),
            Target(f"{name}: error", found.error, ALLOWED),
        ]
    text = (
        f"`killeroo.xml` at {film}, loaded, warm: `grimaldi.render` and `mi.render` with the scene's own `direct`, in "
        f"turn. The tolerance is the loosest that keeps the error within {ALLOWED:.0%}: rms of the picture less that "
        "at tolerance 1e-4, over rms of that less the picture without diffraction, with the same random numbers."
    )
    return Result(text, tuple(lines), tuple(targets))
