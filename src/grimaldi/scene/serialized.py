"""Reads Mitsuba's .serialized meshes just far enough to refuse those that crash it."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from grimaldi.errors import InputError
from grimaldi.scene.triangles import check_triangles

_MAGIC = 0x041C
_NORMALS, _TEXCOORDS, _COLOURS, _DOUBLE = 0x1, 0x2, 0x8, 0x2000  # flags of what follows the positions


def check_serialized(path: Path, index: int) -> None:
    """Raises InputError unless mesh `index` of the file is whole and its faces' corners exist.

    The layout is Mitsuba's (src/shapes/serialized.cpp): each mesh a header and a zlib stream, then the
    meshes' offsets and their count.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    try:
        magic, version = struct.unpack_from("<HH", data)
        if magic != _MAGIC or version not in (3, 4):
            raise ValueError
        (count,) = struct.unpack_from("<I", data, len(data) - 4)
        if 8 * count > len(data):
            raise ValueError
        if not 0 <= index < count:
            raise InputError(f"{path}: holds {count} meshes; there is none with shape_index {index}")
        offsets = struct.unpack_from(
            "<" + ("I", "Q")[version - 3] * count, data, len(data) - 4 - count * 4 * (version - 2)
        )
        positions, faces = _mesh(zlib.decompressobj().decompress(data[offsets[index] + 4 :]), version)
    except (struct.error, zlib.error, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is no whole .serialized file; export the mesh anew") from error
    check_triangles(positions, faces, str(path))


def _mesh(stream: bytes, version: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and faces (m, 3) of one mesh."""
    (flags,) = struct.unpack_from("<I", stream)
    at = 4 if version == 3 else stream.index(b"\0", 4) + 1  # version 4 has a name
    vertices, triangles = struct.unpack_from("<QQ", stream, at)
    real = np.dtype("<f8" if flags & _DOUBLE else "<f4")
    positions = np.frombuffer(stream, real, 3 * vertices, at + 16)
    numbers = 3 + 3 * bool(flags & _NORMALS) + 2 * bool(flags & _TEXCOORDS) + 3 * bool(flags & _COLOURS)
    faces = np.frombuffer(stream, "<u4", 3 * triangles, at + 16 + vertices * numbers * real.itemsize)
    return positions.reshape(-1, 3), faces.reshape(-1, 3)
