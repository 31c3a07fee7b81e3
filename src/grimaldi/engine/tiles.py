"""A picture as tiles: each a pure function of (scene, light, seed, pixels), summed in a fixed order.

Rays are made here and random numbers follow from (seed, pixel, sample) alone, so that a tile equals the same pixels
of the whole picture bit for bit, with any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import mitsuba
import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.model import OUTSIDE, Factor, Receivers
from grimaldi.engine.blocks import Sight, Squares, squares
from grimaldi.engine.cells import LARGEST, Cells, Nodes, cells
from grimaldi.light import Beam, Light, Reflected
from grimaldi.tracing import trace

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

ASKED = 1 << 16  # rays of a tile at whose ends the model is asked for M: about a second of work
RAYS = 1 << 21  # of a tile in all: some hundred bytes each
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
class Tile:
    """Means over each of n pixels, one after the other from pixel `first` in rows.

    U and its error over the samples that saw a surface, radiance over all; `lost` counts samples that were not
    finite and left out.
    """

    first: int
    picture: NDArray[np.float32]  # (channels, n)
    U: NDArray[np.complex64]  # (keys, n)
    error: NDArray[np.float32]  # (keys, n)
    intensity: NDArray[np.float32]  # (n,)
    lost: int


@dataclass(frozen=True, eq=False)
class Band:
    """Some rows of the film, and M of each beam over them, where it is interpolated."""

    top: int
    rows: int
    cells: tuple[Cells, ...]
    light: Light  # that knows what acts on the blocks of the film
    squares: Squares | None


def bands(light: Light, sensor: Any, shot: Shot) -> Iterator[Band]:
    """The film from its top on, as many rows at once as memory allows."""
    if light.interpolated == 0 or sensor.needs_aperture_sample():
        yield Band(0, shot.height, (), light, None)
        return
    finest = (
        1 if shot.spp >= 8 else 2 if shot.spp >= 2 else 4
    )  # a cell of the finest asks no more than its pixels would
    row = len(light.beams) * LARGEST * shot.width * (2 / finest) ** 2
    step = LARGEST * max(int(NODES / row), 1)
    for top in range(0, shot.height, step):
        rows = min(step, shot.height - top)
        film = squares(lambda x, y: _sight(light, sensor, shot, x, y)[0], shot.width, top, rows)
        known = light.among(film.blocks)
        nodes = (partial(_nodes, known, beam, sensor, shot, film) for beam in known.beams)
        found = tuple(cells(ask, shot.width, top, rows, finest, light.interpolated) for ask in nodes)
        yield Band(top, rows, found, known, film)


def tiles(light: Light, shot: Shot, band: Band) -> Iterator[tuple[int, int]]:
    """First pixel and number of pixels of each tile of a band."""
    pixels = shot.width * band.rows
    asked = sum(min(m.unknown / pixels, 1) for m in band.cells) if band.cells else float(light.asks)
    step = int(max(min(RAYS, ASKED / max(asked, 1e-9)) // shot.spp, 1))
    first = band.top * shot.width
    for begin in range(0, pixels, step):
        yield first + begin, min(step, pixels - begin)


def _sight(light: Light, sensor: Any, shot: Shot, x: Any, y: Any) -> tuple[Sight, Any]:
    """What the camera sees at places of the film [pixels], and Mitsuba's interactions."""
    place = mi.Point2f(x, y) / mi.Point2f(dr.opaque(mi.Float, shot.width), dr.opaque(mi.Float, shot.height))
    ray, _ = sensor.sample_ray_differential(sensor.shutter_open(), 0.5, place, mi.Point2f(0.5))
    si = light.scene.mitsuba.ray_intersect(ray)
    lit = si.is_valid() & mi.has_flag(si.bsdf(ray).flags(), mi.BSDFFlags.Smooth)
    n = mi.Vector3f(dr.mulsign(si.n, -dr.dot(si.n, ray.d)))
    shape = dr.select(lit, dr.reinterpret_array(mi.UInt32, si.shape), 0)
    return Sight(ray, Receivers(light.hits.point(ray, si, lit), n, lit), shape), si


def _nodes(light: Light, beam: Beam, sensor: Any, shot: Shot, film: Squares, x: Any, y: Any) -> Nodes:
    """M of a beam at what the camera sees at places of the film [pixels]."""
    (ray, receivers, shape), si = _sight(light, sensor, shot, x, y)
    m = beam.factor(film.placed(x, y, receivers))
    n = receivers.n
    pixel = mi.Float(0)
    for o, d in ((ray.o_x, ray.d_x), (ray.o_y, ray.d_y)):
        pixel = dr.maximum(pixel, dr.norm(o + d * (dr.dot(n, si.p - o) / dr.dot(n, d)) - si.p))
    return Nodes(mi.Float(m.real), mi.Float(m.imag), mi.Float(m.error), si.t, shape, mi.Float(m.clearance) / pixel)


def _placed(film: Squares, place: Any, first: Any, receivers: Receivers) -> Receivers:
    """Receivers at places of the film with their blocks: of those that the camera itself sees."""
    placed = film.placed(place.x, place.y, receivers)
    return placed._replace(block=dr.select(first, placed.block, OUTSIDE))


def render_tile(light: Light, sensor: Any, shot: Shot, first: int, pixels: int, band: Band | None = None) -> Tile:
    """Trace the samples of `pixels` pixels from `first` on; without a band M is asked for at every sample."""
    scene = light.scene.mitsuba
    index = dr.arange(mi.UInt32, pixels * shot.spp)
    pixel = dr.opaque(mi.UInt32, first) + index // dr.opaque(mi.UInt32, shot.spp)
    sample = index % dr.opaque(mi.UInt32, shot.spp)
    identity = mi.sample_tea_32(dr.opaque(mi.UInt32, shot.seed), pixel * dr.opaque(mi.UInt32, shot.spp) + sample)
    stream = Stream(mi.PCG32(initstate=mi.UInt64(identity[0]), initseq=mi.UInt64(identity[1])))

    column, row = pixel % dr.opaque(mi.UInt32, shot.width), pixel // dr.opaque(mi.UInt32, shot.width)
    film = mi.Point2f(mi.Float(column), mi.Float(row)) + stream.next_2d()
    place = film / mi.Point2f(dr.opaque(mi.Float, shot.width), dr.opaque(mi.Float, shot.height))
    time = sensor.shutter_open()
    if sensor.shutter_open_time() > 0:
        time += stream.next_1d() * sensor.shutter_open_time()
    aperture = stream.next_2d()
    ray, weight = sensor.sample_ray_differential(time, stream.next_1d(), place, aperture)

    def reflected(ray: Any, si: Any, bsdf: Any, n: Any, active: Any, first: Any) -> Reflected:
        known = []
        for m in () if band is None else band.cells:
            shape: Any = dr.reinterpret_array(mi.UInt32, si.shape)
            found = m.at(film.x, film.y, si.t, shape, active & first)
            known.append((Factor(found.real, found.imag, found.error), found.holds))
        if band is None or band.squares is None:
            return light.reflected(ray, si, bsdf, n, active, known)
        placed = partial(_placed, band.squares, film, first)
        return band.light.reflected(ray, si, bsdf, n, active, known, placed)

    path = trace(
        scene,
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
    seen = finite & path.seen
    dr.eval(radiance, finite, seen, path.real, path.imag, path.error)  # all in one kernel

    def mean(values: Any, over: Any) -> Any:
        count = dr.block_sum(dr.select(over, mi.Float(1), 0), shot.spp)
        return dr.block_sum(dr.select(over, mi.Float(values), 0), shot.spp) / dr.maximum(count, 1)

    picture = [mean(channel, finite) for channel in radiance]
    real = [mean(x, seen) for x in path.real]
    imag = [mean(x, seen) for x in path.imag]
    error = [mean(x, seen) for x in path.error]
    power = mi.Float64(0)
    for re, im in zip(path.real, path.imag, strict=True):
        power += re * re + im * im
    intensity = mean(power, seen)
    lost: Any = dr.count(~finite)
    dr.eval(picture, real, imag, error, intensity, lost)
    return Tile(
        first,
        np.stack([x.numpy() for x in picture]),
        np.stack([re.numpy() + 1j * im.numpy() for re, im in zip(real, imag, strict=True)]),
        np.stack([x.numpy() for x in error]),
        intensity.numpy(),
        int(lost[0]),
    )
