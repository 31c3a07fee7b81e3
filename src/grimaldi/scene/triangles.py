"""What every triangle mesh must be, whichever file it comes from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError

LARGEST = 1e18  # beyond it squared distances overflow in Float32


def check_triangles(positions: NDArray[np.floating], faces: NDArray[np.integer], place: str) -> None:
    """Raises InputError naming the first vertex (n, 3) or face (m, 3) that Mitsuba cannot take.

    Vertices must be finite and below `LARGEST`, faces name vertices that exist, and there must be some.
    """
    if not len(positions) or not len(faces):
        raise InputError(f"{place}: the mesh is empty; give it at least one triangle")
    check_positions(positions, place)
    bad = ((faces < 0) | (faces >= len(positions))).any(axis=1)
    if bad.any():
        i = int(np.flatnonzero(bad)[0])
        named = ", ".join(f"{int(vertex)}" for vertex in faces[i])
        raise InputError(
            f"{place}: face {i} joins vertices {named}, but there are {len(positions)}; export the mesh anew"
        )


def check_positions(positions: NDArray[np.floating], place: str) -> None:
    """Raises InputError naming the first of the (n, 3) positions that is not finite, or beyond `LARGEST`."""
    bad = ~(np.abs(positions) < LARGEST).all(axis=1)  # negated, so that NaN counts as bad
    if bad.any():
        i = int(np.flatnonzero(bad)[0])
        coordinates = ", ".join(f"{x:g}" for x in positions[i])
        raise InputError(f"{place}: vertex {i} is at ({coordinates}); give finite coordinates below {LARGEST:g}")
