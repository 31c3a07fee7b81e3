"""What a case of validation is: one reference held against `grimaldi.field`; plain frozen data."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

STARSHADE_FILES = ("wfirst.dat", "test_data__wfirst.h5")

Regime = Literal["exact", "Fresnel", "far field", "other model"]


@dataclass(frozen=True, eq=False)
class Curve:
    """Values along a line, for the plot: computed and by the reference, (n,) each, complex M or real."""

    x: NDArray[np.float64]
    computed: NDArray[np.complex128] | NDArray[np.float64]
    expected: NDArray[np.complex128] | NDArray[np.float64]
    label: str  # of x, with its unit
    quantity: str  # what is compared: "M", "U/U₀", "I/I₀"
    is_logarithmic: bool = False


@dataclass(frozen=True, eq=False)
class Case:
    """How far `grimaldi.field` is from a reference.

    regime: of the reference: "exact" (Kirchhoff's integral itself, or plain superposition), "Fresnel" or "far field"
    (which leave a remainder), or "other model" (other boundary conditions: the difference is a statement about the
    model, no promise). error: max |ΔM|, or as the statement says; tolerance: what `field` was asked for; remainder:
    how far at most the reference is from the exact integral, or what rounding path lengths costs; seconds: of `field`
    alone.
    """

    name: str
    regime: Regime
    reference: str
    error: float
    tolerance: float
    remainder: float
    seconds: float
    statement: str
    curve: Curve

    @property
    def digits(self) -> float:
        """-log10 of the error; infinite where there is none, -infinite where it is no number."""
        if math.isnan(self.error):
            return -math.inf
        return -math.log10(self.error) if self.error > 0 else math.inf

    @property
    def is_promise(self) -> bool:
        return self.regime != "other model"

    @property
    def allowed(self) -> float:
        """The largest error of a promise that is kept."""
        return self.tolerance + self.remainder

    @property
    def verdict(self) -> Literal["kept", "MISSED", "stated"]:
        if not self.is_promise:
            return "stated"
        return "kept" if self.error <= self.allowed else "MISSED"  # NaN misses


@dataclass(frozen=True)
class Settings:
    """Where the benchmark data lies, if anywhere."""

    data: Path | None = None

    @property
    def starshade(self) -> Path | None:
        """The folder of the WFIRST starshade, where it is at hand."""
        path = None if self.data is None else self.data / "data" / "starshade"
        return path if path is not None and all((path / name).is_file() for name in STARSHADE_FILES) else None


Check = Callable[[], Case]
