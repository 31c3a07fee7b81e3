"""Silhouettes as the report found them: two rays past every edge, ε beside it (THEORY 4, weights "report").

Kept for comparison: an edge counts or not as a whole, and which do changes with ε. `extract` is exact.
"""

from __future__ import annotations

from typing import Any

import mitsuba
import numpy as np
from numpy.typing import NDArray

from grimaldi.outlines import cylinder, disk
from grimaldi.outlines.candidate import Candidates, closed_curve, polygon, toward
from grimaldi.outlines.extract import assemble, curve, sight_of
from grimaldi.outlines.lit import Stretches
from grimaldi.outlines.memory import once
from grimaldi.outlines.mesh import normals_beside
from grimaldi.outlines.model import Outline, Reals
from grimaldi.outlines.soup import Soup
from grimaldi.outlines.sphere import across, tangent_circle
from grimaldi.scene.model import Cylinder, Disk, Mesh, Scene, Source, Sphere

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

EPSILON = 2e-4  # of a body's size, where none is given
CIRCLE = 32  # edges of a circle, as much as a mesh's
SAG = np.pi**2 / (2 * CIRCLE**2)  # of the radius: how far they lie from it
DEEP = 0.02  # of a body's size: how far beyond an edge a ray has to be free, so that grazing faces do not count


def offset_outline(scene: Scene, source: Source, epsilon: float | None = None) -> Outline:
    """The silhouette edges of a scene's bodies by the report's test.

    epsilon: how far beside an edge the rays pass [scene units]; 2e-4 of each body's size unless given. Of a mesh
    the edges of whose two rays one passes and the other does not; of a sphere the great circle across the light,
    of a disk the rim, of a cylinder both rims and its tangent lines, each as about 32 edges, where the source reaches
    their middles.
    """
    soup = once(scene, ("triangles",), lambda: Soup.of([body.geometry for body in scene.bodies]))
    parts: list[Candidates] = []
    for number, body in enumerate(scene.bodies):
        geometry = body.geometry
        if isinstance(geometry, Mesh):
            parts.append(_mesh(scene, soup, number, source, epsilon or EPSILON * curve(geometry)[1]))
            continue
        edges = _great_circle(geometry, source) if isinstance(geometry, Sphere) else _rims(geometry, source)
        parts.append(edges)
    if not any(len(part.start) for part in parts):
        return Outline.empty()
    edges = Candidates.concatenate(parts)
    body = np.repeat(np.arange(len(parts)), [len(part.start) for part in parts])
    sight = sight_of(scene.bodies, soup, source, edges, body)
    by_middle = np.flatnonzero(edges.edge < 0)
    dark = by_middle[sight.hidden(by_middle, np.full(len(by_middle), 0.5))]
    whole = Stretches.whole(len(body))[np.delete(np.arange(len(body)), dark)]
    return assemble(edges, body, whole, source, 0.0, sight=sight)


def _great_circle(sphere: Sphere, source: Source) -> Candidates:
    _, touched, light = tangent_circle(sphere, source)
    if touched == 0:
        return Candidates.empty()
    x, y = across(light)
    corners = sphere.centre + sphere.radius * polygon(CIRCLE) @ np.stack([x, y])
    radial = 0.5 * (corners + np.roll(corners, -1, axis=0)) - sphere.centre
    normal = radial / np.linalg.norm(radial, axis=1, keepdims=True)
    return closed_curve(corners, np.stack([normal, normal], axis=1))


def _rims(shape: Disk | Cylinder, source: Source) -> Candidates:
    if isinstance(shape, Cylinder):
        radius = float(np.linalg.norm(shape.to_world[:3, :2], axis=0).max())
        return cylinder.silhouette(shape, source, radius * SAG)
    return disk.silhouette(shape, source, curve(shape)[1] * SAG)


def _mesh(scene: Scene, soup: Soup, number: int, source: Source, epsilon: float) -> Candidates:
    mesh = scene.bodies[number].geometry
    index = np.arange(soup.first[number], soup.first[number + 1])
    index = index[soup.has_corners[index]]
    faces = soup.corners[:, index].T
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    first = np.flatnonzero(np.append(True, (np.diff(ends[order], axis=0) != 0).any(axis=1)))
    count = np.diff(np.append(first, len(order)))
    start, end = (soup.points[:, of].T for of in ends[order[first]].T)
    face1 = index[order[first] // 3]
    face2 = np.where(count > 1, index[order[np.minimum(first + 1, len(order) - 1)] // 3], -1)
    edge = 3 * (face1 - soup.first[number]) + order[first] % 3

    out = np.cross(end - start, -toward(source, 0.5 * (start + end)))
    length, deep = np.linalg.norm(out, axis=1, keepdims=True), DEEP * curve(mesh)[1]
    out = out / np.maximum(length, 1e-300)
    plus, minus = (_passes(scene, source, 0.5 * (start + end) + side * epsilon * out, deep) for side in (1, -1))
    found = (plus != minus) & (length[:, 0] > 0)
    # the body on the left of the edge, seen along the light
    start, end = np.where(plus[:, None], start, end)[found], np.where(plus[:, None], end, start)[found]
    face1, face2 = face1[found], face2[found]
    normals, swap = normals_beside(soup, source, start, face1, face2)
    face1, face2 = np.where(swap, face2, face1), np.where(swap, face1, face2)
    return Candidates(start, end, normals, edge[found], np.stack([face1, face2], axis=1))


def _passes(scene: Scene, source: Source, x: Reals, deep: float) -> NDArray[np.bool_]:
    """Whether the light goes past points x (n, 3) and `deep` further, by Mitsuba's rays."""
    back = toward(source, x)
    if source.is_plane:
        box = scene.blockers.bbox()
        back = back * 2 * float(np.linalg.norm(np.array(box.max) - np.array(box.min)))
    reach = np.linalg.norm(back, axis=1)
    origin, d = (x + back).T, -(back / reach[:, None]).T
    ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(d), mi.Float(reach + deep), 0, mi.Color0f())
    return ~np.array(scene.blockers.ray_test(ray))
