"""What pieces send to blocks: which waves are chirps there, and which are too small to be told at all."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction.bundles import bundled
from grimaldi.diffraction.chirps import (
    FARTHEST,
    PLACES,
    QUADRANTS,
    Chirps,
    Fit,
    Samples,
    allowed,
    fit,
    place_of,
    sampled,
)
from grimaldi.diffraction.frame import Frames
from grimaldi.diffraction.hierarchy import NONE
from grimaldi.diffraction.lists import List, places
from grimaldi.diffraction.model import Blocks
from grimaldi.diffraction.search import Pairs, Search, sums
from grimaldi.diffraction.solids import solids
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

FITS = 0.08  # of the tolerance: what all chirps of a block may leave of M in the mean, each as much as the others
AWAY = 0.5  # radii of a block, that rays to it pass by the piece at least: waves beside a ray change within pixels
OFF = 2.0  # likewise, of a curved one, whose receivers may lie anywhere in a ball
SMALL = 0.05  # of the tolerance: the sum of |M| of waves that are left out
STEPS = 8  # powers of two that are tried as the largest of these
PARTS = 1 << 16  # of that sum, in which it is counted: sums of whole numbers are the same in any order


class Waves(NamedTuple):
    """What is known of pairs' waves, and how near their pieces are to blocks."""

    chirps: Chirps
    index: Any  # of each pair's chirp in each of QUADRANTS of its block, one pair after the other; NONE if it has none;
    # of pairs of curved blocks among `solids`
    off2: Any  # of each chirp, as in `Fit`
    inside: Any  # which of the pairs are told by another's chirp
    small: Any  # which of the pairs are left out
    left: Any  # of each block: what is left out of |M|
    clear: Any  # least distance to pieces that may send chirps: of the rays to PLACES of each block
    receiver2: Any  # and of those places themselves, squared
    solids: Chirps  # about curved blocks


def waves(
    search: Search, blocks: Blocks, frames: Frames, at_places: Frames, pairs: Pairs, wanted: Any, whole: Any
) -> Waves:
    """Of the wanted pairs; frames: of the rays to the middles of blocks, and to `Fine` places.

    whole: which of them reach all of their block.
    """
    number, unit = dr.width(blocks.p), 2 * np.pi * search.tolerance
    bends = dr.gather(mi.Float, blocks.bend, pairs.block) > 0
    size = dr.full(mi.Float, dr.inf, len(wanted))  # of waves; infinite where they may change over a block
    _of_curved(size, search, blocks, frames, pairs, wanted & bends)

    pair = places(wanted & ~bends)
    flat = dr.gather(mi.Bool, wanted & ~bends, pair)
    block, piece = (dr.gather(mi.UInt32, of, pair) for of in pairs[:2])
    samples = _samples(search, at_places, block, piece)
    found = fit(samples, len(pair), search.tab.types)
    radius = dr.gather(mi.Float, blocks.radius, block)
    apart = flat & (found.ray2 > dr.square(AWAY * radius))
    dr.scatter(size, mi.Float(dr.sqrt(found.size2)), pair, apart)
    small, left = _small(size / (SMALL * unit), pairs.block, number)
    near = _nearest(samples, block, number)
    about = solids(search, blocks, pairs, wanted & bends & ~whole & ~small)

    most = allowed(block, FITS * unit, number, flat)
    told = ~dr.gather(mi.Bool, small, pair)
    fits = apart & told & found.serves(most)
    some = places(fits & dr.gather(mi.Bool, whole, pair))
    of_some, most_of_some = dr.gather(mi.UInt32, block, some), dr.gather(mi.Float, most, some)
    chirps, off2, chirp = bundled(found, samples, some, of_some, most_of_some, number)
    dr.eval(fits, chirp)
    index = dr.full(mi.UInt32, NONE, QUADRANTS * len(wanted))
    for i in range(QUADRANTS):
        dr.scatter(index, chirp, QUADRANTS * pair + i, fits)
        dr.scatter(index, dr.arange(mi.UInt32, len(about.pair)), QUADRANTS * about.pair + i, about.serves)
    inside = dr.zeros(mi.Bool, len(wanted))
    dr.scatter(inside, mi.Bool(True), pair, fits & (chirp == NONE))

    rest = places(flat & told & ~fits)
    least = 0.5 * AWAY * radius
    of_rest = (dr.gather(type(v), v, rest) for v in (block, piece, least, most))
    parts, entry, of, serves = _in_quadrants(search, at_places, *of_rest)
    entry = dr.gather(mi.UInt32, rest, entry)
    serves &= dr.gather(mi.Bool, flat & told & ~fits, entry)
    own = QUADRANTS * dr.gather(mi.UInt32, pair, entry) + of
    dr.scatter(index, dr.width(off2) + dr.arange(mi.UInt32, len(entry)), own, serves)
    off2 = mi.Float(dr.concat((off2, parts.off2)))
    chirps = chirps.and_those_of(parts.chirps)
    dr.eval(index, inside, chirps.packets, off2)
    ray2 = dr.gather(mi.Float, about.ray2, dr.arange(mi.UInt32, PLACES * number) // PLACES)
    clear, receiver2 = dr.minimum(near[0], dr.sqrt(ray2)), dr.minimum(near[1], ray2)
    dr.eval(clear, receiver2)
    return Waves(chirps, index, off2, inside, small, SMALL * search.tolerance * left, clear, receiver2, about.chirps)


def _in_quadrants(
    search: Search, frames: Frames, block: Any, piece: Any, least: Any, most: Any
) -> tuple[Fit, Any, Any, Any]:
    """Chirps in all quadrants of blocks: of which of these, in which quadrant, and whether they serve.

    least: how far rays pass by the piece; most: off2.
    """
    index = dr.arange(mi.UInt32, QUADRANTS * len(block))
    entry, of = index // QUADRANTS, index % QUADRANTS
    block, piece = (dr.gather(mi.UInt32, v, entry) for v in (block, piece))
    found = fit(_samples(search, frames, block, piece, of), len(index), search.tab.types, of)
    serves = found.ray2 > dr.square(dr.gather(mi.Float, least, entry))
    serves &= found.serves(dr.gather(mi.Float, most, entry))
    return found, entry, of, serves


def _of_curved(size: Any, search: Search, blocks: Blocks, frames: Frames, pairs: Pairs, wanted: Any) -> None:
    """Put sizes of the wanted pairs, whose blocks are curved, where waves do not change over these."""
    pair = places(wanted)
    block, piece = (dr.gather(mi.UInt32, of, pair) for of in pairs[:2])
    there = sampled(frames.some(block), search.tab, search.k, search.rule, piece)
    apart = there.ray2 > dr.square(OFF * dr.gather(mi.Float, blocks.radius, block))
    apart &= dr.gather(mi.Bool, wanted, pair)
    dr.scatter(size, mi.Float(dr.sqrt(dr.square(there.real) + dr.square(there.imag))), pair, apart)


def _samples(search: Search, frames: Frames, block: Any, piece: Any, of: Any | None = None) -> Samples:
    """What pieces send to each of PLACES of blocks, or `of` quadrants of theirs."""
    index = dr.arange(mi.UInt32, PLACES * len(piece))
    own = index // PLACES
    block, piece = (dr.gather(mi.UInt32, v, own) for v in (block, piece))
    at = place_of(block, index - PLACES * own, None if of is None else dr.gather(mi.UInt32, of, own))
    return sampled(frames.some(at), search.tab, search.k, search.rule, piece)


def _small(size: Any, block: Any, number: int) -> tuple[Any, Any]:
    """Which of the sizes are so small that all of them together make no more than 1 in each block; their sums."""
    parts = mi.UInt32(dr.minimum(dr.ceil(size * PARTS), PARTS))
    limit = dr.zeros(mi.UInt32, number)
    for step in range(1, STEPS + 1):
        most = PARTS >> step
        limit = dr.maximum(limit, dr.select(sums(parts, block, number, parts <= most) <= PARTS, most, 0))
    small = parts <= dr.gather(mi.UInt32, limit, block)
    left = mi.Float(sums(parts, block, number, small)) / PARTS
    dr.eval(small, left)
    return small, left


@syntax
def _nearest(samples: Samples, block: Any, number: int) -> tuple[Any, Any]:
    """`clear` and `receiver2` of `Waves`."""
    n = len(block)
    of = List.of(dr.full(mi.Bool, True, n), block, number, dr.arange(mi.UInt32, n))
    index = dr.arange(mi.UInt32, number * PLACES)
    own = index // PLACES
    ray2, receiver2 = mi.Float(FARTHEST), mi.Float(FARTHEST)
    i, end = of.bounds(own, mi.Bool(True))
    while i < end:
        at = PLACES * i + index % PLACES
        ray2 = dr.minimum(ray2, mi.Float(dr.gather(type(samples.ray2), samples.ray2, at)))
        receiver2 = dr.minimum(receiver2, mi.Float(dr.gather(type(samples.receiver2), samples.receiver2, at)))
        i += 1
    clear = dr.sqrt(ray2)
    dr.eval(clear, receiver2)
    return clear, receiver2
