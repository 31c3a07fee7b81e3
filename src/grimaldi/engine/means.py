"""What the samples of a tile bring, and their means over each pixel, summed in a fixed order."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from grimaldi.syntax import syntax


class Traced(NamedTuple):
    """Of n samples, pixel by pixel: radiance of the channels, whether all of it is finite, and what `Path` tells."""

    radiance: list[Any]
    finite: Any
    seen: Any
    real: list[Any]
    imag: list[Any]
    error: list[Any]

    def put(self, some: Traced, index: Any) -> None:
        """Replace what samples brought."""
        dr.scatter(self.finite, some.finite, index)
        dr.scatter(self.seen, some.seen, index)
        for own, new in zip((self.radiance, *self[3:]), (some.radiance, *some[3:]), strict=True):
            for values, of_some in zip(own, new, strict=True):
                dr.scatter(values, of_some, index)


class Tile(NamedTuple):
    """Means over each of n pixels: radiance over all samples, the rest over those that saw a surface.

    `lost` counts samples that were not finite and left out.
    """

    picture: NDArray[np.float32]  # (channels, n)
    U: NDArray[np.complex64]  # (keys, n)
    error: NDArray[np.float32]  # (keys, n)
    intensity: NDArray[np.float32]  # (n,)
    lost: int


def means(traced: Traced, pixels: int, spp: int) -> Tile:
    """What the samples of each of some pixels say."""
    of_all, of_seen = traced.radiance, [*traced.real, *traced.imag, *traced.error]
    keys = len(traced.real)
    first, second, power, lost = _summed(traced.finite, traced.seen, of_all, of_seen, keys, pixels, spp)
    dr.eval(first, second, power, lost)
    picture, found = (np.stack([x.numpy() for x in values]) for values in (first, second))
    return Tile(
        picture,
        (found[:keys] + 1j * found[keys : 2 * keys]).astype(np.complex64),
        found[2 * keys :],
        power.numpy(),
        int(lost.numpy().sum()),
    )


@syntax
def _summed(
    finite: Any, seen: Any, of_all: list[Any], of_seen: list[Any], keys: int, pixels: int, spp: int
) -> tuple[list[Any], list[Any], Any, Any]:
    """Means of values over the finite samples of each pixel, of others over those that saw something, and of the sum
    of the squares of the first 2 · `keys` of these; how many are not finite. In one kernel."""
    count = dr.opaque(mi.UInt32, spp)
    i = dr.arange(mi.UInt32, pixels) * count
    end = i + count
    all_sums, seen_sums = [mi.Float64(0) for _ in of_all], [mi.Float64(0) for _ in of_seen]
    alls, seens, power = mi.UInt32(0), mi.UInt32(0), mi.Float64(0)
    while i < end:
        counts = dr.gather(mi.Bool, finite, i)
        sees = counts & dr.gather(mi.Bool, seen, i)
        alls += dr.select(counts, mi.UInt32(1), 0)
        seens += dr.select(sees, mi.UInt32(1), 0)
        all_sums = _plus(all_sums, _gathered(of_all, i, counts))
        values = _gathered(of_seen, i, sees)
        seen_sums = _plus(seen_sums, values)
        power += mi.Float64(_squares(values[: 2 * keys]))
        i += 1
    per_all, per_seen = dr.rcp(mi.Float64(dr.maximum(alls, 1))), dr.rcp(mi.Float64(dr.maximum(seens, 1)))
    return (
        _singles(all_sums, per_all),
        _singles(seen_sums, per_seen),
        mi.Float(power * per_seen),
        count - alls,
    )


def _gathered(values: list[Any], index: Any, active: Any) -> list[Any]:
    return [dr.gather(mi.Float, v, index, active) for v in values]


def _plus(sums: list[Any], values: list[Any]) -> list[Any]:
    return [s + mi.Float64(v) for s, v in zip(sums, values, strict=True)]


def _squares(values: list[Any]) -> Any:
    return sum((v * v for v in values), mi.Float(0))


def _singles(sums: list[Any], weight: Any) -> list[Any]:
    return [mi.Float(s * weight) for s in sums]
