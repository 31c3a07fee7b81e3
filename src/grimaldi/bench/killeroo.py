"""The report's mesh on a floor before a wall: time with diffraction beside Mitsuba's `direct`."""

from __future__ import annotations

from pathlib import Path

import grimaldi
from grimaldi.bench.error import ALLOWED, HOW, Film, loosest, picture
from grimaldi.bench.model import Result, Settings, Skipped, Target
from grimaldi.bench.timing import LONG, beside, written

WAVELENGTHS = (0.4, 4.0)
MOST = 5.0  # times the time of `direct`


def measure(settings: Settings) -> Result | Skipped:
    path = settings.file("scenes", "killeroo.xml")
    if path is None:
        return Skipped("the benchmark data is not at hand; give its folder by --data")
    film = Film(48, 1, settings.seed) if settings.quick else Film(700, 16, settings.seed)
    return compare(path, film, settings.runs)


def compare(path: Path, film: Film, runs: int) -> Result:
    """Both renderers on `film`."""
    import drjit as dr
    import mitsuba as mi

    rays = mi.load_file(str(path), spp=film.spp, res=film.size)
    waves = grimaldi.load(path)

    def direct() -> None:
        dr.eval(mi.render(rays, spp=film.spp, seed=mi.UInt32(film.seed)))

    lines, targets = [], []
    for wavelength in WAVELENGTHS:
        found = loosest(waves, wavelength, film)

        def wave(wavelength: float = wavelength, tolerance: float = found.tolerance) -> None:
            picture(waves, wavelength, film, tolerance=tolerance)

        ours, theirs, done = beside(runs, found.time, wave, direct)
        name = f"λ = {wavelength:g}"
        lines.append(
            {
                "": name,
                **found.cells(),
                "runs": f"{done}",
                "first picture in its light, once": written(found.time),
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
        f"turn. Outlines and Dr.Jit's recordings are kept with the loaded scene, as its tree of triangles is; the "
        f"first picture in its light makes them. A picture is timed once where all runs would take more than "
        f"{LONG:g} s. {HOW}"
    )
    return Result(text, tuple(lines), tuple(targets))
