"""A wave at given points, block by block: each block a pure function of its points."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grimaldi.parts import parts

if TYPE_CHECKING:
    from grimaldi.diffraction.model import Receivers
    from grimaldi.propagate import Wave
    from grimaldi.scene.model import Scene, Source

BLOCK = 1 << 16  # points: about a second of work for a thousand segments, a few hundred bytes each


class Part(NamedTuple):
    """Some of the points: an index of them, U complex128, |U_computed - U| and |U0| float64 there."""

    which: Any
    U: NDArray[np.complex128]
    error: NDArray[np.float64]
    free: NDArray[np.float64]


def at_points(
    wave: Callable[[Receivers], Wave], scene: Scene, source: Source, points: NDArray[np.float64], block: int = BLOCK
) -> Iterator[Part]:
    """One source's wave at points (n, 3), `block` of them after the other; nobody may write to them."""
    import drjit as dr

    from grimaldi.diffraction.arrays import complex_array, types
    from grimaldi.diffraction.model import Receivers
    from grimaldi.diffraction.occlusion import surface_normals

    double = types(double=True)
    normals = surface_normals(scene, source)
    for which in parts(len(points), block):
        p = double.Vector(*(double.taken(points[which, i]) for i in range(3)))
        n = normals(p)
        u = wave(Receivers(p, n, dr.mask_t(p.x)(True)))
        dr.eval(*u)
        yield Part(which, complex_array(u.real, u.imag), u.error.numpy(), u.free.numpy())
