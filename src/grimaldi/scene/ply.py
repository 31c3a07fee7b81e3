"""Reads PLY files: to refuse those that crash Mitsuba or that it reads wrongly, and for their polygons."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.scene.polygons import triangles
from grimaldi.scene.triangles import check_triangles

_ANEW = "export the mesh anew"
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass
class _Element:
    """One element of the header: `count` rows of properties (name, type, type of a list's length or None)."""

    name: str
    count: int
    properties: list[tuple[str, str, str | None]] = field(default_factory=list)


def check_ply(path: Path) -> bool:
    """Whether a PLY file has polygons of other than three corners, which Mitsuba does not read.

    Raises InputError unless it is a whole PLY file whose faces' corners exist and are finite.
    """
    try:
        rows = _rows(path)
    except _Polygons:
        points, polygons = read_ply(path)
        check_triangles(points, triangles(points, polygons, str(path)), str(path))
        return True
    positions = np.stack([rows["vertex"][axis] for axis in "xyz"], axis=1)
    check_triangles(positions, rows["face"]["vertices"], str(path))
    return False


class _Polygons(Exception):
    """A face has other than three corners."""


def _rows(path: Path) -> dict[str, NDArray[np.void]]:
    """The elements' rows of a PLY file of triangles; `_Polygons` where it is none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    order, elements, at = _header(data, path)
    tokens = [] if order else data[at:].split()
    if not order:
        at = 0
    rows: dict[str, NDArray[np.void]] = {}
    for element in elements:
        dtype = _row(element, order or "=", path)
        if order:
            read = _binary_rows(data, at, element.count, dtype)
            at += read.nbytes
        else:
            read, at = _ascii_rows(tokens, at, element, dtype, path)
        _check_whole(read, element, path)
        rows[element.name] = read
    if not {"x", "y", "z"} <= set(rows["vertex"].dtype.names or ()):
        raise InputError(f"{path}: vertices have no x, y, z; {_ANEW}")
    if "vertices" not in (rows["face"].dtype.names or ()):
        raise InputError(f"{path}: faces have no vertex_indices; {_ANEW}")
    return rows


def read_ply(path: Path) -> tuple[NDArray[np.float64], list[list[int]]]:
    """Vertices (n, 3) and polygons of a PLY file, row by row.

    Raises InputError where the file ends early or has no vertices and faces that can be read.
    """
    data = path.read_bytes()
    order, elements, at = _header(data, path)
    values = _ascii_values(data[at:]) if not order else _binary_values(data, at, order)
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    try:
        for element in elements:
            for _ in range(element.count):
                row: dict[str, Any] = {}
                for name, kind, length in element.properties:
                    if length is None:
                        row[name] = values(kind)
                    else:
                        row[name] = [int(values(kind)) for _ in range(int(values(length)))]
                if element.name == "vertex":
                    points.append([float(row[axis]) for axis in "xyz"])
                elif element.name == "face":
                    polygons.append(row["vertex_indices"] if "vertex_indices" in row else row["vertex_index"])
    except (StopIteration, struct.error, ValueError, OverflowError, KeyError) as error:
        raise InputError(f"{path}: is cut off or holds something that is no number; {_ANEW}") from error
    return np.array(points, np.float64).reshape(-1, 3), polygons


def _ascii_values(data: bytes) -> Callable[[str], float]:
    tokens = iter(data.split())
    return lambda kind: float(next(tokens))


def _binary_values(data: bytes, at: int, order: str) -> Callable[[str], float]:
    """The next value of a type ("f4") at a time."""
    place = at
    codes = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}

    def value(kind: str) -> float:
        nonlocal place
        (result,) = struct.unpack_from(order + codes[kind], data, place)
        place += int(kind[1])
        return result

    return value


def _header(data: bytes, path: Path) -> tuple[str, list[_Element], int]:
    """Byte order ("<", ">", "" for ASCII), the elements, and where their rows start."""
    end = data.find(b"end_header")
    newline = data.find(b"\n", end)
    if not data.startswith(b"ply") or end < 0 or newline < 0:
        what = "is empty" if not data else "has no whole PLY header"
        raise InputError(f"{path}: {what}; name a PLY file, or {_ANEW}")
    order: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(data[:end].decode("ascii", "replace").splitlines(), start=1):
        try:
            match line.split():
                case ["format", name, _]:
                    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[name]
                case ["element", name, count]:
                    elements.append(_Element(name, int(count)))
                case ["property", "list", length, kind, name]:
                    elements[-1].properties.append((name, _TYPES[kind], _TYPES[length]))
                case ["property", kind, name]:
                    elements[-1].properties.append((name, _TYPES[kind], None))
        except (KeyError, ValueError, IndexError):
            raise InputError(f"{path}, line {number}: {line.strip()!r} is no PLY header line; {_ANEW}") from None
    if order is None:
        raise InputError(f"{path}: the PLY header names no format; {_ANEW}")
    counts = {element.name: element.count for element in elements}
    if counts.get("vertex", 0) <= 0 or counts.get("face", 0) <= 0:
        raise InputError(f"{path}: the mesh is empty; give it at least one triangle")
    return order, elements, newline + 1


def _row(element: _Element, order: str, path: Path) -> np.dtype[np.void]:
    """One row's layout, with lists taken for triangles' corners: another length shows in the data."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for name, kind, length in element.properties:
        if length is None:
            fields.append((name, order + kind))
        elif element.name == "face" and name in ("vertex_indices", "vertex_index"):
            fields += [("corners", order + length), ("vertices", order + kind, (3,))]
        else:
            raise InputError(f"{path}: {element.name} has a list {name!r}, which Mitsuba cannot read; {_ANEW}")
    if not fields:
        raise InputError(f"{path}: {element.name} has no properties; {_ANEW}")
    return np.dtype(fields)


def _binary_rows(data: bytes, at: int, count: int, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """The element's rows, fewer where the file ends early."""
    return np.frombuffer(data, dtype, min((len(data) - at) // dtype.itemsize, count), at)


def _ascii_rows(
    tokens: list[bytes], at: int, element: _Element, dtype: np.dtype[np.void], path: Path
) -> tuple[NDArray[np.void], int]:
    """The element's rows, fewer where the file ends early, and the token after them."""
    flat = np.dtype([(name, "f8", dtype[name].shape) for name in dtype.names or ()])
    width = flat.itemsize // 8
    mine = tokens[at : at + element.count * width]
    try:
        numbers = np.array(mine[: len(mine) // width * width], dtype=np.float64)
    except ValueError:
        raise InputError(f"{path}: {element.name} holds something that is no number; {_ANEW}") from None
    return numbers.view(flat), at + element.count * width


def _check_whole(rows: NDArray[np.void], element: _Element, path: Path) -> None:
    """As many rows as the header says; a polygon shifts all that follows it, so it is told first."""
    if "corners" in (rows.dtype.names or ()):
        other = rows["corners"] != 3
        if other.any():
            raise _Polygons
    if len(rows) < element.count:
        raise InputError(
            f"{path}: is cut off: the header says {element.count} {element.name} rows, "
            f"the file holds {len(rows)}; copy or export it anew"
        )
