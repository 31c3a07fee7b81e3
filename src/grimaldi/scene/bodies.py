"""Mitsuba's shapes as plain geometry. Whatever is read from Mitsuba's shapes and meshes is read here."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.scene.model import Body, Cylinder, Disk, Geometry, Mesh, Sphere
from grimaldi.scene.planar import PlanarOutline
from grimaldi.scene.triangles import as_mesh

Reals = NDArray[np.float64]

FACES_ROUND = 4096  # of a cylinder: they lie 3e-7 radii inside it
FLAT = 1e-6  # thickness over extent below which vertices lie in one plane: a few roundings of Float32

_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Shapes:
    """A scene's shapes by what they do to waves."""

    bodies: tuple[Body, ...]
    holes: tuple[PlanarOutline, ...]
    others: tuple[str, ...]  # names of the shapes that do not diffract yet


def sort_shapes(shapes: Iterable[Any]) -> Shapes:
    """Opaque bodies, holes (BSDF `aperture`), and the rest, of `mi.Scene.shapes()`.

    Opaque is a mesh, sphere, disk or cylinder whose BSDF transmits nothing and that bounds no medium.

    Raises:
        InputError: an aperture that is no rectangle, disk or planar mesh.
    """
    bodies: list[Body] = []
    holes: list[PlanarOutline] = []
    others: list[str] = []
    for index, shape in enumerate(shapes):
        name = shape.id() or f"{shape.class_name()} {index}"
        if getattr(shape.bsdf(), "plugin_name", None) == "aperture":
            holes.append(planar_outline(shape, name))
        elif _is_opaque(shape):
            bodies.append(Body(name, index, _geometry(shape)))
        else:
            others.append(name)
    return Shapes(tuple(bodies), tuple(holes), tuple(others))


def blockers(mi_scene: Any) -> Any:
    """A Mitsuba scene that shares all shapes that stop light, also those that do not diffract; None without any.

    Only what has a null BSDF or part (apertures, masks, media) is left out. Embree's robust mode finds rays that
    meet an edge exactly, as those along an outline do. Of cylinders it holds the faces: Mitsuba's own intersection
    solves a quadratic in Float32, which from 150 radii away misses a cylinder's wall by a twentieth of its radius.
    """
    import mitsuba as mi

    opaque = [shape for shape in mi_scene.shapes() if not _lets_through(shape)]
    if not opaque:
        return None
    names = [shape.id() for shape in opaque]
    parts = {f"shape-{i}": _faces(shape) for i, shape in enumerate(opaque)}
    scene = mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, **parts})
    for shape, name in zip(opaque, names, strict=True):  # loading renames them by their keys
        shape.set_id(name)
    return scene


def _faces(shape: Any) -> Any:
    """A cylinder's faces; any other shape itself."""
    import mitsuba as mi

    if shape.class_name() != "Cylinder":
        return shape
    angle = 2 * np.pi * np.arange(FACES_ROUND) / FACES_ROUND
    wall = tube(Cylinder(_to_world(shape)), np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    return as_mesh(mi, shape.id(), wall.vertices, wall.faces, mi.Properties())


def tube(cylinder: Cylinder, ring: Reals) -> Mesh:
    """A cylinder's wall as flat faces between points (n, 3) of its unit circle."""
    n = len(ring)
    local = np.concatenate([ring, ring + [0, 0, 1]])
    here, there = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([np.stack([here, there, n + there], axis=1), np.stack([here, n + there, n + here], axis=1)])
    return Mesh(local @ cylinder.to_world[:3, :3].T + cylinder.to_world[:3, 3], faces)


def _lets_through(shape: Any) -> bool:
    import mitsuba as mi

    bsdf = shape.bsdf()
    return bsdf is not None and bool(bsdf.flags() & int(mi.BSDFFlags.Null))


def front(shape: Any) -> Reals:
    """The unit normal (3,) of a planar shape, on the side that emits."""
    import mitsuba as mi

    normal = np.array(shape.sample_position(0.0, mi.Point2f(0.5)).n, dtype=np.float64).reshape(3)
    return normal / np.linalg.norm(normal)


def faces_inward(mi_scene: Any, body: Body) -> bool:
    """Whether Mitsuba's normals of a body are turned against its vertex order: `flip_normals`, a room."""
    return bool(mi_scene.shapes()[body.shape].has_flipped_normals())


def vertices(geometry: Geometry) -> Reals:
    """Points (n, 3) whose convex hull holds the body."""
    if isinstance(geometry, Mesh):
        return geometry.vertices
    if isinstance(geometry, Sphere):
        return geometry.centre + geometry.radius * _box_corners()
    if isinstance(geometry, Cylinder):
        return (_box_corners() * [1, 1, 0.5] + [0, 0, 0.5]) @ geometry.to_world[:3, :3].T + geometry.to_world[:3, 3]
    return _square(geometry.to_world)


def plane(points: Reals) -> tuple[Reals, Reals, float]:
    """The points' centre (3,), unit normal (3,) of the plane through it nearest to them, and thickness."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd((points - centre).T @ (points - centre))[0][:, 2]
    return centre, normal, float(np.ptp((points - centre) @ normal))


def is_flat(points: Reals) -> bool:
    """Whether the points lie in one plane, within Float32's rounding of their coordinates."""
    return plane(points)[2] <= FLAT * (np.ptp(points, axis=0).max() + np.abs(points).max())


def _is_opaque(shape: Any) -> bool:
    import mitsuba as mi

    mesh = shape.is_mesh() and shape.class_name() != "EllipsoidsMesh"
    if not (mesh or shape.class_name() in ("Sphere", "Disk", "Cylinder")) or shape.is_medium_transition():
        return False
    bsdf = shape.bsdf()
    return bsdf is not None and not bsdf.flags() & int(mi.BSDFFlags.Transmission)


def _geometry(shape: Any) -> Geometry:
    if shape.is_mesh():
        positions = np.array(shape.vertex_positions_buffer(), dtype=np.float64).reshape(-1, 3)
        faces = np.array(shape.faces_buffer(), dtype=np.int64).reshape(-1, 3)
        return Mesh(positions, faces)
    to_world = _to_world(shape)
    if shape.class_name() == "Disk":
        return Disk(to_world)
    if shape.class_name() == "Cylinder":
        return Cylinder(to_world)
    # Mitsuba drops a sphere's non-uniform scale, though to_world keeps it: the area tells what it renders.
    area = float(np.array(shape.surface_area()).reshape(-1)[0])
    return Sphere(to_world[:3, 3].copy(), float(np.sqrt(area / (4 * np.pi))))


def _to_world(shape: Any) -> Reals:
    import mitsuba as mi

    to_world: Any = mi.traverse(shape)["to_world"]
    return np.array(to_world.matrix, dtype=np.float64).reshape(4, 4)


def planar_outline(shape: Any, name: str) -> PlanarOutline:
    """The outline of a planar shape as a hole.

    Raises InputError for any shape that is no rectangle, disk or planar mesh.
    """
    if shape.class_name() == "Rectangle":
        return PlanarOutline(_SQUARE, _to_world(shape))
    if shape.class_name() == "Disk":
        return PlanarOutline.ellipse(_to_world(shape))
    if not shape.is_mesh():
        raise InputError(f"{name}: an aperture must be planar; use a rectangle, a disk or a planar mesh")
    mesh = _geometry(shape)
    assert isinstance(mesh, Mesh)
    return _mesh_hole(mesh, name)


def _mesh_hole(mesh: Mesh, name: str) -> PlanarOutline:
    """The border of a planar mesh's triangles."""
    import shapely

    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"{name}: an aperture's vertices must be finite")
    if not len(mesh.faces) or not is_flat(mesh.vertices):
        raise InputError(f"{name}: an aperture must be planar; put the mesh's vertices into one plane")
    origin, normal, _ = plane(mesh.vertices)
    x = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    x /= np.linalg.norm(x)
    to_world = np.eye(4)
    to_world[:3] = np.stack([x, np.cross(normal, x), normal, origin], axis=1)
    flat = (mesh.vertices - origin) @ to_world[:3, :2]
    region = shapely.union_all(shapely.polygons(flat[mesh.faces]))
    loops = [
        shapely.get_coordinates(ring)[:-1]
        for polygon in shapely.get_parts(region)
        for ring in (polygon.exterior, *polygon.interiors)
    ]
    return PlanarOutline(loops, to_world)


def _square(to_world: Reals) -> Reals:
    """The corners of the square round the unit disc, in world space."""
    return _SQUARE @ to_world[:3, :2].T + to_world[:3, 3]


def _box_corners() -> Reals:
    return np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
