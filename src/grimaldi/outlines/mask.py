"""The shadow mask: what the bodies cover of a source's view, as one polygon operation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grimaldi.outlines.cylinder import strip
from grimaldi.outlines.model import Reals
from grimaldi.outlines.projection import Projection, projection
from grimaldi.outlines.sphere import across, tangent_circle
from grimaldi.scene.bodies import is_flat, plane, vertices
from grimaldi.scene.model import Body, Cylinder, Disk, Mesh, Scene, Source
from grimaldi.scene.triangles import solid_angle

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

CORNERS = 360  # of the polygon that stands for a circle
WIDEST_TRIANGLE = np.radians(4)  # in a picture that bends straight edges
FLAT_TRIANGLE = 1e-14  # area over squared extent of the picture below which a triangle is seen edge on


@dataclass(frozen=True, eq=False)
class Mask:
    """What a source sees in shadow: `region` in the picture coordinates of `projection`.

    With `hole` the region is the openings of a screen that is opaque everywhere else.
    """

    region: BaseGeometry
    projection: Projection
    hole: bool


def shadow_mask(scene: Scene, source: Source) -> Mask:
    """The union of all that casts a shadow (THEORY 2: for a picture, not for the field).

    Left out are bodies that only receive the light, so that a floor does not hide the creature on it: a
    room around the source, and flat bodies behind whose plane nothing lies but other flat ones that
    cross it. Where that leaves nothing, all bodies are in. Holes and masks of a screen are taken alone.
    """
    import shapely

    scene = scene.before(source)
    if scene.screen:
        loops = [loop for outline in scene.screen for loop in outline.world_loops(CORNERS)]
        flat = projection(source, np.concatenate(loops))
        rings = shapely.polygons([shapely.LinearRing(flat(_closed(loop, flat))) for loop in loops])
        # even-odd: a loop within a loop is an island
        region = shapely.Polygon()
        for ring in sorted(rings, key=shapely.area, reverse=True):
            region = shapely.symmetric_difference(region, ring)
        return Mask(region, flat, hole=bool(scene.holes))
    bodies = [body for body in scene.bodies if _casts(body, scene.bodies, source)] or list(scene.bodies)
    shown = [_triangles(body, source) for body in bodies]
    if not shown:
        return Mask(shapely.Polygon(), projection(source, np.empty((0, 3))), hole=False)
    corners = np.concatenate(shown)
    flat = projection(source, corners.reshape(-1, 3))
    if flat.kind == "azimuthal equidistant":
        corners = _refined(corners, flat)
    pictured = flat(corners)
    a, b, c = np.moveaxis(pictured, 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    extent = np.ptp(pictured.reshape(-1, 2), axis=0).max()
    return Mask(shapely.union_all(shapely.polygons(pictured[area > FLAT_TRIANGLE * extent**2])), flat, hole=False)


def _casts(body: Body, bodies: tuple[Body, ...], source: Source) -> bool:
    points = vertices(body.geometry)
    if not is_flat(points):
        return not _surrounds(body, source)
    centre, normal, _ = plane(points)
    away = normal if _side(source, centre, normal) < 0 else -normal  # from the source's side of the plane
    for other in bodies:
        if other is body:
            continue
        heights = (vertices(other.geometry) - centre) @ away
        slack = 1e-6 * np.abs(heights).max(initial=0.0)
        behind, before = heights.max() > slack, heights.min() < -slack
        if behind and not (before and is_flat(vertices(other.geometry))):
            return True
    return False


def _side(source: Source, centre: Reals, normal: Reals) -> float:
    if source.position is not None:
        return float((source.position - centre) @ normal)
    assert source.direction is not None
    return float(-source.direction @ normal)


def _surrounds(body: Body, source: Source) -> bool:
    """Whether a mesh covers more than half of all directions."""
    if source.position is None or not isinstance(body.geometry, Mesh):
        return False
    return abs(solid_angle(body.geometry.vertices, body.geometry.faces, source.position)) > 2 * np.pi * (1 + 1e-6)


def _triangles(body: Body, source: Source) -> Reals:
    """Triangles (m, 3, 3) in space that cover what the body covers, seen from the source."""
    geometry = body.geometry
    if isinstance(geometry, Cylinder):
        geometry = strip(geometry, source, 1e-4 * float(np.linalg.norm(geometry.to_world[:3, :2])))
    if isinstance(geometry, Mesh):
        return geometry.vertices[geometry.faces]
    if isinstance(geometry, Disk):
        loop = _circle() @ geometry.to_world[:3, :2].T + geometry.to_world[:3, 3]
        return _fan(geometry.to_world[:3, 3], loop)
    centre, radius, axis = tangent_circle(geometry, source)
    return _fan(centre, centre + radius * _circle() @ np.stack(across(axis)))


def _circle() -> Reals:
    angle = 2 * np.pi * np.arange(CORNERS) / CORNERS
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _fan(centre: Reals, loop: Reals) -> Reals:
    return np.stack([np.broadcast_to(centre, loop.shape), loop, np.roll(loop, -1, axis=0)], axis=1)


def _closed(loop: Reals, flat: Projection) -> Reals:
    """The loop, its edges split finely where the projection bends them."""
    if flat.kind != "azimuthal equidistant":
        return loop
    t = np.linspace(0, 1, 64, endpoint=False)[:, None]
    following = np.roll(loop, -1, axis=0)
    return np.concatenate([a + t * (b - a) for a, b in zip(loop, following, strict=True)])


def _refined(corners: Reals, flat: Projection) -> Reals:
    """The triangles cut until they look small, smaller near the point behind the axis; that point is left out."""
    source = flat.source.position
    assert source is not None
    done = []
    while len(corners):
        seen = corners - source
        seen = seen / np.linalg.norm(seen, axis=2, keepdims=True)
        size = np.linalg.norm(seen - np.roll(seen, 1, axis=1), axis=2)
        behind = np.pi - np.arccos(np.clip(seen @ flat.axis, -1, 1)).max(axis=1)
        small = size.max(axis=1) <= np.clip(behind / 4, WIDEST_TRIANGLE / 8, WIDEST_TRIANGLE)
        done.append(corners[small & (behind > WIDEST_TRIANGLE / 4)])
        corners, longest = corners[~small], size[~small].argmax(axis=1)
        rows = np.arange(len(corners))
        # size[i] is the edge from corner i-1 to corner i; the third corner is i+1
        p, q, r = (corners[rows, (longest + i) % 3] for i in (-1, 0, 1))
        seen_p, seen_q = (np.linalg.norm(x - source, axis=1, keepdims=True) for x in (p, q))
        middle = (p * seen_q + q * seen_p) / (seen_p + seen_q)  # halves the angle
        corners = np.concatenate([np.stack([p, middle, r], axis=1), np.stack([middle, q, r], axis=1)])
    return np.concatenate(done) if done else np.empty((0, 3, 3))
