"""What a GPU could do at most, from its driver: its multiprocessors, their lanes and its clock."""

from __future__ import annotations

import ctypes
from typing import Any

# CUdevice_attribute
CLOCK, MULTIPROCESSORS, MAJOR, MINOR = 13, 16, 75, 76
FEW_LANES = ((7, 0), (7, 2), (7, 5), (8, 0))  # compute capabilities of 64 Float32 lanes a multiprocessor, not 128


def driver() -> Any:
    """CUDA's library, loaded; raises OSError where there is none."""
    library = ctypes.CDLL("libcuda.so.1")
    if library.cuInit(0):
        raise OSError("CUDA's driver does not answer")
    return library


def peak(cuda: Any) -> float:
    """Float32 operations a second of the first GPU at its highest clock: a multiplication and an addition a lane."""

    def attribute(which: int) -> int:
        value = ctypes.c_int()
        if cuda.cuDeviceGetAttribute(ctypes.byref(value), which, 0):
            raise OSError(f"CUDA's driver does not tell attribute {which}")
        return value.value

    lanes = 64 if (attribute(MAJOR), attribute(MINOR)) in FEW_LANES else 128
    return 2.0 * lanes * attribute(MULTIPROCESSORS) * 1e3 * attribute(CLOCK)
