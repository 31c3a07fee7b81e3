"""Shapes that Mitsuba has no plugin for, as meshes: `cone`, `stl`, `gltf`, and PLY and OBJ files with polygons."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.plugins import parameters
from grimaldi.scene.triangles import as_mesh

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

SEGMENTS = 256  # of a cone's base: within 7.5e-5 of the radius of the circle


def register(V: Any) -> None:
    """Makes the shapes known to the variant module V (such as `mi.llvm_ad_rgb`).

    `cone`: p0 (middle of the base), p1 (tip), radius, to_world, flip_normals; closed by its base.
    `stl`, `gltf` (.gltf and .glb): filename, to_world, face_normals (STL: true unless given), flip_normals; all
    parts of a file are one mesh. `polygons`: PLY and OBJ files whose faces have any number of corners, triangulated;
    `grimaldi.load` puts it in the place of `ply` and `obj` where it has to.
    """
    for name, read in READERS.items():
        V.register_shape(name, _constructor(V, name, read))


def _constructor(V: Any, name: str, read: Callable[[Any], tuple[Reals, Integers]]) -> Callable[[Any], Any]:
    def construct(props: Any) -> Any:
        vertices, faces = read(props)
        to_world = props.get("to_world", None)
        if to_world is not None:
            matrix = np.array(to_world.matrix, dtype=np.float64).reshape(4, 4)
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        smooth = not props.get("face_normals", name in ("cone", "stl"))
        return as_mesh(V, props.id() or name, vertices, faces, props, smooth=smooth)

    return construct


def _cone(props: Any) -> tuple[Reals, Integers]:
    base, tip = (np.array(parameters.vector(props, name)) for name in ("p0", "p1"))
    radius = parameters.number(props, "radius", 1.0)
    if radius <= 0:
        raise InputError(f"cone: radius is {radius:g}; give a positive number")
    height = float(np.linalg.norm(tip - base))
    if height == 0:
        raise InputError("cone: p0 and p1 are the same; give the middle of the base and the tip")
    axis = (tip - base) / height
    x = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    x /= np.linalg.norm(x)
    angle = 2 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    rim = base + radius * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * np.cross(axis, x))
    here, there = np.arange(SEGMENTS) + 2, (np.arange(SEGMENTS) + 1) % SEGMENTS + 2
    side = np.stack([np.full(SEGMENTS, 1), here, there], axis=1)
    bottom = np.stack([np.zeros(SEGMENTS, np.int64), there, here], axis=1)
    return np.concatenate([[base, tip], rim]), np.concatenate([side, bottom])


def _stl(props: Any) -> tuple[Reals, Integers]:
    from grimaldi.scene.exchange import read

    return read(_file(props), (".stl",))


def _gltf(props: Any) -> tuple[Reals, Integers]:
    from grimaldi.scene.exchange import read

    return read(_file(props), (".gltf", ".glb"))


def _polygons(props: Any) -> tuple[Reals, Integers]:
    from grimaldi.scene.ply import read_ply
    from grimaldi.scene.polygons import read_obj, triangles

    path = _file(props)
    points, polygons = read_obj(path) if path.suffix.lower() == ".obj" else read_ply(path)
    return points, triangles(points, polygons, str(path))


def _file(props: Any) -> Path:
    import mitsuba

    mi: Any = mitsuba  # the stubs misplace the resolver
    name = props.get("filename", None)
    if not isinstance(name, str):
        raise InputError(f"{props.plugin_name()}: filename is missing; give the mesh's file")
    return Path(str(mi.file_resolver().resolve(name)))


READERS = {"cone": _cone, "stl": _stl, "gltf": _gltf, "polygons": _polygons}
