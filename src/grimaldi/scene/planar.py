"""Planar outlines: closed loops in a plane of their own, as a hole in a screen or as an opaque mask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grimaldi.errors import InputError

Reals = NDArray[np.float64]
Loops = ArrayLike | Sequence[ArrayLike] | str | Path


@dataclass(frozen=True, eq=False)
class PlanarOutline:
    """Closed loops in the plane z = 0 of their own frame, in Float64.

    Args:
        loops: one (n, 2) array of corners, several, or the path of a CSV file (two columns, a blank line
            or a NaN row between loops) or NPY file ((n, 2), or (m, n, 2) for m loops). The last corner is
            joined to the first. A loop inside another one is an island in it (even-odd); loops may not
            cross or touch themselves or each other. Kept as a tuple of arrays, outer loops
            counterclockwise seen from +z and islands clockwise.
        to_world: (4, 4) affine map of that frame to world space, or a Mitsuba transform.
        hole: a hole in an infinite opaque screen; if False, an opaque mask.

    Raises:
        InputError: naming the file and the loop that is not finite, has fewer than three corners or no
            area, or crosses or touches itself or another; a file that cannot be read; a singular
            `to_world`.
    """

    loops: tuple[Reals, ...]
    to_world: Reals = field(default_factory=lambda: np.eye(4))
    hole: bool = True
    is_ellipse: bool = field(default=False, init=False)

    def __init__(self, loops: Loops, to_world: Any = None, hole: bool = True) -> None:
        place = str(loops) if isinstance(loops, (str, Path)) else "outline"
        self._set(_oriented(_read(loops), place), to_world, hole, place)

    @classmethod
    def ellipse(cls, to_world: Any = None, hole: bool = True) -> PlanarOutline:
        """The circle x² + y² = 1 under `to_world`: it has no `loops`, and `is_ellipse` is True."""
        self = cls.__new__(cls)
        self._set((), to_world, hole, "ellipse")
        object.__setattr__(self, "is_ellipse", True)
        return self

    def _set(self, loops: tuple[Reals, ...], to_world: Any, hole: bool, place: str) -> None:
        matrix = np.eye(4) if to_world is None else getattr(to_world, "matrix", to_world)
        for name, value in (("loops", loops), ("to_world", _affine(matrix, place)), ("hole", bool(hole))):
            object.__setattr__(self, name, value)

    @property
    def origin(self) -> Reals:
        """The frame's origin in world space (3,): a point of the plane."""
        return self.to_world[:3, 3]

    @property
    def normal(self) -> Reals:
        """The plane's unit normal (3,) in world space: outer loops run counterclockwise seen from there."""
        normal = np.cross(self.to_world[:3, 0], self.to_world[:3, 1])
        return normal / np.linalg.norm(normal)

    def world_loops(self, segments: int = 256) -> tuple[Reals, ...]:
        """The loops in world space, each (n, 3); of an ellipse the inscribed polygon of n = `segments`."""
        loops = self.loops
        if self.is_ellipse:
            angle = 2 * np.pi * np.arange(segments) / segments
            loops = (np.stack([np.cos(angle), np.sin(angle)], axis=1),)
        return tuple(loop @ self.to_world[:3, :2].T + self.origin for loop in loops)


def _affine(matrix: Any, place: str) -> Reals:
    """A (4, 4) affine matrix whose x and y axes span a plane."""
    try:
        matrix = np.array(matrix, dtype=np.float64).squeeze()  # Dr.Jit matrices have a trailing axis
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or (matrix[3] != (0, 0, 0, 1)).any():
        raise InputError(f"{place}: to_world is no affine map; give a finite (4, 4) matrix ending in 0, 0, 0, 1")
    x, y = matrix[:3, 0], matrix[:3, 1]
    if np.linalg.norm(np.cross(x, y)) <= 1e-12 * np.linalg.norm(x) * np.linalg.norm(y):
        raise InputError(f"{place}: to_world is singular; its x and y axes must span a plane")
    matrix.setflags(write=False)
    return matrix


def _oriented(loops: list[Reals], place: str) -> tuple[Reals, ...]:
    """The checked loops, turned by their nesting depth: even counterclockwise, odd clockwise."""
    import shapely

    if not loops:
        raise InputError(f"{place}: has no loops; give at least one with three corners")
    loops = [_checked(loop, f"{place}: loop {i + 1}") for i, loop in enumerate(loops)]
    rings = [shapely.LinearRing(loop) for loop in loops]
    first, second = shapely.STRtree(rings).query(rings, predicate="intersects")
    if (meeting := first < second).any():
        i, j = first[meeting][0] + 1, second[meeting][0] + 1
        raise InputError(f"{place}: loops {i} and {j} cross or touch; unite them into one")
    polygons = [shapely.Polygon(ring) for ring in rings]
    inner, _ = shapely.STRtree(polygons).query(rings, predicate="within")
    depth = np.bincount(inner, minlength=len(rings))  # a ring is on its own polygon's border, not within it
    result = []
    for loop, ring, level in zip(loops, rings, depth, strict=True):
        oriented = loop if shapely.is_ccw(ring) == (level % 2 == 0) else np.ascontiguousarray(loop[::-1])
        oriented.setflags(write=False)
        result.append(oriented)
    return tuple(result)


def _checked(loop: Reals, place: str) -> Reals:
    """The loop without repeated corners, if it is a simple polygon."""
    import shapely

    if not np.isfinite(loop).all():
        corner = int(np.flatnonzero(~np.isfinite(loop).all(axis=1))[0])
        raise InputError(f"{place}: corner {corner + 1} is not finite; give numbers")
    loop = loop[(loop != np.roll(loop, 1, axis=0)).any(axis=1)]
    if len(loop) < 3:
        raise InputError(f"{place}: has {len(loop)} different corners; give at least three")
    if np.linalg.matrix_rank(loop - loop[0], rtol=1e-12) < 2:
        raise InputError(f"{place}: has no area; its corners must not lie on one line")
    polygon = shapely.Polygon(loop)
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon)
        at = reason[reason.find("[") + 1 : -1].replace(" ", ", ")
        raise InputError(f"{place}: crosses or touches itself at ({at}); split it into simple loops")
    return loop


def _read(loops: Loops) -> list[Reals]:
    """The loops as (n, 2) arrays, not yet checked."""
    if not isinstance(loops, (str, Path)):
        return _split(loops, "outline")
    path = Path(loops)
    if path.suffix.lower() not in (".csv", ".npy"):
        raise InputError(f"{path}: outlines are read from .csv and .npy files; convert it to one of these")
    try:
        if path.suffix.lower() == ".npy":
            return _split(np.load(path, allow_pickle=False), str(path))
        return _read_csv(path.read_text(encoding="utf-8-sig"), path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    except (ValueError, EOFError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is no {path.suffix} file of numbers; write it anew") from error


def _read_csv(text: str, path: Path) -> list[Reals]:
    """Two columns, separated by a comma, semicolon or space; # begins a comment."""
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if line.startswith("#"):
            continue
        try:
            x, y = map(float, line.replace(";", ",").replace(",", " ").split()) if line else (np.nan, np.nan)
        except ValueError:
            raise InputError(f"{path}, line {number}: {line!r} is not two numbers; write 'x, y'") from None
        rows.append((x, y))
    return _split_at_nan(np.array(rows, dtype=np.float64).reshape(-1, 2))


def _split(loops: Any, place: str) -> list[Reals]:
    """One (n, 2) array, with NaN rows between loops or not, or several."""
    try:
        arrays: list[Reals] = [np.asarray(loops, dtype=np.float64)]
    except (TypeError, ValueError):  # loops of different lengths
        try:
            arrays = [np.asarray(loop, dtype=np.float64) for loop in loops]
        except (TypeError, ValueError):
            arrays = [np.empty(0)]
    if len(arrays) == 1 and arrays[0].ndim == 3:
        arrays = list(arrays[0])
    if any(array.ndim != 2 or array.shape[1] != 2 for array in arrays):
        shapes = ", ".join(str(array.shape) for array in arrays[:3])
        raise InputError(f"{place}: loops of shape {shapes}; give (n, 2) arrays of corners")
    return [loop for array in arrays for loop in _split_at_nan(array)]


def _split_at_nan(rows: Reals) -> list[Reals]:
    """The runs between rows that are NaN in both columns."""
    gaps = np.flatnonzero(np.isnan(rows).all(axis=1))
    runs = np.split(rows, np.sort(np.r_[gaps, gaps + 1]))
    return [run for run in runs if not np.isnan(run).all()]
