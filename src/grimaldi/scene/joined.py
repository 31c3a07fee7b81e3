"""Many meshes of one material as one: Dr.Jit looks at every shape there is in each kernel that traces the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from grimaldi.scene.bodies import MANY, carries_light, is_aperture, one_of, with_shapes
from grimaldi.scene.model import Geometry, Mesh, Scene
from grimaldi.scene.triangles import as_mesh


@dataclass(frozen=True)
class _Look:
    """What meshes have in common that a camera cannot tell apart but by where they are."""

    bsdf: Any  # of Mitsuba, or the reflectance of the plainest
    flipped: bool


def joined(scene: Scene) -> Scene:
    """The scene with a Mitsuba scene in which more than `MANY` meshes of one material are one.

    Bodies, their names and geometry stay what they were; `Joined` surfaces tell which face is whose. Left as they are:
    meshes with vertex normals, texture coordinates, attributes or facets, apertures, and shapes that bound media or
    carry emitters or sensors.
    """
    shapes = scene.mitsuba.shapes()
    alike: dict[_Look, list[int]] = {}
    faceted = {body.shape for body in scene.bodies if body.facets is not None}
    for i, shape in enumerate(shapes):
        look = _look(shape) if isinstance(scene.surfaces[i], Mesh) and i not in faceted else None
        if look is not None:
            alike.setdefault(look, []).append(i)
    groups = {look: group for look, group in alike.items() if len(group) > MANY}
    if not groups:
        return scene
    own = np.ones(len(shapes), bool)
    own[np.concatenate([*groups.values()])] = False
    place = np.cumsum(own) - 1
    kept: list[Any] = [shapes[i] for i in np.flatnonzero(own)]
    surfaces: list[Geometry | None] = [scene.surfaces[i] for i in np.flatnonzero(own)]
    for look, group in groups.items():
        place[group] = len(kept)
        surfaces.append(one_of([surface for i in group if isinstance(surface := scene.surfaces[i], Mesh)]))
        kept.append(_shape_of(surfaces[-1], look, shapes[group[0]].bsdf()))
    return replace(
        scene,
        mitsuba=with_shapes(scene.mitsuba, kept),
        surfaces=tuple(surfaces),
        bodies=tuple(replace(body, shape=int(place[body.shape])) for body in scene.bodies),
        sources=tuple(s if s.shape is None else replace(s, shape=int(place[s.shape])) for s in scene.sources),
    )


def _look(shape: Any) -> _Look | None:
    """How a mesh looks; None where it stays by itself."""
    import mitsuba as mi

    bsdf = shape.bsdf()
    plain = not shape.has_vertex_normals() and not shape.has_vertex_texcoords() and shape.class_name() != "Rectangle"
    if bsdf is None or not plain or is_aperture(shape) or carries_light(shape) or shape.is_medium_transition():
        return None
    if any(shape.has_attribute(name) for name, _ in mi.traverse(shape)):
        return None
    values = {name: tuple(np.array(value).ravel()) for name, value in mi.traverse(bsdf)}
    of_one_value = bsdf.class_name() == "SmoothDiffuse" and [*values] == ["reflectance.value"]
    return _Look(values["reflectance.value"] if of_one_value else bsdf, shape.has_flipped_normals())


def _shape_of(surface: Any, look: _Look, bsdf: Any) -> Any:
    import mitsuba as mi

    props = mi.Properties()
    props["bsdf"], props["flip_normals"] = bsdf, look.flipped
    mesh = as_mesh(mi, "joined", surface.vertices, surface.faces, props)
    mesh.set_id("joined")
    return mesh
