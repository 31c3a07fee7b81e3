"""A picture as tiles: each a pure function of (scene, light, seed, pixels), summed in a fixed order.

Rays are made here and random numbers follow from (seed, pixel, sample) alone, so that a tile equals the same pixels
of the whole picture bit for bit, with any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.camera import rays
from grimaldi.diffraction.model import OUTSIDE, Factor, Receivers
from grimaldi.engine.asking import Ask, ask, pieces, work
from grimaldi.engine.blocks import Sight, squares
from grimaldi.engine.cells import Cells, Known, cells
from grimaldi.engine.means import Tile, Traced, means
from grimaldi.engine.nodes import LARGEST, ROWS, Nodes
from grimaldi.light import Light, Reflected
from grimaldi.tracing import trace

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

ASKED = 1 << 19  # rays of a tile at whose ends the model is asked for M, fewer where that takes long: some seconds
RAYS = 1 << 22  # of a tile in all: some hundred bytes each
PAIRS = 1 << 27  # of blocks of a band and what is looked at for them
NODES = 1 << 23  # of the cells of a band of the film: some twenty bytes each


@dataclass
class Stream:
    """A sampler whose numbers come from a generator of each sample's own."""

    rng: Any

    def next_1d(self, active: Any = True) -> Any:
        return self.rng.next_float32(active)

    def next_2d(self, active: Any = True) -> Any:
        return mi.Point2f(self.rng.next_float32(active), self.rng.next_float32(active))


@dataclass(frozen=True)
class Shot:
    """What is rendered: film size in pixels, samples a pixel, seed, and how far paths go."""

    width: int
    height: int
    spp: int
    seed: int
    max_depth: int
    rr_depth: int
    hide_emitters: bool


@dataclass(frozen=True, eq=False)
class Band:
    """Some rows of the film, and M of each beam over them, where it is interpolated."""

    top: int
    rows: int
    cells: tuple[Cells, ...]
    asks: tuple[Ask, ...]


def bands(light: Light, sensor: Any, shot: Shot) -> Iterator[Band]:
    """The film from its top on, as many rows at once as memory allows."""
    if not light.shares or sensor.needs_aperture_sample():
        yield Band(0, shot.height, (), ())
        return
    finest = 1 if shot.spp >= 8 else 2 if shot.spp >= 2 else 4  # a finer cell asks no less than its pixels would
    row = len(light.beams) * ROWS * shot.width * (2 / finest) ** 2 / NODES
    items = max((pieces(beam.factor) for beam in light.beams), default=0)
    step = ROWS * max(int(1 / max(row, items * shot.width * ROWS / (LARGEST**2 * PAIRS))), 1)
    for top in range(0, shot.height, step):
        rows = min(step, shot.height - top)
        film = squares(lambda x, y: sight(light, sensor, shot, x, y)[0], shot.width, top, rows) if items else None
        asks = tuple(ask(film, beam.factor, beam.recordings) for beam in light.beams)
        found = tuple(
            cells(partial(_nodes, light, a, sensor, shot), shot.width, top, rows, finest, shares)
            for a, shares in zip(asks, light.shares, strict=True)
        )
        yield Band(top, rows, found, asks)


def tiles(light: Light, shot: Shot, band: Band) -> Iterator[tuple[int, int]]:
    """First pixel and number of pixels of each tile of a band."""
    pixels = shot.width * band.rows
    shares = [min(m.unknown / pixels, 1) for m in band.cells] if band.cells else [float(light.asks)] * len(light.beams)
    asked = sum(share * work(beam.factor) for share, beam in zip(shares, light.beams, strict=True))
    step = int(max(min(RAYS, ASKED / max(asked, 1e-9)) // shot.spp, 1))
    first = band.top * shot.width
    for begin in range(0, pixels, step):
        yield first + begin, min(step, pixels - begin)


def sight(light: Light, sensor: Any, shot: Shot, x: Any, y: Any) -> tuple[Sight, Any]:
    """What the camera sees at places of the film [pixels], and Mitsuba's interactions."""
    place = mi.Point2f(x, y) / mi.Point2f(dr.opaque(mi.Float, shot.width), dr.opaque(mi.Float, shot.height))
    ray, _ = rays(sensor, sensor.shutter_open(), 0.5, place, mi.Point2f(0.5))
    si = light.scene.mitsuba.ray_intersect(ray, mi.RayFlags.All, True, True)  # neighbours go the same way
    lit = si.is_valid() & mi.has_flag(si.bsdf(ray).flags(), mi.BSDFFlags.Smooth)
    n = mi.Vector3f(dr.mulsign(si.n, -dr.dot(si.n, ray.d)))
    shape = light.hits.surface(si, lit)
    return Sight(ray, Receivers(light.hits.point(ray, si, lit), n, lit), shape), si


def _nodes(light: Light, ask: Ask, sensor: Any, shot: Shot, x: Any, y: Any) -> Nodes:
    """M at what the camera sees at places of the film [pixels]."""
    (ray, receivers, shape), si = sight(light, sensor, shot, x, y)
    n = receivers.n
    pixel = mi.Float(0)
    for o, d in ((ray.o_x, ray.d_x), (ray.o_y, ray.d_y)):
        pixel = dr.maximum(pixel, dr.norm(o + d * (dr.dot(n, si.p - o) / dr.dot(n, d)) - si.p))
    dr.eval(*receivers, si.t, shape, pixel)  # the camera's rays in a kernel of their own
    m = ask(x, y, receivers)
    return Nodes(mi.Float(m.real), mi.Float(m.imag), mi.Float(m.error), si.t, shape, mi.Float(m.clearance) / pixel)


def _sample(shot: Shot, pixel: Any, sample: Any) -> tuple[Stream, Any]:
    """The random numbers of samples of pixels, and where they lie on the film [pixels], by the first two."""
    identity = mi.sample_tea_32(dr.opaque(mi.UInt32, shot.seed), pixel * dr.opaque(mi.UInt32, shot.spp) + sample)
    stream = Stream(mi.PCG32(initstate=mi.UInt64(identity[0]), initseq=mi.UInt64(identity[1])))
    column, row = pixel % dr.opaque(mi.UInt32, shot.width), pixel // dr.opaque(mi.UInt32, shot.width)
    return stream, mi.Point2f(mi.Float(column), mi.Float(row)) + stream.next_2d()


class Samples(NamedTuple):
    """M at all samples of some pixels of a tile."""

    rank: Any  # of a pixel among them, OUTSIDE if it is none of them; None if these are all that are traced
    there: Any  # whether a sample saw a lit surface: beside an edge, rounding decides, and a second look may differ
    real: Any
    imag: Any
    error: Any

    def at(self, pixel: Any, index: Any, spp: int, active: Any) -> Known:
        """M at samples of the tile's pixels."""
        if self.rank is None:
            real, imag, error = self[2:]
            return Known(real, imag, error, active & self.there)
        rank = dr.gather(mi.UInt32, self.rank, pixel, active)
        holds = active & (rank != OUTSIDE)
        place = rank * dr.opaque(mi.UInt32, spp) + (index - pixel * dr.opaque(mi.UInt32, spp))
        holds &= dr.gather(mi.Bool, self.there, place, holds)
        real, imag, error = (dr.gather(mi.Float, values, place, holds) for values in self[2:])
        return Known(real, imag, error, holds)


def _at_samples(light: Light, ask: Ask, sensor: Any, shot: Shot, first: int, pixels: int, cells: Cells) -> Samples:
    """M at the samples of the pixels that no cell serves: by nodes on the same shape, or asked together."""
    rank = dr.full(mi.UInt32, OUTSIDE, pixels)
    every = dr.opaque(mi.UInt32, first) + dr.arange(mi.UInt32, pixels)
    width = dr.opaque(mi.UInt32, shot.width)
    own: Any = dr.compress(~cells.knows(every % width, every // width))
    if len(own) == 0:
        none = dr.zeros(mi.Float, 1)
        return Samples(rank, dr.zeros(mi.Bool, 1), none, none, none)
    dr.scatter(rank, dr.arange(mi.UInt32, len(own)), own)
    index = dr.arange(mi.UInt32, len(own) * shot.spp)
    of = index // dr.opaque(mi.UInt32, shot.spp)
    pixel = dr.opaque(mi.UInt32, first) + dr.gather(mi.UInt32, own, of)
    _, film = _sample(shot, pixel, index - of * dr.opaque(mi.UInt32, shot.spp))
    (_, receivers, shape), si = sight(light, sensor, shot, film.x, film.y)
    found = cells.beside(film.x, film.y, si.t, shape, receivers.active)
    values = list(found[:3])
    dr.eval(values, found.holds, film, *receivers)
    left: Any = dr.compress(receivers.active & ~found.holds)
    if len(left):
        at = dr.gather(mi.Point2f, film, left)
        m = ask(at.x, at.y, receivers.some(left))
        for value, asked in zip(values, m[:3], strict=True):
            dr.scatter(value, mi.Float(asked), left)
    return Samples(rank, receivers.active, *values)


def render_tile(light: Light, sensor: Any, shot: Shot, first: int, pixels: int, band: Band | None = None) -> Tile:
    """Trace the samples of `pixels` pixels from `first` on, in rows; without a band M is asked for at every sample."""
    band = band or Band(0, shot.height, (), ())
    ways = zip(band.asks, band.cells, strict=True)
    single = [_at_samples(light, ask, sensor, shot, first, pixels, m) for ask, m in ways]
    begin = partial(_traced, light, sensor, shot, first, band.cells, single)
    index = dr.arange(mi.UInt32, pixels * shot.spp)
    if not single or shot.max_depth != 2:
        return means(begin(index, asks=True), pixels, shot.spp)
    traced = begin(index, asks=False)  # M is known wherever the sources' light is asked for, but for few samples
    left: Any = dr.compress(~traced.finite)
    if len(left):
        asked = [_at(light, ask, sensor, shot, first, left) for ask in band.asks]
        traced.put(_traced(light, sensor, shot, first, band.cells, asked, left, asks=False), left)
        left = dr.compress(~traced.finite)
    if len(left):  # that see another surface now: beside an edge rounding decides
        traced.put(begin(left, asks=True), left)
    return means(traced, pixels, shot.spp)


def _at(light: Light, ask: Ask, sensor: Any, shot: Shot, first: int, index: Any) -> Samples:
    """M at samples of a tile, a few and in any place."""
    spp = dr.opaque(mi.UInt32, shot.spp)
    _, film = _sample(shot, dr.opaque(mi.UInt32, first) + index // spp, index % spp)
    (_, receivers, _), _ = sight(light, sensor, shot, film.x, film.y)
    dr.eval(film, *receivers[:3])
    m = ask(film.x, film.y, receivers)
    return Samples(None, receivers.active, *(mi.Float(value) for value in m[:3]))


def _traced(
    light: Light,
    sensor: Any,
    shot: Shot,
    first: int,
    cells: tuple[Cells, ...],
    single: list[Samples],
    index: Any,
    asks: bool,
) -> Traced:
    """Paths of samples of a tile; where M is not known it is NaN, if the model is not to be asked."""
    pixel = index // dr.opaque(mi.UInt32, shot.spp)
    stream, film = _sample(shot, dr.opaque(mi.UInt32, first) + pixel, index % dr.opaque(mi.UInt32, shot.spp))
    place = film / mi.Point2f(dr.opaque(mi.Float, shot.width), dr.opaque(mi.Float, shot.height))
    time = sensor.shutter_open()
    if sensor.shutter_open_time() > 0:
        time += stream.next_1d() * sensor.shutter_open_time()
    aperture = stream.next_2d()
    ray, weight = rays(sensor, time, stream.next_1d(), place, aperture)

    def reflected(ray: Any, si: Any, bsdf: Any, n: Any, active: Any, first: Any) -> Reflected:
        known = []
        for m, samples in zip(cells, single, strict=True):
            found = m.at(film.x, film.y, si.t, light.hits.surface(si, active & first), active & first)
            own = samples.at(pixel, index, shot.spp, active & first)
            holds = found.holds | own.holds
            values = (dr.select(own.holds, a, b) for a, b in zip(own[:3], found[:3], strict=True))
            known.append((Factor(*(dr.select(holds, v, dr.nan) for v in values)), holds if asks else None))
        return light.reflected(ray, si, bsdf, n, active, known)

    path = trace(
        light.scene.mitsuba,
        stream,
        ray,
        reflected,
        len(light.keys),
        shot.max_depth,
        shot.rr_depth,
        shot.hide_emitters,
        mi.Bool(True),
    )
    radiance = mi.unpolarized_spectrum(path.L * weight)
    finite = dr.all(dr.isfinite(radiance))
    for re, im in zip(path.real, path.imag, strict=True):
        finite &= dr.isfinite(re) & dr.isfinite(im)
    traced = Traced(list(radiance), finite, path.seen, path.real, path.imag, path.error)
    dr.eval(*traced)  # all in one kernel
    return traced
