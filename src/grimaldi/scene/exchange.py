"""Meshes from the files of other programs, through trimesh: STL and glTF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.scene.triangles import check_triangles


def read(path: Path, kinds: tuple[str, ...]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3) of a file whose suffix is one of `kinds`, all its parts in their places as one.

    Raises InputError for a file that is missing, broken, of another kind or without triangles.
    """
    import trimesh

    if path.suffix.lower() not in kinds:
        raise InputError(f"{path}: is no {' or '.join(kinds)} file; name one")
    if not path.is_file():
        raise InputError(f"{path}: no such file; name it relative to the scene's folder")
    try:
        parts: Any = trimesh.load(path, process=False)
        mesh = parts.to_mesh() if isinstance(parts, trimesh.Scene) else parts
        vertices = np.array(mesh.vertices, np.float64).reshape(-1, 3)
        faces = np.array(mesh.faces, np.int64).reshape(-1, 3)
    except Exception as error:  # whatever a parser meets in a broken file
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: cannot be read ({reason[:120]}); export the mesh anew") from error
    check_triangles(vertices, faces, str(path))
    return vertices, faces
