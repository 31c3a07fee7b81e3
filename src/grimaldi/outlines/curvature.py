"""How a body's surface curves where a source's light touches it: the radius that decides how its edge wave creeps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from grimaldi.outlines.candidate import Candidates, toward
from grimaldi.outlines.model import Integers, Reals
from grimaldi.outlines.soup import Soup, grouped
from grimaldi.scene.model import Body, Cylinder, Source, Sphere

CREASE = np.radians(30)  # the angle between two faces' normals from which their edge is meant to be sharp


def radii(bodies: Sequence[Body], soup: Soup, source: Source, edges: Candidates, body: Integers) -> Reals:
    """ρ (n,) of the surface along the light at silhouette edges [scene units]; 0 at rims, borders and creases.

    Exact for spheres and cylinders. Of a mesh it is that of the sphere which holds the corners of both faces
    beside the edge: exact where the mesh's corners lie on a sphere or, in strips, on a cylinder.
    """
    result = np.zeros(len(body))
    folds = np.flatnonzero(np.linalg.norm(edges.normals[:, 1], axis=1) > 0)
    meshed = folds[edges.faces[folds, 0] >= 0]
    result[meshed] = _of_mesh(soup, edges[meshed])
    smooth = folds[edges.faces[folds, 0] < 0]
    for i, which in grouped(body[smooth]):
        own = smooth[which]
        shape = bodies[i].geometry
        if isinstance(shape, Sphere):
            result[own] = shape.radius
        elif isinstance(shape, Cylinder):
            result[own] = _of_tube(shape, source, 0.5 * (edges.start + edges.end)[own])
    return result


def _of_tube(tube: Cylinder, source: Source, x: Reals) -> Reals:
    """|∇f| / w·H w of f = (x² + y²)/2 in the tube's own coordinates, along the light w (unit) at points of its wall."""
    inverse = np.linalg.inv(tube.to_world)
    place = (x @ inverse[:3, :3].T + inverse[:3, 3]) * [1, 1, 0]
    w = toward(source, x)
    w = w / np.linalg.norm(w, axis=1, keepdims=True) @ inverse[:3, :3].T
    return np.linalg.norm(place @ inverse[:3, :3], axis=1) / np.maximum((w[:, :2] ** 2).sum(1), 1e-300)


def _of_mesh(soup: Soup, edges: Candidates) -> Reals:
    """By the distance of the two faces' circumcentres, which lie right below where the sphere is parallel to them."""
    lit, dark = np.moveaxis(edges.normals, 1, 0)
    first, second = (_circumcentre(soup.triangles(faces).T) for faces in edges.faces.T)
    angle = np.arctan2(np.linalg.norm(np.cross(lit, dark), axis=1), (lit * dark).sum(1))
    radius = np.linalg.norm(second - first, axis=1) / np.maximum(2 * np.tan(0.5 * angle), 1e-12)
    return np.where(angle < CREASE, radius, 0.0)


def _circumcentre(corners: Reals) -> Reals:
    """(n, 3) of triangles (n, 3, 3)."""
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(u, v)
    uu, vv, nn = ((p * p).sum(1, keepdims=True) for p in (u, v, normal))
    return a + (vv * np.cross(normal, u) + uu * np.cross(v, normal)) / np.maximum(2 * nn, 1e-300)
