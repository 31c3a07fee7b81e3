"""The Dr.Jit array types of the current Mitsuba variant, in either precision."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from grimaldi.parts import parts
from grimaldi.variants import check_variant, on_cuda

ALIGNED = 128  # bytes

_DTYPES = {
    dr.VarType.Float64: np.float64,
    dr.VarType.Float32: np.float32,
    dr.VarType.UInt32: np.uint32,
    dr.VarType.Bool: np.bool_,
}


class Types(NamedTuple):
    """Array types of one precision."""

    Float: Any
    Vector: Any
    Packet: Any  # four floats of a record, read at once
    phases: Types | None = None  # of what phases are told by, if not these

    @property
    def precise(self) -> Types:
        """What phases and the places of edges are told by."""
        return self.phases or self

    def buffer(self, values: NDArray[Any]) -> Any:
        """Numbers as one flat device buffer."""
        return buffer(self.Float, values)

    def taken(self, values: NDArray[Any]) -> Any:
        """The same of an array that nobody writes to any more: where it may be read in place, no copy."""
        flat = values.ravel()
        in_place = dr.itemsize_v(self.Float) == values.itemsize and flat.ctypes.data % ALIGNED == 0
        return self.Float(flat) if in_place else self.buffer(flat)


def buffer(kind: Any, values: NDArray[Any]) -> Any:
    """Numbers or flags as one flat device array of a kind."""
    copy = aligned_empty(values.size, _DTYPES[dr.type_v(kind)])
    copy.reshape(values.shape)[...] = values
    return kind(copy)


def aligned_empty(count: int, dtype: Any) -> NDArray[Any]:
    """Memory as `buffer` needs it: Dr.Jit reads NumPy's in place, and compiles its alignment into kernels."""
    size = count * np.dtype(dtype).itemsize
    room = np.empty(size + ALIGNED, np.uint8)
    first = -room.ctypes.data % ALIGNED
    return room[first : first + size].view(dtype)


def complex_array(real: Any, imag: Any) -> NDArray[np.complex128]:
    """Two Dr.Jit arrays as one NumPy array."""
    dr.eval(real, imag)  # in one kernel
    z = np.empty(len(real), np.complex128)
    re, im = (np.broadcast_to(part.numpy(), z.shape) for part in (real, imag))
    for some in parts(len(z)):
        z.real[some], z.imag[some] = re[some], im[some]
    return z


def on_device(kind: Any, number: float) -> Any:
    """A number as a Dr.Jit array that no kernel contains: other scenes and wavelengths run what is compiled already."""
    return dr.opaque(kind, number)


def types(double: bool) -> Types:
    """Float64 or Float32 arrays of the variant in use."""
    check_variant(mi.variant() or "")
    ad = dr.cuda.ad if on_cuda() else dr.llvm.ad
    if double:
        return Types(ad.Float64, ad.Array3f64, ad.Array4f64)
    return Types(ad.Float, ad.Array3f, ad.Array4f)


def mixed() -> Types:
    """Float32 arrays, but Float64 ones for phases."""
    return types(double=False)._replace(phases=types(double=True))
