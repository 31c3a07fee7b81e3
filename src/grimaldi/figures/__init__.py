"""The figures of the report that Grimaldi began with, drawn anew: one figure a file, each with its scene beside it.

D. Johnston, P. Tarjan, "Ray-tracing Interference and Diffraction", Stanford CS348b, 2006.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from grimaldi.conventions import did_you_mean
from grimaldi.errors import InputError
from grimaldi.figures import bodies, corner, disc, mask, page, spheres, two_lights, wavelets
from grimaldi.figures.model import Draw, Figure, Settings
from grimaldi.files import replacing

FIGURES: dict[str, Draw] = {
    "1": two_lights.draw,
    "2": disc.draw,
    "3": wavelets.draw,
    "4": mask.draw,
    "5": bodies.draw,
    "6": spheres.draw,
    "7": corner.draw,
}


def chosen(names: Sequence[str]) -> tuple[str, ...]:
    """The keys of figures called `names`, all where there are none; InputError names the nearest of a wrong one."""
    for name in names:
        if name not in FIGURES:
            raise InputError(f"figure: there is no {name!r}; {did_you_mean(name, FIGURES)}")
    return tuple(key for key in FIGURES if key in names or not names)


def draw(settings: Settings, keys: Sequence[str]) -> Iterator[Figure]:
    """Draw figures into settings.folder, one at a time, and at last the page `index.html`."""
    from grimaldi.variants import ensure_variant

    ensure_variant("rgb")
    done = []
    for key in keys:
        done.append(FIGURES[key](settings))
        yield done[-1]
    missing = []
    if settings.killeroo is None and {"4", "5"} & set(keys):
        missing.append("The benchmark data with the killeroo mesh is not at hand; figures 4 and 5 are without it.")
    with replacing(settings.folder / "index.html") as temporary:
        temporary.write_text(page.page(done, missing), encoding="utf-8")
