"""From a scene and a source to the lit outlines of all its bodies, or of its planar holes or masks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from grimaldi.outlines import curvature, cylinder, disk, mesh, planar, sphere
from grimaldi.outlines.candidate import Candidates, toward
from grimaldi.outlines.hidden import Obstacle, Queries, behind, obstacles
from grimaldi.outlines.lit import Stretches, lit_parts
from grimaldi.outlines.model import Integers, Outline, Reals
from grimaldi.scene.bodies import vertices
from grimaldi.scene.model import Body, Cylinder, Geometry, Mesh, Scene, Source, Sphere
from grimaldi.scene.planar import PlanarOutline

LONGEST = 1 / 32  # of the outlines' extent: how finely X→P visibility is told along a straight edge
DEFAULT_SAG = 1e-4  # of a curve's size, where no wavelength sets it
BESIDE = 1e-6  # of the coordinates: how far Float32 vertices of a wall may lie beside it


def outline(scene: Scene, source: Source, *, sag: Sequence[float] | None = None) -> Outline:
    """The lit outlines that `source` sees.

    Args:
        scene: a loaded scene.
        source: one of its sources.
        sag: for each of the scene's bodies, or of its planar outlines, how far the polygon of a smooth outline
            may lie from it [scene units]; 1e-4 of its size by default.

    Returns:
        All lit silhouettes over the full sphere of directions, also those in front of other lit parts
        (THEORY 2); of planar holes and masks the whole loops. Empty where nothing stands in the light.
    """
    if scene.screen:
        return _planar(scene, source, sag or [DEFAULT_SAG * curve(shape)[1] for shape in scene.screen])
    sag = sag or [DEFAULT_SAG * curve(body.geometry)[1] for body in scene.bodies]
    edges, body = edges_of(scene, source, sag)
    if not len(body):
        return Outline.empty()
    extents = np.zeros(len(scene.bodies))
    for i in np.unique(body):
        extents[i] = np.linalg.norm(np.ptp(edges.start[body == i], axis=0))
    standing = obstacles(scene.bodies, source)
    lit = lit_parts(standing, source, edges, body, LONGEST * extents[body])
    coarsest = max((s for b, s in zip(scene.bodies, sag, strict=True) if is_curved(b.geometry)), default=0.0)
    return assemble(
        edges,
        body,
        lit,
        gap_behind(standing, source, edges, body, lit),
        source,
        coarsest,
        curvature.radii(scene.bodies, source, edges, body),
    )


def edges_of(scene: Scene, source: Source, sag: Sequence[float]) -> tuple[Candidates, Integers]:
    """The silhouette edges of a scene's bodies, lit or not, and the body (n,) of each; sag as in `outline`."""
    parts = [_silhouette(body, source, s) for body, s in zip(scene.bodies, sag, strict=True)]
    body = np.repeat(np.arange(len(parts)), [len(part.start) for part in parts])
    return Candidates.concatenate(parts or [Candidates.empty()]), body


def curve(shape: Geometry | PlanarOutline) -> tuple[Reals, float]:
    """Centre (3,) and size of a shape's outline: what the sag of its polygon is measured against."""
    if isinstance(shape, Sphere):
        return shape.centre, shape.radius
    if isinstance(shape, (Mesh, Cylinder)):
        points = vertices(shape)
        low, high = points.min(axis=0), points.max(axis=0)
        return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    return shape.to_world[:3, 3], float(np.linalg.norm(shape.to_world[:3, :2]))


def is_curved(shape: Geometry | PlanarOutline) -> bool:
    """Whether its outline is a polygon in the place of a curve."""
    return shape.is_ellipse if isinstance(shape, PlanarOutline) else not isinstance(shape, Mesh)


def _silhouette(body: Body, source: Source, sag: float) -> Candidates:
    geometry = body.geometry
    if isinstance(geometry, Mesh):
        return mesh.silhouette(geometry, source)
    if isinstance(geometry, Sphere):
        return sphere.silhouette(geometry, source, sag)
    if isinstance(geometry, Cylinder):
        return cylinder.silhouette(geometry, source, sag)
    return disk.silhouette(geometry, source, sag)


def gap_behind(
    standing: tuple[Obstacle, ...], source: Source, edges: Candidates, body: Integers, lit: Stretches
) -> Reals:
    """For each lit stretch, how far behind its middle its own body comes next; a wall along the ray does not."""
    c, at = lit.candidate, 0.5 * (lit.low + lit.high)
    span = edges.end[c] - edges.start[c]
    x = edges.start[c] + at[:, None] * span
    x += BESIDE * np.abs(x).max(initial=0.0) * _outward(source, x, span)
    result = np.full(len(c), np.inf)
    for number, of in enumerate(standing):
        own = body[c] == number
        result[own] = behind(of, source, Queries(x, body[c], edges.faces[c])[own])
    return result


def _planar(scene: Scene, source: Source, sag: Sequence[float]) -> Outline:
    parts, number = [], []
    for i, (shape, s) in enumerate(zip(scene.screen, sag, strict=True)):
        for loop in planar.loops(shape, source, s):
            parts.append(loop)
            number.append(np.full(len(loop.start), -1 - i))
    edges = Candidates.concatenate(parts)
    n = len(edges.start)
    return assemble(edges, np.concatenate(number), Stretches.whole(n), np.full(n, np.inf), source, max(sag))


def assemble(
    edges: Candidates,
    body: Integers,
    lit: Stretches,
    behind: Reals,
    source: Source,
    sag: float,
    radius: Reals | None = None,
) -> Outline:
    """The lit stretches in the order of their chains; radius as in `Outline`, for each edge."""
    c = lit.candidate
    span = edges.end[c] - edges.start[c]
    start = np.where((lit.low > 0)[:, None], edges.start[c] + lit.low[:, None] * span, edges.start[c])
    end = np.where((lit.high < 1)[:, None], edges.start[c] + lit.high[:, None] * span, edges.end[c])
    reach = np.abs(start).max(initial=0.0)
    some = np.linalg.norm(end - start, axis=1) > 1e-13 * reach  # two cuts can fall on one Float64 place
    start, end, c, behind = start[some], end[some], c[some], behind[some]
    order, chain = _chains(start, end)
    start, end, c = start[order], end[order], c[order]
    interval = np.stack([lit.low, lit.high], axis=1)[some][order]
    out = _outward(source, 0.5 * (start + end), end - start)
    outward = np.where((body[c] < 0)[:, None], -out, out)  # a hole's open side is the one its loop encloses
    radius = np.zeros(len(c)) if radius is None else radius[c]
    return Outline(
        start, end, body[c], edges.edge[c], interval, edges.normals[c], outward, behind[order], chain, radius, sag
    )


def _outward(source: Source, x: Reals, span: Reals) -> Reals:
    """Unit vectors (n, 3) across the rays at x, to the right of edges that run along `span` (n, 3)."""
    out = np.cross(span, -toward(source, x))
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)


def _chains(start: Reals, end: Reals) -> tuple[Integers, Integers]:
    """An order in which segments follow each other end to start, and the chain that each then belongs to."""
    n = len(start)
    starting: dict[bytes, list[int]] = {}
    for i in range(n - 1, -1, -1):
        starting.setdefault(start[i].tobytes(), []).append(i)
    ends = {point.tobytes() for point in end}
    # open chains first, from where nothing arrives
    seeds = [i for i in range(n) if start[i].tobytes() not in ends]
    used = np.zeros(n, bool)
    order, chain, number = [], [], 0
    for seed in [*seeds, *range(n)]:
        if used[seed]:
            continue
        i: int | None = seed
        while i is not None:
            used[i] = True
            order.append(i)
            chain.append(number)
            following = starting.get(end[i].tobytes(), [])
            i = next((j for j in following if not used[j]), None)
        number += 1
    return np.array(order, np.int64), np.array(chain, np.int64)
