"""Mitsuba's shapes as plain geometry. Whatever is read from Mitsuba's shapes and meshes is read here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.scene.facets import facets
from grimaldi.scene.model import Body, Cylinder, Disk, Geometry, Joined, Mesh, Sphere
from grimaldi.scene.planar import PlanarOutline
from grimaldi.scene.triangles import as_mesh

Reals = NDArray[np.float64]

MANY = 256  # meshes, that it pays to put into one for: Dr.Jit looks at every shape there is wherever rays are traced
FACES_ROUND = 4096  # of a cylinder: they lie 3e-7 radii inside it
FLAT = 1e-6  # thickness over extent below which vertices lie in one plane: a few roundings of Float32

_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Shapes:
    """A scene's shapes by what they do to waves."""

    surfaces: tuple[Geometry | None, ...]  # of every shape; None of kinds other than those of `Geometry`
    bodies: tuple[Body, ...]
    holes: tuple[PlanarOutline, ...]
    others: tuple[str, ...]  # names of the shapes that do not diffract yet


@dataclass(frozen=True, eq=False)
class Surface(Mesh):
    """A mesh with what its vertices carry: normals (n, 3), uv (n, 2), and Mitsuba's attributes.

    Those named "vertex_…" have a row for each vertex, those named "face_…" one for each face.
    """

    normals: Reals
    uv: Reals | None
    attributes: dict[str, Reals]


def sort_shapes(shapes: Iterable[Any]) -> Shapes:
    """Opaque bodies, holes (BSDF `aperture`), and the rest, of `mi.Scene.shapes()`.

    Opaque is a mesh, sphere, disk or cylinder whose BSDF transmits nothing and that bounds no medium.

    Raises:
        InputError: an aperture that is no rectangle, disk or planar mesh; an instance.
    """
    surfaces: list[Geometry | None] = []
    bodies: list[Body] = []
    holes: list[PlanarOutline] = []
    others: list[str] = []
    for index, shape in enumerate(shapes):
        name = shape.id() or f"{shape.class_name()} {index}"
        if shape.class_name() == "Instance":  # those of files and dictionaries are written out before
            raise InputError(
                f"{name}: an instance tells nothing of its shapes here; load the scene's file or dictionary"
            )
        surface = _geometry(shape)
        surfaces.append(surface)
        if is_aperture(shape):
            holes.append(planar_outline(shape, name))
        elif surface is not None and _is_opaque(shape):
            bodies.append(Body(name, index, surface, facets(surface) if isinstance(surface, Mesh) else None))
        else:
            others.append(name)
    return Shapes(tuple(surfaces), tuple(bodies), tuple(holes), tuple(others))


def blockers(mi_scene: Any, bodies: Iterable[Body]) -> Any:
    """A Mitsuba scene that shares all shapes that stop light, also those that do not diffract; None without any.

    Only what has a null BSDF or part (apertures, masks, media) is left out. Embree's robust mode finds rays that
    meet an edge exactly, as those along an outline do. Of cylinders it holds the faces: Mitsuba's own intersection
    solves a quadratic in Float32, which from 150 radii away misses a cylinder's wall by a twentieth of its radius.
    Of `bodies` that have facets it holds these, and many meshes as one.
    """
    shapes = list(mi_scene.shapes())
    for body in bodies:
        if body.facets is not None:
            shapes[body.shape] = _as_shape(shapes[body.shape], body.facets)
    opaque = [shape for shape in shapes if not _lets_through(shape)]
    if not opaque:
        return None
    return _sharing(_few([_faces(shape) for shape in opaque]), embree_use_robust_intersections=True)


def _few(shapes: Sequence[Any]) -> list[Any]:
    """Shapes for rays alone, more than `MANY` meshes as one."""
    meshes = [shape for shape in shapes if shape.is_mesh() and not shape.is_ellipsoids()]
    if len(meshes) <= MANY:
        return list(shapes)
    others = [shape for shape in shapes if not shape.is_mesh() or shape.is_ellipsoids()]
    return [*others, _as_shape(meshes[0], one_of([_mesh(shape) for shape in meshes]))]


def one_of(meshes: Sequence[Mesh]) -> Joined:
    """Meshes one after the other."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Joined(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + i for mesh, i in zip(meshes, first[:-1], strict=True)]),
        np.cumsum([0, *(len(mesh.faces) for mesh in meshes)]),
    )


def with_shapes(mi_scene: Any, shapes: Sequence[Any]) -> Any:
    """A Mitsuba scene of other shapes, in their order, that shares integrator, sensors and emitters with `mi_scene`."""
    own = [part for part in (*mi_scene.sensors(), *mi_scene.emitters()) if part.get_shape() is None]
    integrator = mi_scene.integrator()
    return _sharing([*shapes, *own, *([] if integrator is None else [integrator])])


def _sharing(parts: Sequence[Any], **flags: bool) -> Any:
    """A Mitsuba scene of parts that other scenes have too."""
    import mitsuba as mi

    names = [part.id() for part in parts]
    scene = mi.load_dict({"type": "scene", **flags, **{f"part-{i}": part for i, part in enumerate(parts)}})
    for part, name in zip(parts, names, strict=True):  # loading renames them by their keys
        part.set_id(name)
    return scene


def is_aperture(shape: Any) -> bool:
    """Whether a shape is a hole, by the BSDF `aperture`."""
    return getattr(shape.bsdf(), "plugin_name", None) == "aperture"


def carries_light(shape: Any) -> bool:
    """Whether an emitter or a sensor sits on a shape."""
    return shape.is_emitter() or shape.is_sensor()


def _faces(shape: Any) -> Any:
    """A cylinder's faces; any other shape itself."""
    if shape.class_name() != "Cylinder":
        return shape
    angle = 2 * np.pi * np.arange(FACES_ROUND) / FACES_ROUND
    return _as_shape(
        shape, tube(Cylinder(_to_world(shape)), np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    )


def _as_shape(shape: Any, mesh: Mesh) -> Any:
    """A mesh in the place of a shape, for rays alone."""
    import mitsuba as mi

    return as_mesh(mi, shape.id(), mesh.vertices, mesh.faces, mi.Properties())


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


def indices(mi_scene: Any) -> NDArray[np.uint32]:
    """Mitsuba's numbers (n,) of the shapes of `mi.Scene.shapes()`, which a pointer to one, `si.shape`, holds."""
    import drjit as dr
    import mitsuba as mi

    return np.array(dr.reinterpret_array(mi.UInt32, mi_scene.shapes_dr()), dtype=np.uint32)


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

    bsdf = shape.bsdf()
    return not shape.is_medium_transition() and bsdf is not None and not bsdf.flags() & int(mi.BSDFFlags.Transmission)


def _geometry(shape: Any) -> Geometry | None:
    kind = shape.class_name()
    if shape.is_mesh() and kind != "EllipsoidsMesh":
        return _mesh(shape)
    if kind not in ("Sphere", "Disk", "Cylinder"):
        return None
    to_world = _to_world(shape)
    if kind == "Disk":
        return Disk(to_world)
    if kind == "Cylinder":
        return Cylinder(to_world)
    return Sphere(to_world[:3, 3].copy(), _radius(shape, to_world))


def _radius(shape: Any, to_world: Reals) -> float:
    """A sphere's radius. Mitsuba drops a non-uniform scale that to_world keeps: the area tells what it renders."""
    by_area = float(np.sqrt(float(np.array(shape.surface_area()).reshape(-1)[0]) / (4 * np.pi)))
    scales = np.linalg.norm(to_world[:3, :3], axis=0)
    uniform = np.allclose(scales, by_area, rtol=FLAT, atol=0)
    return float(scales.mean()) if uniform else by_area  # the area is rounded once more


def _mesh(shape: Any) -> Mesh:
    faces = np.array(shape.faces_buffer(), dtype=np.int64).reshape(-1, 3)
    return Mesh(_rows(shape.vertex_positions_buffer(), 3), faces)


def surface(shape: Any) -> Surface | None:
    """A mesh that is shaded by vertex normals; None of any other shape."""
    import mitsuba as mi

    mesh = shape.is_mesh() and not shape.is_ellipsoids()
    if not mesh or not shape.has_vertex_normals() or shape.has_face_normals():
        return None
    plain = _mesh(shape)
    uv = _rows(shape.vertex_texcoords_buffer(), 2) if shape.has_vertex_texcoords() else None
    rows = {"vertex": len(plain.vertices), "face": len(plain.faces)}
    attributes = {}
    for name, _ in mi.traverse(shape):
        kind = name.partition("_")[0]
        if kind in rows and shape.has_attribute(name):
            values = shape.attribute_buffer(name)
            attributes[name] = _rows(values, len(values) // rows[kind])
    normals = _rows(shape.vertex_normals_buffer(), 3)
    return Surface(plain.vertices, plain.faces, normals, uv, attributes)


def _rows(values: Any, columns: int) -> Reals:
    return np.array(values, dtype=np.float64).reshape(-1, columns)


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
    mesh = _geometry(shape)
    if not isinstance(mesh, Mesh):
        raise InputError(f"{name}: an aperture must be planar; use a rectangle, a disk or a planar mesh")
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
