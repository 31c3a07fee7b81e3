"""A picture as tiles: each a pure function of (scene, light, seed, pixels), summed in a fixed order.

Rays are made here and random numbers follow from (seed, pixel, sample) alone, so that a tile equals the same pixels
of the whole picture bit for bit, with any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba
import numpy as np
from numpy.typing import NDArray

from grimaldi.light import Light
from grimaldi.tracing import trace

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

RAYS = 1 << 16  # of a tile: about a second of work


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


def tiles(shot: Shot) -> Iterator[tuple[int, int]]:
    """First pixel and number of pixels of each tile."""
    pixels = shot.width * shot.height
    step = max(RAYS // shot.spp, 1)
    for first in range(0, pixels, step):
        yield first, min(step, pixels - first)


def render_tile(light: Light, sensor: Any, shot: Shot, first: int, pixels: int) -> Tile:
    """Trace the samples of `pixels` pixels from `first` on."""
    scene = light.scene.mitsuba
    index = dr.arange(mi.UInt32, pixels * shot.spp)
    pixel = dr.opaque(mi.UInt32, first) + index // dr.opaque(mi.UInt32, shot.spp)
    sample = index % dr.opaque(mi.UInt32, shot.spp)
    identity = mi.sample_tea_32(dr.opaque(mi.UInt32, shot.seed), pixel * dr.opaque(mi.UInt32, shot.spp) + sample)
    stream = Stream(mi.PCG32(initstate=mi.UInt64(identity[0]), initseq=mi.UInt64(identity[1])))

    column, row = pixel % dr.opaque(mi.UInt32, shot.width), pixel // dr.opaque(mi.UInt32, shot.width)
    place = (mi.Point2f(mi.Float(column), mi.Float(row)) + stream.next_2d()) / mi.Point2f(
        dr.opaque(mi.Float, shot.width), dr.opaque(mi.Float, shot.height)
    )
    time = sensor.shutter_open()
    if sensor.shutter_open_time() > 0:
        time += stream.next_1d() * sensor.shutter_open_time()
    aperture = stream.next_2d()
    ray, weight = sensor.sample_ray_differential(time, stream.next_1d(), place, aperture)
    path = trace(
        scene,
        stream,
        ray,
        light.reflected,
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
