"""The Dr.Jit array types of the current Mitsuba variant, in either precision."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from grimaldi.variants import check_variant


class Types(NamedTuple):
    """Array types of one precision."""

    Float: Any
    Vector: Any
    Packet: Any  # four floats of a record, read at once

    def buffer(self, values: NDArray[Any]) -> Any:
        """Numbers as one flat device buffer."""
        dtype = np.float64 if dr.itemsize_v(self.Float) == 8 else np.float32
        return self.Float(_aligned(values, dtype))


def _aligned(values: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """A flat copy at a multiple of 128: Dr.Jit reads NumPy's memory in place, and compiles in how it is aligned."""
    size = values.size * np.dtype(dtype).itemsize
    room = np.empty(size + 128, np.uint8)
    first = -room.ctypes.data % 128
    copy = room[first : first + size].view(dtype)
    copy.reshape(values.shape)[...] = values
    return copy


def complex_array(real: Any, imag: Any) -> NDArray[np.complex128]:
    """Two Dr.Jit arrays as one NumPy array."""
    dr.eval(real, imag)  # in one kernel
    dr.eval(real, imag)  # in one kernel
    z = np.empty(len(real), np.complex128)
    z.real, z.imag = real.numpy(), imag.numpy()
    return z


def on_device(kind: Any, number: float) -> Any:
    """A number as a Dr.Jit array that no kernel contains: other scenes and wavelengths run what is compiled already."""
    return dr.opaque(kind, number)


def types(double: bool) -> Types:
    """Float64 or Float32 arrays of the variant in use."""
    variant = mi.variant() or ""
    check_variant(variant)
    ad = dr.cuda.ad if variant.startswith("cuda") else dr.llvm.ad
    if double:
        return Types(ad.Float64, ad.Array3f64, ad.Array4f64)
    return Types(ad.Float, ad.Array3f, ad.Array4f)
