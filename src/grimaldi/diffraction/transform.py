"""The sums over nodes of a plane's factored kernel: non-uniform FFTs (finufft)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.diffraction.planes import Plane
from grimaldi.outlines.model import Reals


def sums(plane: Plane, points: Reals, x: Reals, c: NDArray[np.complex128], eps: float) -> NDArray[np.complex128]:
    """Σ c e^{-ik y·Bx} at the points, y being points - p0, to about eps of their size; x (m, 3) from x0."""
    import finufft

    axes, grid = plane.screen.axes, plane.lattice
    to_phase = -plane.screen.k * axes.T @ plane.B  # (3, 2)
    result: Any
    if grid is None:
        (x1, x2), (y1, y2) = (
            np.einsum("ji,mj->im", a, v, order="C") for a, v in ((to_phase, x), (axes.T, points - plane.p0))
        )
        result = finufft.nufft2d3(x1, x2, c, y1, y2, eps=eps, isign=1)
    else:
        x1, x2 = np.einsum("ji,mj->im", to_phase @ axes @ np.stack([grid.v, grid.u], axis=1), x, order="C")
        shape = grid.rows, grid.columns
        result = finufft.nufft2d1(x1, x2, c, shape, eps=eps, isign=1, upsampfac=upsampling(eps))
    return result.ravel()


def upsampling(eps: float) -> float:
    """How much finer than the points finufft's grid is: 1.25 is cheaper, where its widest kernel suffices."""
    return 1.25 if eps > 2e-9 else 2.0
