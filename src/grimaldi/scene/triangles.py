"""What every triangle mesh must be, whichever file it comes from."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError

LARGEST = 1e18  # beyond it squared distances overflow in Float32


_ODD = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x27D4EB2F165667C5)  # they spread keys evenly


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


def merged_points(points: NDArray[np.float64], owner: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of points (3, n) one of each that are equal in all bits and have the same owner (n,), and which (n,) that is.

    Of -0.0 and 0.0 one only must occur. They are found by a hash; should two different points have the same one, by
    sorting their coordinates instead.
    """
    keys = [*points.view(np.uint64), owner.astype(np.uint64)]
    hashed = np.zeros(len(owner), np.uint64)
    for key, odd in zip(keys, _ODD, strict=True):
        hashed = (hashed ^ key) * np.uint64(odd)
        hashed ^= hashed >> np.uint64(29)
    order = np.argsort(hashed)
    new = hashed[order][1:] != hashed[order][:-1]
    differ = np.zeros(max(len(owner) - 1, 0), bool)
    for key in keys:
        differ |= key[order][1:] != key[order][:-1]
    if (differ != new).any():
        order = np.lexsort(keys)
        new = np.zeros(len(new), bool)
        for key in keys:
            new |= key[order][1:] != key[order][:-1]
    leads = np.append(True, new)[: len(owner)]
    number = np.empty(len(owner), np.int64)
    number[order] = np.cumsum(leads) - 1
    return order[leads], number


def areas(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of triangles between corners (m, 3) twice the area vectors (m, 3), and those as unit vectors, 0 where no area."""
    (ux, uy, uz), (vx, vy, vz) = (b - a).T, (c - a).T
    area = np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)
    return area, area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)


def solid_angle(corners: NDArray[np.float64], faces: NDArray[np.integer], point: NDArray[np.float64]) -> float:
    """Of triangles, seen from a point and signed as they are turned [sr] (van Oosterom & Strackee 1983, eq. 8)."""
    a, b, c = np.moveaxis((corners - point)[faces], 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
    return 2 * float(np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum())
