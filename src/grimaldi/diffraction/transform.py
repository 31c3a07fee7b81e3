"""The sums over nodes of a plane's factored kernel: non-uniform FFTs (finufft).

On a lattice finer than the fringes ask for, the sums are taken on a coarser one and interpolated: the FFT's size
follows the fringes, not the points.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.arrays import aligned_empty
from grimaldi.diffraction.lattice import Lattice
from grimaldi.diffraction.planes import Plane
from grimaldi.outlines.model import Reals
from grimaldi.parts import parts

Complexes = NDArray[np.complex128]

FINEST = 1e-14  # of finufft's eps
WORTH = 4  # so many times fewer cells are worth an interpolation
MOST_CELLS = 1 << 26  # of the FFT
ROWS = 16  # interpolated at a time: their matrix is a narrow band, and BLAS is quick with so few
SERIAL = 1 << 17  # products of numbers so small that BLAS starts no threads for them

# Rough seconds on two cores; only which is larger matters, and mostly by far.
SPREAD, CELL, CALL = 1e-9, 5e-9, 5e-3  # a node or target and a cell that it covers; a cell of the FFT; the rest


class Coarse(NamedTuple):
    """Interpolation along one axis of n points: a Kaiser-Bessel kernel over `width` points, `spacing` apart.

    Both lattices count from their middles. Divided by `spectrum`, the terms c e^{iξy} of |ξ| <= π/(2 spacing) come
    out to `error` of their size: by Poisson's sum, the kernel's spectrum at the nearest alias over that at ξ.
    """

    n: int
    spacing: float  # in points
    width: int

    @staticmethod
    def of(n: int, band: float, width: int) -> Coarse:
        """For |ξ| <= band [rad a point]."""
        return Coarse(n, min(0.5 * math.pi / max(band, 1e-300), float(n)), width)

    @property
    def beta(self) -> float:
        return 0.75 * math.pi * self.width  # the nearest alias, at 2π - π/2, is where the spectrum ends

    @property
    def beyond(self) -> int:
        """Coarse points on either side of the middle one."""
        return math.ceil(self.n // 2 / self.spacing + 0.5 * self.width) + 1

    @property
    def size(self) -> int:
        return 2 * self.beyond + 1

    def spectrum(self, xi: Any) -> Any:
        """∫ kernel(t) e^{-iξt} dt over coarse points t, ξ in radians a point."""
        z = np.sqrt(self.beta**2 - (0.5 * self.width * self.spacing * xi) ** 2)
        return self.width * np.sinh(z) / z

    @property
    def error(self) -> float:
        return 8 * self.width / float(self.spectrum(0.5 * math.pi / self.spacing))

    def __call__(self, values: Complexes) -> Complexes:
        """Values (count, m) at the coarse points as values (n, m) at the points."""
        columns = np.ascontiguousarray(values).view(np.float64)
        result = aligned_empty(self.n * values.shape[1], np.complex128).reshape(self.n, -1)
        out = result.view(np.float64)
        for rows, near, kernel in _bands(self):
            step = max(SERIAL // kernel.size, 1)
            for some in parts(out.shape[1], step):
                np.matmul(kernel, columns[near, some], out=out[rows, some])
        return result


@lru_cache(maxsize=8)  # both axes of a lattice are mostly alike, and so is the next field
def _bands(coarse: Coarse) -> tuple[tuple[slice, slice, Reals], ...]:
    """Some points of an axis at a time, the coarse points about them, and the kernel between both."""
    from scipy.special import i0

    at = (np.arange(coarse.n) - coarse.n // 2) / coarse.spacing
    bands = []
    for rows in parts(coarse.n, ROWS):
        to = at[rows]
        low, high = math.ceil(to[0] - 0.5 * coarse.width), math.floor(to[-1] + 0.5 * coarse.width) + 1
        inside = 1 - ((to[:, None] - np.arange(low, high)) * (2 / coarse.width)) ** 2
        kernel = np.where(inside < 0, 0, i0(coarse.beta * np.sqrt(np.maximum(inside, 0))))
        bands.append((rows, slice(low + coarse.beyond, high + coarse.beyond), kernel))
    return tuple(bands)


def sums(plane: Plane, points: Reals, x: Reals, c: Complexes, eps: float) -> Complexes:
    """Σ c e^{-ik y·Bx} at the points, y being points - p0, to about eps of their size; x (m, 3) from x0."""
    import finufft

    axes, grid = plane.screen.axes, plane.lattice
    to_phase = -plane.screen.k * axes.T @ plane.B  # (3, 2)
    if grid is None:
        (x1, x2), (y1, y2) = (
            np.einsum("ji,mj->im", a, v, order="C") for a, v in ((to_phase, x), (axes.T, points - plane.p0))
        )
        result: Any = finufft.nufft2d3(x1, x2, c, y1, y2, eps=eps, isign=1)
        return result
    a_row, a_point = np.einsum("ji,mj->im", per_step(plane, grid), x, order="C")
    return on_lattice(grid.rows, grid.columns, a_row, a_point, c, eps).ravel()


def per_step(plane: Plane, grid: Lattice) -> Reals:
    """(3, 2): times x, the phase from one row to the next, and from one point to the next."""
    axes = plane.screen.axes
    return -plane.screen.k * axes.T @ plane.B @ axes @ np.stack([grid.v, grid.u], axis=1)


def on_lattice(rows: int, columns: int, a_row: Reals, a_point: Reals, c: Complexes, eps: float) -> Complexes:
    """Σ c e^{i (row a_row + column a_point)} on rows × columns counted from their middles, to about eps."""
    import finufft

    coarse = coarser(rows, columns, float(np.abs(a_row).max()), float(np.abs(a_point).max()), eps)
    result: Any
    if coarse is None:
        result = finufft.nufft2d1(a_row, a_point, c, (rows, columns), eps=eps, isign=1, upsampfac=upsampling(eps))
        return result
    down, along = coarse
    c = c / (down.spectrum(a_row) * along.spectrum(a_point))
    result = finufft.nufft2d1(
        along.spacing * a_point,
        down.spacing * a_row,
        c,
        (along.size, down.size),
        eps=_finer(eps, coarse),
        isign=1,
        upsampfac=2.0,
        nthreads=1,  # too short for more
    )
    return down(along(result).T)


def coarser(rows: int, columns: int, row_band: float, point_band: float, eps: float) -> tuple[Coarse, Coarse] | None:
    """Interpolations down the rows and along them, of phases up to the bands a step; None where they do not pay."""
    for width in range(4, 24):
        coarse = Coarse.of(rows, row_band, width), Coarse.of(columns, point_band, width)
        if coarse[0].error <= eps:
            pays = WORTH * coarse[0].size * coarse[1].size <= rows * columns
            return coarse if pays and _finer(eps, coarse) >= FINEST else None
    return None


def _finer(eps: float, coarse: tuple[Coarse, Coarse]) -> float:
    """finufft's eps on the coarse lattices: terms at the ends of the band are enlarged there."""
    return eps * float(np.prod([one.spectrum(0.5 * np.pi / one.spacing) / one.spectrum(0.0) for one in coarse]))


def upsampling(eps: float) -> float:
    """How much finer than the points finufft's grid is: 1.25 is cheaper, where its widest kernel suffices."""
    return 1.25 if eps > 2e-9 else 2.0


def seconds(plane: Plane, eps: float, size: int, n: int) -> float:
    """What the sums over `size` nodes at n points are expected to take."""
    width = max(-math.log10(eps), 1) + 2
    if plane.lattice is None:
        phase = plane.screen.k * plane.curvature * plane.screen.a * plane.b
        cells = (8 / np.pi * phase + 4 * width) ** 2
        return CALL + CELL * cells + SPREAD * (size + n) * width**2 if cells < MOST_CELLS else math.inf
    grid, most = plane.lattice, plane.screen.k * plane.screen.a / plane.h2  # radians a length
    a_row, a_point = (most * float(np.linalg.norm(step)) for step in (grid.v, grid.u))
    coarse = coarser(grid.rows, grid.columns, a_row, a_point, eps)
    if coarse is None:
        return CALL + CELL * upsampling(eps) ** 2 * n + SPREAD * size * width**2
    return CALL + CELL * (4 * coarse[0].size * coarse[1].size + n) + SPREAD * size * width**2
