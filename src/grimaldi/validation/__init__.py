"""Every reference against `grimaldi.field`, one case a function: what is promised, and how far other models are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from grimaldi.conventions import did_you_mean
from grimaldi.errors import InputError
from grimaldi.validation import discs, edges, interference, openings, spheres
from grimaldi.validation.model import Case, Check, Settings
from grimaldi.validation.starshade import starshade

CASES: dict[str, Check] = {
    "sources": interference.sources,
    "young": interference.young,
    "hole-on-axis": openings.hole_on_axis,
    "hole-by-area": openings.hole_by_area,
    "hole-near": openings.hole_near,
    "lommel-hole": openings.lommel_hole,
    "airy": openings.airy_rings,
    "rectangle": openings.rectangle_hole,
    "slit": openings.single_slit,
    "slits": openings.several_slits,
    "kite": openings.kite,
    "star": openings.star,
    "edge": edges.edge,
    "arago": discs.spot,
    "lommel-disc": discs.lommel_disc,
    "arago-rs": discs.spot_rayleigh_sommerfeld,
    "sommerfeld-soft": edges.sommerfeld_soft,
    "sommerfeld-hard": edges.sommerfeld_hard,
    "double-edge": edges.double_knife_edge,
    "sphere-soft": spheres.soft,
    "sphere-hard": spheres.hard,
    "sphere-absorbing": spheres.absorbing,
}
STARSHADE = "starshade"


def chosen(names: Sequence[str], settings: Settings) -> dict[str, Check]:
    """The cases called `names`, all where there are none, in their own order; without the starshade's data not that.

    Raises InputError naming the nearest of a wrong one, or where the starshade is named but not at hand.
    """
    known = [*CASES, STARSHADE]
    for name in names:
        if name not in known:
            raise InputError(f"case: there is no {name!r}; {did_you_mean(name, known)}")
    folder = settings.starshade
    if STARSHADE in names and folder is None:
        raise InputError("starshade: its data is not at hand; give the benchmark data's folder by --data")
    every = CASES if folder is None else {**CASES, STARSHADE: partial(starshade, folder)}
    return {name: check for name, check in every.items() if name in names or not names}


def run(checks: dict[str, Check]) -> Iterator[Case]:
    """Each case, one at a time."""
    from grimaldi.variants import ensure_variant

    ensure_variant("mono")
    for check in checks.values():
        yield check()
