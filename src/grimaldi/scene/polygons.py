"""Polygons as triangles, and OBJ files that have them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.scene.triangles import check_triangles

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]


def triangles(points: Reals, polygons: Sequence[Sequence[int]], place: str) -> Integers:
    """Faces (m, 3) that cover polygons over points (n, 3), concave ones too, turned as the polygons are.

    Raises InputError for a polygon of fewer than three corners, and for corners that do not exist.
    """
    faces: list[Sequence[int]] = []
    for number, polygon in enumerate(polygons):
        if len(polygon) < 3:
            raise InputError(f"{place}: face {number} has {len(polygon)} corners; give three or more")
        if not all(0 <= corner < len(points) for corner in polygon):
            named = ", ".join(str(corner) for corner in polygon)
            raise InputError(
                f"{place}: face {number} joins vertices {named}, but there are {len(points)}; export the mesh anew"
            )
        faces += [polygon] if len(polygon) == 3 else _ears(points[list(polygon)], polygon)
    return np.array(faces, np.int64).reshape(-1, 3)


def _ears(corners: Reals, polygon: Sequence[int]) -> list[tuple[int, int, int]]:
    """Ears cut off one after the other (Meisters 1975), seen along the polygon's mean normal."""
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)  # Newell's
    flat = np.delete(corners, np.abs(normal).argmax(), axis=1)
    x, y = flat[:, 0], flat[:, 1]
    turn = np.sign((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) or 1.0
    left = list(range(len(polygon)))
    result: list[tuple[int, int, int]] = []
    while len(left) > 3:
        ear = next((i for i in range(len(left)) if _is_ear(flat, left, i, turn)), 0)
        before, here, after = left[ear - 1], left[ear], left[(ear + 1) % len(left)]
        result.append((polygon[before], polygon[here], polygon[after]))
        del left[ear]
    return [*result, (polygon[left[0]], polygon[left[1]], polygon[left[2]])]


def _is_ear(flat: Reals, left: list[int], i: int, turn: float) -> bool:
    """Whether corner i is convex and no other corner lies in its triangle."""
    a, b, c = flat[left[i - 1]], flat[left[i]], flat[left[(i + 1) % len(left)]]
    if turn * _cross(b - a, c - b) <= 0:
        return False
    others = flat[[j for j in left if j not in (left[i - 1], left[i], left[(i + 1) % len(left)])]]
    sides = [turn * _cross(q - p, others - p) for p, q in ((a, b), (b, c), (c, a))]
    return not bool(np.all(np.array(sides) >= 0, axis=0).any())


def _cross(u: Reals, v: Reals) -> Reals:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def read_obj(path: Path) -> tuple[Reals, list[list[int]]]:
    """Vertices (n, 3) and polygons of an OBJ file, all its objects as one; texture coordinates and normals left out.

    Raises InputError naming the line that is no vertex or face.
    """
    points, polygons, _ = _obj(path)
    return points, polygons


def _obj(path: Path) -> tuple[Reals, list[list[int]], bool]:
    """The same, and whether a face counts vertices from the end."""
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    from_end = False
    for number, line in enumerate(_text(path).splitlines(), start=1):
        words = line.split("#")[0].split()
        try:
            match words:
                case ["v", *numbers]:
                    points.append([float(x) for x in numbers[:3]])
                    if len(points[-1]) < 3:
                        raise ValueError
                case ["f", *corners]:
                    polygons.append([_index(corner, len(points)) for corner in corners])
                    from_end |= any(corner.startswith("-") for corner in corners)
        except ValueError:
            raise InputError(
                f"{path}, line {number}: {line.strip()[:60]!r} is no OBJ line; export the mesh anew"
            ) from None
        if words[:1] == ["f"] and (len(polygons[-1]) < 3 or min(polygons[-1]) < 0):
            what = f"has {len(polygons[-1])} corners" if len(polygons[-1]) < 3 else "names a vertex that is not there"
            raise InputError(f"{path}, line {number}: the face {what}; export the mesh anew")
    array = np.array(points, np.float64).reshape(-1, 3)
    if not polygons:
        raise InputError(f"{path}: the mesh is empty; give it at least one triangle")
    return array, polygons, from_end


def check_obj(path: Path) -> bool:
    """Whether an OBJ file has polygons or counts vertices from the end; InputError where it is wrong."""
    points, polygons, from_end = _obj(path)
    check_triangles(points, triangles(points, polygons, str(path)), str(path))
    return from_end or any(len(polygon) != 3 for polygon in polygons)


def _index(corner: str, count: int) -> int:
    """A corner's vertex, counted from 0; -1 where there is none."""
    index = int(corner.split("/")[0])
    return index - 1 if index > 0 else (count + index if -count <= index < 0 else -1)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the name") from error
