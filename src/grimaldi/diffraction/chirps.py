"""Waves over a block of receivers as chirps: what a piece sends there is A e^{iψ}, A and ψ quadratic in the place.

k(r + s - R) bends by little over the few pixels of a block, and what a short piece sends besides changes slowly. So a
wave is asked for at some places of a block, and told anywhere in it for a sine and a cosine; where these and a few
places between are not told closely enough it is no chirp there, but may be in a quadrant of a flat block (`waves`).
Places are two numbers on flat blocks, three about curved ones (`solids`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction import fine
from grimaldi.diffraction.arrays import Types
from grimaldi.diffraction.chains import chain_wave
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.hierarchy import least_detour
from grimaldi.diffraction.model import ACROSS, Receivers
from grimaldi.diffraction.search import sums
from grimaldi.diffraction.segment import Rule
from grimaldi.diffraction.sines import of_turns
from grimaldi.diffraction.table import Table
from grimaldi.outlines.model import Reals

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

Place = Sequence[Any]  # in a block, -1..1 along each axis


class Stencil(NamedTuple):
    """Places of a block that tell waves: terms of quadratics by the known, the first, and their errors by all."""

    places: Sequence[tuple[float, ...]]
    weights: Reals  # (terms, known): of values, in the terms of the quadratic nearest to them

    @staticmethod
    def of(known: Sequence[tuple[float, ...]], between: Sequence[tuple[float, ...]]) -> Stencil:
        return Stencil([*known, *between], np.linalg.pinv(np.array([_powers(place) for place in known])))


def _powers(place: tuple[float, ...]) -> list[float]:
    """The terms of quadratics at a place: 1, u, v, u², uv, v², and likewise of more axes."""
    return [1.0, *place, *(x * y for i, x in enumerate(place) for y in place[i:])]


SIDE = 3  # places across a flat block
FLAT = Stencil.of(
    [(u, v) for v in (-1.0, 0.0, 1.0) for u in (-1.0, 0.0, 1.0)],  # along the film's rows and columns
    [(u, 0.5) for u in (-0.5, 0.5)],
)
PLACES = len(FLAT.places)
QUADRANTS = 4
BEATS = 3.0  # turns, by which a piece's ends may be further apart in one place of a block than in another: beats
# between those where waves are asked for would look like none
FARTHEST = 1e30  # square of distances, for no distance


class Chirps(NamedTuple):
    """Waves over blocks. Packets for each: the terms of ψ/2π (`_powers`), then those of A."""

    packets: Any
    types: Types

    def and_those_of(self, other: Chirps) -> Chirps:
        """Both, one after the other."""
        return Chirps(dr.concat((self.packets, other.packets)), self.types)

    def at(self, i: Any, place: Place) -> tuple[Any, Any]:
        """Real and imaginary part of the wave i."""
        terms = (len(place) + 1) * (len(place) + 2) // 2
        count = _packets(terms)
        rows = (dr.gather(self.types.Packet, self.packets, count * i + j) for j in range(count))
        numbers = [x for row in rows for x in row]
        sin, cos = of_turns(_quadratic(numbers[:terms], place))
        amplitude = _quadratic(numbers[terms:], place)
        return amplitude * cos, amplitude * sin


def _packets(terms: int) -> int:
    """How many a chirp of so many terms takes."""
    return terms // 2  # four numbers of twice the terms


def _quadratic(terms: Sequence[Any], place: Place) -> Any:
    """The value of one, by its terms."""
    total, linear, square = terms[0], terms[1:], iter(terms[1 + len(place) :])
    for i, x in enumerate(place):
        slope = linear[i]
        for y in place[i:]:
            slope = dr.fma(y, next(square), slope)
        total = dr.fma(x, slope, total)
    return total


def quadrant(cell: Any) -> Any:
    """Which quadrant of its block a cell lies in."""
    half = ACROSS // 2
    return cell // (half * ACROSS) * 2 + cell % ACROSS // half


def place(receivers: Receivers) -> tuple[Any, Any]:
    """Where receivers lie in their blocks."""
    y = receivers.cell // ACROSS
    x = receivers.cell - y * ACROSS
    u, v = (mi.Float(cell) + part for cell, part in ((x, receivers.u), (y, receivers.v)))
    return dr.fma(u, 2 / ACROSS, -1), dr.fma(v, 2 / ACROSS, -1)


class Samples(NamedTuple):
    """What a piece sends along each ray: the wave, Δ/λ of its middle, and what that grows by from end to end."""

    real: Any
    imag: Any
    turns: Any
    spread: Any
    ray2: Any  # squared distance of the ray to it, and of the receiver
    receiver2: Any


def sampled(fr: Frame, tab: Table, k: Any, rule: Rule, piece: Any) -> Samples:
    """What pieces send along the rays of frames, one each; evaluated."""
    first, end = tab.range(piece)
    chain = chain_wave(fr, tab, first, end, k, rule, dr.mask_t(k)(True))
    middle, _ = tab.sphere(piece)
    turns = k / (2 * np.pi)
    spread = turns * (least_detour(fr, tab.corner(end - 1, 1), 0) - least_detour(fr, tab.corner(first, 0), 0))
    turns *= least_detour(fr, middle, 0)
    found = chain.wave.real, chain.wave.imag, turns, spread, dr.minimum(chain.distance2, FARTHEST), chain.receiver2
    dr.eval(*found)
    return Samples(*found)


def place_of(block: Any, i: Any, of: Any | None = None) -> Any:
    """Where the i-th of PLACES of blocks, or `of` one of their quadrants, stands among `fine.Fine`."""
    column, row = (
        dr.gather(type(i), type(i)([int(ACROSS // 2 * (place[axis] + 1)) for place in FLAT.places]), i)
        for axis in (0, 1)
    )
    if of is None:
        return fine.place(block, 2 * row, 2 * column)
    return fine.place(block, row + ACROSS * (of >> 1), column + ACROSS * (of & 1))


class Fit(NamedTuple):
    """Waves as chirps; over all places: the mean squares of them and of what chirps leave of them, by how many turns
    more the ends are apart in one place than in another, and the least squared distance of rays."""

    chirps: Chirps
    size2: Any
    off2: Any
    beats: Any
    ray2: Any

    def serves(self, most: Any, beats: float = BEATS) -> Any:
        """Whether no more is left than `most` (off2)."""
        return (self.off2 < most) & (self.beats < beats)


def fit(samples: Samples, n: int, types: Types, of: Any | None = None, stencil: Stencil = FLAT) -> Fit:
    """n waves, each by samples at a stencil's places, of blocks or `of` some quadrants of theirs (n,); evaluated."""
    F, index = types.Float, dr.arange(dr.uint32_array_t(types.Float), n)
    count, terms = len(stencil.places), len(stencil.weights)

    def at_places(values: Any) -> list[Any]:
        return [dr.gather(F, values, count * index + t) for t in range(count)]

    turns = [F(0), *_terms(stencil, at_places(samples.turns))[1:]]
    left: list[tuple[Any, Any]] = []
    for place, re, im in zip(stencil.places, at_places(samples.real), at_places(samples.imag), strict=True):
        sin, cos = of_turns(_quadratic(turns, place))
        left.append((re * cos + im * sin, im * cos - re * sin))
    mean, phases, amplitudes = _polar(left)
    phase, amplitude = _terms(stencil, phases), _terms(stencil, amplitudes)
    size2, off2 = F(0), F(0)
    for place, (re, im) in zip(stencil.places, left, strict=True):
        sin, cos = of_turns(mean + _quadratic(phase, place))
        told = _quadratic(amplitude, place)
        size2 += re * re + im * im
        off2 += dr.square(told * cos - re) + dr.square(told * sin - im)
    low, high, ray2 = F(dr.inf), F(-dr.inf), F(FARTHEST)
    for spread, distance2 in zip(at_places(samples.spread), at_places(samples.ray2), strict=True):
        low, high, ray2 = dr.minimum(low, spread), dr.maximum(high, spread), dr.minimum(ray2, distance2)
    psi = [a + b for a, b in zip(turns, phase, strict=True)]
    psi[0] += mean
    if of is not None:
        psi, amplitude = (_widened(t, of) for t in (psi, amplitude))
    numbers = [psi[0] - dr.round(psi[0]), *psi[1:], *amplitude]
    packets = dr.zeros(F, 2 * terms * n)
    for j in range(_packets(terms)):
        dr.scatter(packets, types.Packet(*numbers[4 * j : 4 * j + 4]), _packets(terms) * index + j)
    found = size2 / count, off2 / count, high - low, ray2
    dr.eval(packets, *found)
    return Fit(Chirps(packets, types), *found)


def allowed(block: Any, most: float, number: int, some: Any = True) -> Any:
    """`Fit.off2` of each of `some` waves of blocks, that together they leave `most`: as much as the others there."""
    count = sums(dr.select(mi.Bool(some), mi.UInt32(1), 0), block, number)
    return most**2 / mi.Float(dr.gather(mi.UInt64, count, block))


def _polar(values: list[tuple[Any, Any]]) -> tuple[Any, list[Any], list[Any]]:
    """Of complex numbers their mean phase, what theirs differ from it by, in turns, and amplitudes.

    Where that is more than a quarter the amplitude has the other sign instead: so it may go through zero.
    """
    real: Any = sum(re for re, _ in values)
    imag: Any = sum(im for _, im in values)
    inv = dr.rsqrt(dr.maximum(dr.fma(real, real, imag * imag), 1e-30))
    cos, sin = real * inv, imag * inv
    phases, amplitudes = [], []
    for re, im in values:
        along, across = re * cos + im * sin, im * cos - re * sin
        phases.append(dr.atan(across / dr.select(along == 0, 1, along)) / (2 * np.pi))
        amplitudes.append(dr.mulsign(dr.sqrt(dr.fma(re, re, im * im)), along))
    return dr.atan2(imag, real) / (2 * np.pi), phases, amplitudes


def _widened(terms: Sequence[Any], of: Any) -> tuple[Any, ...]:
    """The same quadratic at places of blocks, by its terms at places of some quadrants: u of these is 2u ± 1."""
    one, of_u, of_v, of_uu, of_uv, of_vv = terms
    s, t = (dr.select(side > 0, type(one)(1), -1) for side in (of & 1, of >> 1))
    return (
        one - s * of_u - t * of_v + of_uu + s * t * of_uv + of_vv,
        2 * of_u - 4 * s * of_uu - 2 * t * of_uv,
        2 * of_v - 4 * t * of_vv - 2 * s * of_uv,
        4 * of_uu,
        4 * of_uv,
        4 * of_vv,
    )


def _terms(stencil: Stencil, values: list[Any]) -> list[Any]:
    """Of the quadratic nearest to values at a stencil's known places."""
    return [sum(w * x for w, x in zip(row, values, strict=False) if abs(w) > 1e-9) for row in stencil.weights.tolist()]
