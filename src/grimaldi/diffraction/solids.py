"""Waves about curved blocks of receivers as chirps: in the box that holds a block, quadratic along its three axes.

Surfaces may bend and fold there as they like: a wave in free space is as smooth above them as on them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction.chirps import FARTHEST, Chirps, Stencil, allowed, fit, sampled
from grimaldi.diffraction.lists import places
from grimaldi.diffraction.model import Blocks
from grimaldi.diffraction.search import Pairs, Search

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

GOLDEN = 0.5 * (1 + 5**0.5)
ON_AXES = [(0.0, a, b * GOLDEN) for a in (-1, 1) for b in (-1, 1)]
CORNERS = [corner[i:] + corner[:i] for corner in ON_AXES for i in range(3)]  # of an icosahedron, all as far apart
BEATS = 6.0  # as of flat blocks, for more places
WITHIN = 0.55  # along each axis: where waves are compared once more
FITS = 0.16  # of the tolerance: what all chirps of a block may leave of M in the mean, each as much as the others
AWAY = 0.25  # radii of a block, which have room, that rays to it pass by the piece at least
SPACE = Stencil.of(
    [(0.0, 0.0, 0.0), *(tuple(x / (1 + GOLDEN**2) ** 0.5 for x in corner) for corner in CORNERS)],
    [(x * WITHIN, y * WITHIN, x * y * WITHIN) for x in (-1.0, 1.0) for y in (-1.0, 1.0)],
)


class Solids(NamedTuple):
    """Chirps of pairs of curved blocks and pieces."""

    pair: Any  # which each is of
    serves: Any  # whether it tells the wave closely enough
    chirps: Chirps
    ray2: Any  # of each block: the least squared distance of its rays to what sends chirps


def solids(search: Search, blocks: Blocks, pairs: Pairs, wanted: Any) -> Solids:
    """Those of the wanted pairs."""
    count, number = len(SPACE.places), dr.width(blocks.p)
    curved = places(blocks.bend > 0)
    rank = dr.zeros(mi.UInt32, number)
    dr.scatter(rank, dr.arange(mi.UInt32, len(curved)), curved)
    frames = search.frames(_points(blocks, curved))
    pair = places(wanted)
    block, piece = (dr.gather(mi.UInt32, of, pair) for of in (pairs.block, pairs.piece))
    index = dr.arange(mi.UInt32, count * len(pair))
    own = index // count
    at = count * dr.gather(mi.UInt32, rank, dr.gather(mi.UInt32, block, own)) + (index - count * own)
    samples = sampled(frames.some(at), search.tab, search.k, search.rule, dr.gather(mi.UInt32, piece, own))
    found = fit(samples, len(pair), search.tab.types, stencil=SPACE)
    serves = found.serves(allowed(block, FITS * 2 * np.pi * search.tolerance, number), BEATS)
    serves &= found.ray2 > dr.square(AWAY * dr.gather(mi.Float, blocks.radius, block))
    serves &= dr.gather(mi.Bool, wanted, pair)
    ray2 = dr.full(mi.Float, FARTHEST, number)
    dr.scatter_reduce(dr.ReduceOp.Min, ray2, mi.Float(found.ray2), block, serves)
    dr.eval(serves, ray2)
    return Solids(pair, serves, found.chirps, ray2)


def _points(blocks: Blocks, block: Any) -> Any:
    """Where the stencil's places lie about some blocks, one block after the other (Float64)."""
    count = len(SPACE.places)
    index = dr.arange(mi.UInt32, count * len(block))
    own = dr.gather(mi.UInt32, block, index // count)
    p = dr.gather(type(blocks.p), blocks.boxes.middle, own)
    for i, axis in enumerate(blocks.boxes.axes_of(own, mi.Bool(True))):
        place = dr.gather(mi.Float, mi.Float([place[i] for place in SPACE.places]), index % count)
        p += type(p)(place / dr.squared_norm(axis) * axis)
    return p
