"""What every triangle mesh must be, whichever file it comes from."""

from __future__ import annotations

from typing import Any

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


def as_mesh(
    V: Any,
    name: str,
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    props: Any,
    *,
    smooth: bool = False,
    normals: NDArray[np.floating] | None = None,
    uv: NDArray[np.floating] | None = None,
) -> Any:
    """A Mitsuba mesh of the variant module V, with the BSDF, emitter and flags in `props` (`mi.Properties`).

    vertices (n, 3) in world space, faces (m, 3), normals (n, 3), uv (n, 2); `smooth` makes normals from the faces.
    """
    import mitsuba as mi

    mesh = V.Mesh(
        name,
        len(vertices),
        len(faces),
        props=props,
        has_vertex_normals=smooth or normals is not None,
        has_vertex_texcoords=uv is not None,
    )
    values = mi.traverse(mesh)
    given = {"vertex_positions": vertices, "vertex_normals": normals, "vertex_texcoords": uv}
    for key, array in given.items():
        if array is not None:
            values[key] = V.Float(array.astype(np.float32).ravel())
    values["faces"] = V.UInt32(faces.astype(np.uint32).ravel())
    values.update()
    return mesh
