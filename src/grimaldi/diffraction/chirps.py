"""Waves over a flat block of receivers as chirps: what a piece sends there is A e^{iψ}, A and ψ quadratic in the place.

k(r + s - R) bends by little over the few pixels of a block, and what a short piece sends besides changes slowly. So a
wave is asked for at nine places of a block, and told anywhere in it for a sine and a cosine; where these and two
places between are not told closely enough it is no chirp there, but may be in a quadrant of the block (`waves`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction import fine
from grimaldi.diffraction.arrays import Types
from grimaldi.diffraction.edges import chain_wave
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.hierarchy import least_detour
from grimaldi.diffraction.model import ACROSS, Receivers
from grimaldi.diffraction.segment import Rule
from grimaldi.diffraction.sines import of_turns
from grimaldi.diffraction.table import Table

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

SIDE = 3  # places across a block, by which waves are told
GRID = [(u, v) for v in (-1.0, 0.0, 1.0) for u in (-1.0, 0.0, 1.0)]
BETWEEN = [(u, 0.5) for u in (-0.5, 0.5)]
PLACES = len(GRID) + len(BETWEEN)
QUADRANTS = 4
PACKETS = 3
FARTHEST = 1e30  # square of distances, for no distance


class Chirps(NamedTuple):
    """Waves over blocks: real and imaginary part at places u, v of those, -1..1 along the film's rows and columns.

    Three packets for each: the terms of ψ/2π in 1, u, v, u², uv, v², then those of A.
    """

    packets: Any
    types: Types

    def and_those_of(self, other: Chirps) -> Chirps:
        """Both, one after the other."""
        return Chirps(dr.concat((self.packets, other.packets)), self.types)

    def at(self, i: Any, u: Any, v: Any) -> tuple[Any, Any]:
        """The wave i."""
        a, b, c = (dr.gather(self.types.Packet, self.packets, PACKETS * i + j) for j in range(PACKETS))
        sin, cos = of_turns(_quadratic((*a, b.x, b.y), u, v))
        amplitude = _quadratic((b.z, b.w, *c), u, v)
        return amplitude * cos, amplitude * sin


def _quadratic(terms: tuple[Any, ...], u: Any, v: Any) -> Any:
    """The value of one, by its terms in 1, u, v, u², uv, v²."""
    one, of_u, of_v, of_uu, of_uv, of_vv = terms
    return dr.fma(u, dr.fma(u, of_uu, dr.fma(v, of_uv, of_u)), dr.fma(v, dr.fma(v, of_vv, of_v), one))


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
    chain = chain_wave(fr, tab, first, end, k, rule, None, False, dr.mask_t(k)(True))
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
        dr.gather(type(i), type(i)([int(ACROSS // 2 * (place[axis] + 1)) for place in (*GRID, *BETWEEN)]), i)
        for axis in (0, 1)
    )
    if of is None:
        return fine.place(block, 2 * row, 2 * column)
    return fine.place(block, row + ACROSS * (of >> 1), column + ACROSS * (of & 1))


class Fit(NamedTuple):
    """Waves as chirps; over PLACES: the mean squares of them and of what chirps leave of them, by how many turns more
    the ends are apart in one place than in another, and the least squared distance of rays."""

    chirps: Chirps
    size2: Any
    off2: Any
    beats: Any
    ray2: Any


def fit(samples: Samples, n: int, types: Types, of: Any | None = None) -> Fit:
    """n waves, each by PLACES samples, of blocks or `of` some quadrants of theirs (n,); evaluated."""
    F, index = types.Float, dr.arange(dr.uint32_array_t(types.Float), n)

    def at_places(values: Any) -> list[Any]:
        return [dr.gather(F, values, PLACES * index + t) for t in range(PLACES)]

    turns = (F(0), *_terms(at_places(samples.turns))[1:])
    left: list[tuple[Any, Any]] = []
    for (u, v), re, im in zip((*GRID, *BETWEEN), at_places(samples.real), at_places(samples.imag), strict=True):
        sin, cos = of_turns(_quadratic(turns, u, v))
        left.append((re * cos + im * sin, im * cos - re * sin))
    mean, phases, amplitudes = _polar(left)
    phase, amplitude = _terms(phases), _terms(amplitudes)
    size2, off2 = F(0), F(0)
    for (u, v), (re, im) in zip((*GRID, *BETWEEN), left, strict=True):
        sin, cos = of_turns(mean + _quadratic(phase, u, v))
        told = _quadratic(amplitude, u, v)
        size2 += re * re + im * im
        off2 += dr.square(told * cos - re) + dr.square(told * sin - im)
    low, high, ray2 = F(dr.inf), F(-dr.inf), F(FARTHEST)
    for spread, distance2 in zip(at_places(samples.spread), at_places(samples.ray2), strict=True):
        low, high, ray2 = dr.minimum(low, spread), dr.maximum(high, spread), dr.minimum(ray2, distance2)
    psi = [a + b for a, b in zip(turns, phase, strict=True)]
    psi[0] += mean
    if of is not None:
        psi, amplitude = (_widened(terms, of) for terms in (psi, amplitude))
    numbers = [psi[0] - dr.round(psi[0]), *psi[1:], *amplitude]
    packets = dr.zeros(F, 4 * PACKETS * n)
    for j in range(PACKETS):
        dr.scatter(packets, types.Packet(*numbers[4 * j : 4 * j + 4]), PACKETS * index + j)
    found = size2 / PLACES, off2 / PLACES, high - low, ray2
    dr.eval(packets, *found)
    return Fit(Chirps(packets, types), *found)


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


def _terms(values: list[Any]) -> tuple[Any, ...]:
    """Of the quadratic nearest to values on the GRID: 1, u, v, uv, u² - 2/3 and v² - 2/3 are orthogonal there."""

    def along(term: Callable[[float, float], float]) -> Any:
        weights = [term(u, v) for u, v in GRID]
        return sum(w * x for w, x in zip(weights, values, strict=False) if w) / sum(w * w for w in weights)

    of_uu, of_vv = along(lambda u, v: u * u - 2 / 3), along(lambda u, v: v * v - 2 / 3)
    one = along(lambda u, v: 1) - 2 / 3 * (of_uu + of_vv)
    return one, along(lambda u, v: u), along(lambda u, v: v), of_uu, along(lambda u, v: u * v), of_vv
