"""Several waves over a block as one chirp: what neighbours along an outline send goes nearly the same way.

Waves of a block are taken by twos, in their order, as long as the sum of two is told as well as each of them is.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba

from grimaldi.diffraction.chirps import FARTHEST, PLACES, Chirps, Fit, Samples, fit
from grimaldi.diffraction.hierarchy import NONE
from grimaldi.diffraction.lists import List

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

ROUNDS = 4
APART = 0.25  # turns, that two waves may run against each other over a block: no quadratic tells what more makes


def bundled(found: Fit, samples: Samples, wave: Any, block: Any, allowed: Any, number: int) -> tuple[Chirps, Any, Any]:
    """Chirps of bundles, after those found; off2 of each, as in `Fit`; and which one each wave is in.

    wave, block: those that may be bundled, in order of their blocks; allowed: off2, of each. A wave that is in the
    chirp of one before has NONE.
    """
    types, own = found.chirps.types, dr.arange(mi.UInt32, dr.width(found.off2))
    packets, off2 = [found.chirps.packets], [found.off2]
    chirp, size2 = mi.UInt32(wave), dr.gather(type(found.size2), found.size2, wave)
    values: list[Any] = [_of(v, wave) for v in samples[:3]]
    dr.eval(own, chirp, size2, values)
    for turn in range(ROUNDS):
        first = _firsts(block, number, turn % 2)
        if len(first) == 0:
            continue
        joint = _joint(values, size2, first)
        both = fit(joint, len(first), types)
        ok = (both.off2 < dr.gather(type(allowed), allowed, first)) & (both.beats < APART)
        index = sum(len(part) for part in off2) + dr.arange(mi.UInt32, len(first))
        dr.eval(ok, index)

        at, of = _places_of(first)
        for value, new in zip(values, joint[:3], strict=True):
            dr.scatter(value, new, at, dr.gather(mi.Bool, ok, of))
        dr.scatter(size2, both.size2, first, ok)
        dr.scatter(chirp, index, first, ok)
        dr.scatter(own, mi.UInt32(NONE), dr.gather(mi.UInt32, wave, first + 1, ok), ok)
        packets.append(both.chirps.packets)
        off2.append(both.off2)

        alone = dr.full(mi.Bool, True, len(block))
        dr.scatter(alone, mi.Bool(False), first + 1, ok)
        left: Any = dr.compress(alone)
        wave, block, chirp = (dr.gather(mi.UInt32, v, left) for v in (wave, block, chirp))
        size2, allowed = (dr.gather(type(v), v, left) for v in (size2, allowed))
        values = [_of(v, left) for v in values]
        dr.eval(wave, block, chirp, size2, allowed, values, own)
    dr.scatter(own, chirp, wave)
    return Chirps(dr.concat(packets), types), dr.concat(off2), own


def _firsts(block: Any, number: int, begin: int) -> Any:
    """Every other one in each block from the one that stands at `begin`, if there is a next."""
    index = dr.arange(mi.UInt32, len(block))
    of = List.of(dr.full(mi.Bool, True, len(block)), block, number, index)
    rank = index - dr.gather(mi.UInt32, of.begin, block)
    return dr.compress((rank % 2 == begin) & (index + 1 < dr.gather(mi.UInt32, of.begin, block + 1)))


def _places_of(some: Any) -> tuple[Any, Any]:
    """Where what some have at their PLACES stands among that of all; and whose each is."""
    index = dr.arange(mi.UInt32, PLACES * len(some))
    of = index // PLACES
    return PLACES * dr.gather(mi.UInt32, some, of) + index - PLACES * of, of


def _of(values: Any, some: Any) -> Any:
    """What some have at their PLACES."""
    return dr.gather(type(values), values, _places_of(some)[0])


def _joint(values: list[Any], size2: Any, first: Any) -> Samples:
    """What the first ones and the next send together; `spread`: by how many turns these run against each other."""
    a, b = first, first + 1
    _, of = _places_of(first)
    share = dr.gather(type(size2), size2, a) / (dr.gather(type(size2), size2, a) + dr.gather(type(size2), size2, b))
    (re, im, turns), (re2, im2, turns2) = ([_of(v, i) for v in values] for i in (a, b))
    joint = re + re2, im + im2, dr.lerp(turns2, turns, dr.gather(type(share), share, of)), turns2 - turns
    dr.eval(*joint)
    far = dr.full(type(size2), FARTHEST, PLACES * len(first))
    return Samples(*joint, far, far)
