"""Refuses scenes that Mitsuba would crash on or render wrongly, and those that waves make no sense in."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import GrimaldiWarning, InputError
from grimaldi.parts import parts
from grimaldi.scene.bodies import faces_inward, vertices
from grimaldi.scene.messages import where
from grimaldi.scene.model import Body, Mesh, Scene, Sphere
from grimaldi.scene.ply import check_ply
from grimaldi.scene.polygons import check_obj
from grimaldi.scene.screen import check_aperture, check_screen
from grimaldi.scene.serialized import check_serialized
from grimaldi.scene.sources import ZERO_DIRECTION
from grimaldi.scene.triangles import LARGEST, check_positions, check_triangles, merged_points, solid_angle

Reals = NDArray[np.float64]

SOME = 4096  # faces at once: nearly always the first have an area
LARGEST_FILM = 2**28  # pixels; far beyond it Mitsuba counts wrongly, and says nothing


def require_sources(scene: Scene) -> None:
    """Raises InputError where a field is asked of a scene without a source."""
    if not scene.sources:
        raise InputError(
            f"{scene.name}: has no source of waves; add a 'point', 'directional', 'spot', 'coherent_point', "
            "'coherent_directional' or 'coherent_area' emitter"
        )


def require_sensor(scene: Scene) -> None:
    """Raises InputError where a picture is asked of a scene without a camera."""
    if not scene.mitsuba.sensors():
        raise InputError(f'{scene.name}: has no sensor; add one, such as <sensor type="perspective">')


def check_nodes(state: Any) -> None:
    """Checks a parsed scene (`mi.parser.ParserState`) before Mitsuba builds it: mesh files, radii, films, directions.

    Raises:
        InputError: naming the file and line.
    """
    import mitsuba as mi

    _check_area_lights(state)
    resolver = cast(Any, mi).file_resolver()  # misplaced in the stubs
    for node in state.nodes:
        plugin, props = node.props.plugin_name(), node.props
        place = where(mi.parser.file_location(state, node))
        if plugin in ("ply", "obj", "serialized") and isinstance(name := props.get("filename", None), str):
            file = Path(str(resolver.resolve(name)))
            if not file.is_file():
                raise InputError(f"{place}: file {name!r} not found; name it relative to the scene's folder")
            if (plugin == "ply" and check_ply(file)) or (plugin == "obj" and check_obj(file)):
                props.set_plugin_name("polygons")
            elif plugin == "serialized":
                check_serialized(file, _whole_number(props, "shape_index", 0, place))
        elif plugin in ("sphere", "cylinder") and isinstance(radius := props.get("radius", None), (int, float)):
            _check_radius(radius, place, plugin)
        elif plugin == "hdrfilm":
            width = _whole_number(props, "width", 768, place)
            height = _whole_number(props, "height", 576, place)
            if width < 1 or height < 1:
                raise InputError(f"{place}: a film of {width} × {height} pixels; give at least 1 × 1")
            if width * height > LARGEST_FILM:
                raise InputError(f"{place}: a film of {width} × {height} pixels; give at most 2^28 in all")
        elif plugin == "directional" and "direction" in props and not np.array(props["direction"]).any():
            raise InputError(f"{place}: directional: {ZERO_DIRECTION}")  # Mitsuba makes NaN of it


def _check_area_lights(state: Any) -> None:
    """Mitsuba says nothing of emitters that want a shape and stand in the scene itself."""
    import mitsuba as mi

    props = state.root.props
    for name in props:
        if props.type(name) != mi.Properties.Type.ResolvedReference:
            continue
        node = state.nodes[props[name].index()]
        if node.props.plugin_name() == "coherent_area":
            raise InputError(
                f"{where(mi.parser.file_location(state, node))}: a coherent_area is part of a shape; put it into a "
                "rectangle, a disk or a planar mesh"
            )


def check_scene(scene: Scene) -> None:
    """Checks bodies, sources and screen of a loaded scene.

    Raises:
        InputError: naming the body or source.
        NotYet: bodies and apertures that cannot be computed together yet.

    Warns:
        GrimaldiWarning: naming each body's edge that is shared by more than two faces.
    """
    for body in scene.bodies:
        _check_body(body)
    for source in scene.sources:
        for body in scene.bodies:
            if source.position is None or not _is_inside(source.position, body, scene.mitsuba):
                continue
            if not _is_room(body, scene):
                raise InputError(
                    f"{source.name}: the source lies inside {body.name!r}; move it out, or turn the faces "
                    "inward (flip_normals) if that is a room"
                )
    check_screen(replace(scene, sources=tuple(source for source in scene.sources if source.aperture is None)))
    for source in scene.sources:
        if source.aperture is not None:
            check_aperture(scene, source)


def _check_body(body: Body) -> None:
    geometry = body.geometry
    if isinstance(geometry, Sphere):
        _check_radius(geometry.radius, body.name)
        check_positions(geometry.centre[None], body.name)
    elif isinstance(geometry, Mesh):
        check_triangles(geometry.vertices, geometry.faces, body.name)
        _check_area(geometry, body.name)
        _warn_of_shared_edges(geometry, body.name)
    elif not (np.abs(geometry.to_world) < LARGEST).all():
        raise InputError(f"{body.name}: to_world is not finite; give finite numbers below {LARGEST:g}")
    elif np.linalg.matrix_rank(geometry.to_world[:3, :3]) < 3:
        raise InputError(f"{body.name}: to_world flattens it; give a scale, and a radius, that is nowhere 0")


def _check_area(mesh: Mesh, name: str) -> None:
    for some in parts(len(mesh.faces), SOME):
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces[some]], 1, 0)
        if np.cross(b - a, c - a).any():
            break
    else:
        raise InputError(f"{name}: all faces have zero area; give a scale that is nowhere 0, or export the mesh anew")


def _whole_number(props: Any, name: str, default: int, place: str) -> int:
    value = props.get(name, default)
    if type(value) is not int:  # a bool is none
        raise InputError(f"{place}: {name} is {value!r}; give a whole number")
    return value


def _check_radius(radius: float, place: str, shape: str = "sphere") -> None:
    if not (math.isfinite(radius) and radius > 0):
        raise InputError(f"{place}: the {shape}'s radius is {radius:g}; give a positive number")


def _warn_of_shared_edges(mesh: Mesh, name: str) -> None:
    """Names the first edge that more than two faces meet at."""
    points = np.ascontiguousarray(mesh.vertices.T + 0.0)  # + 0.0: -0 is 0
    _, vertex = merged_points(points, np.zeros(len(mesh.vertices), np.int64))
    tail, head = vertex[mesh.faces.T], vertex[np.roll(mesh.faces, -1, axis=1).T]
    edges = np.minimum(tail, head) * len(vertex) + np.maximum(tail, head)
    edges[tail == head] = -1 - np.flatnonzero(tail == head)  # no edge
    key = np.sort(edges, axis=None)
    if (key[2:] != key[:-2]).all():
        return
    _, first, count = np.unique(edges, return_index=True, return_counts=True)
    shared = np.flatnonzero(count > 2)
    if len(shared):
        side, face = np.divmod(first[shared[0]], len(mesh.faces))
        ends = mesh.vertices[mesh.faces[face, [side, (side + 1) % 3]]]
        start, end = (f"({', '.join(f'{x:g}' for x in point)})" for point in ends)
        more = f", as are {len(shared) - 1} more edges" if len(shared) > 1 else ""
        warnings.warn(
            f"{name}: the edge from {start} to {end} is shared by {count[shared[0]]} faces{more}; "
            "its outline may be wrong there",
            GrimaldiWarning,
            stacklevel=6,
        )


def _is_room(body: Body, scene: Scene) -> bool:
    """Whether a camera or another body is inside as well."""
    cameras = [np.array(s.world_transform().translation(), np.float64).ravel() for s in scene.mitsuba.sensors()]
    others = [vertices(other.geometry).mean(axis=0) for other in scene.bodies if other is not body]
    return any(_is_inside(point, body, scene.mitsuba) for point in cameras + others)


def _is_inside(point: Reals, body: Body, mi_scene: Any) -> bool:
    """Whether the body's outward faces enclose the point; faces turned inward make a room, which may."""
    geometry = body.geometry
    if isinstance(geometry, Sphere):
        inside = float(np.linalg.norm(point - geometry.centre)) < geometry.radius
        return inside and not faces_inward(mi_scene, body)
    if not isinstance(geometry, Mesh):
        return False
    low, high = geometry.vertices.min(axis=0), geometry.vertices.max(axis=0)
    if not ((low < point) & (point < high)).all():
        return False
    winding = solid_angle(geometry.vertices, geometry.faces, point) / (4 * np.pi)
    # 1 in a closed mesh, less where one is open; a room with a missing wall stays well below 0.9.
    return (-winding if faces_inward(mi_scene, body) else winding) > 0.9
