"""From a scene and a source to the lit outlines of all its bodies, or of its planar holes or masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from grimaldi.outlines import curvature, cylinder, disk, mesh, planar, sphere
from grimaldi.outlines.candidate import Candidates, toward
from grimaldi.outlines.chains import chains
from grimaldi.outlines.hidden import Sight
from grimaldi.outlines.lines import each, ends, straight
from grimaldi.outlines.lit import Stretches, lit_parts
from grimaldi.outlines.memory import once
from grimaldi.outlines.model import Integers, Outline, Reals
from grimaldi.outlines.pieces import Pieces
from grimaldi.outlines.soup import Soup
from grimaldi.outlines.view import View
from grimaldi.scene.bodies import vertices
from grimaldi.scene.model import Body, Cylinder, Disk, Geometry, Mesh, Scene, Source, Sphere
from grimaldi.scene.planar import PlanarOutline

LONGEST = 1 / 32  # of the outlines' extent: how finely X→P visibility is told along a straight edge
DEFAULT_SAG = 1e-4  # of a curve's size, where no wavelength sets it
BESIDE = 1e-6  # of the coordinates: how far Float32 vertices of a wall may lie beside it


def outline(scene: Scene, source: Source, *, sag: Sequence[float] | None = None, longest: float = LONGEST) -> Outline:
    """The lit outlines that `source` sees.

    Args:
        scene: a loaded scene.
        source: one of its sources.
        sag: for each of the scene's bodies, or of its planar outlines, how far the polygon of a smooth outline
            may lie from it [scene units]; 1e-4 of its size by default.
        longest: no segment of a straight edge is longer than this, of its body's extent.

    Returns:
        All lit silhouettes over the full sphere of directions, also those in front of other lit parts
        (THEORY 2); of planar holes and masks the whole loops. Empty where nothing stands in the light.
    """
    if scene.screen:
        return _planar(scene, source, sag or [DEFAULT_SAG * curve(shape)[1] for shape in scene.screen])
    sag = tuple(sag or default_sags(scene.bodies))
    return once(scene, ("outline", source, sag, longest), lambda: _bodies(scene, source, sag, longest))


def _bodies(scene: Scene, source: Source, sag: Sequence[float], longest: float) -> Outline:
    soup = soup_of(scene)
    edges, body = edges_of(scene, source, sag)
    if not len(body):
        return Outline.empty()
    sight = sight_of(scene.bodies, soup, source, edges, body)
    lit = lit_parts(sight)
    coarsest = max((s for b, s in zip(scene.bodies, sag, strict=True) if is_curved(b.geometry)), default=0.0)
    radius = curvature.radii(scene.bodies, soup, source, edges, body)
    most = longest * _extents(edges.start, body)
    return assemble(edges, body, lit, source, coarsest, radius=radius, longest=most, sight=sight)


def soup_of(scene: Scene) -> Soup:
    """The triangles of a scene's bodies, of facets where they have them."""
    return once(scene, ("soup",), lambda: Soup.of([body.facets or body.geometry for body in scene.bodies]))


def default_sags(bodies: Sequence[Body]) -> list[float]:
    """What curves may be off by where no wavelength says it; meshes have none."""
    return [DEFAULT_SAG * curve(body.geometry)[1] if is_curved(body.geometry) else 0.0 for body in bodies]


def edges_of(scene: Scene, source: Source, sag: Sequence[float]) -> tuple[Candidates, Integers]:
    """The silhouette edges of a scene's bodies, lit or not, and the body (n,) of each, rising; sag as in `outline`."""
    edges, body = once(scene, ("edges", source), lambda: _of_meshes(scene, source))
    parts, owner = [edges], [body]
    for i, (of, s) in enumerate(zip(scene.bodies, sag, strict=True)):
        if not isinstance(of.geometry, Mesh):
            parts.append(_curve(of.geometry, source, s))
            owner.append(np.full(len(parts[-1]), i))
    body = np.concatenate(owner)
    order = np.argsort(body, kind="stable")
    return Candidates.concatenate(parts)[order], body[order]


def _of_meshes(scene: Scene, source: Source) -> tuple[Candidates, Integers]:
    """The silhouette edges of meshes, and the body of each; edges of facets have the names of the mesh's."""
    edges, body = mesh.silhouettes(soup_of(scene), source)
    name = edges.edge.copy()
    for i, of in enumerate(scene.bodies):
        if of.facets is not None:
            own = slice(*np.searchsorted(body, [i, i + 1]))
            name[own] = of.facets.edges.ravel()[name[own]]
    return replace(edges, edge=name), body


def _extents(points: Reals, body: Integers) -> Reals:
    """For each of points (n, 3) the diagonal of the box of all of its body, whose points follow each other."""
    first = np.flatnonzero(np.append(True, np.diff(body) != 0))
    size = np.maximum.reduceat(points, first) - np.minimum.reduceat(points, first)
    return np.repeat(np.linalg.norm(size, axis=1), np.diff(np.append(first, len(body))))


def sight_of(bodies: Sequence[Body], soup: Soup, source: Source, edges: Candidates, body: Integers) -> Sight:
    """What stands before and behind edges, and behind points as far beside them as `gap_behind` asks."""
    view = View.of(source, edges.start)
    reach = max(float(np.abs(x).max(initial=0.0)) for x in (edges.start, edges.end))
    return Sight.of(bodies, soup, view, edges, body, Pieces.of(view, edges, BESIDE * reach))


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


def _curve(geometry: Sphere | Disk | Cylinder, source: Source, sag: float) -> Candidates:
    if isinstance(geometry, Sphere):
        return sphere.silhouette(geometry, source, sag)
    if isinstance(geometry, Cylinder):
        return cylinder.silhouette(geometry, source, sag)
    return disk.silhouette(geometry, source, sag)


def _planar(scene: Scene, source: Source, sag: Sequence[float]) -> Outline:
    parts, number = [], []
    for i, (shape, s) in enumerate(zip(scene.screen, sag, strict=True)):
        for loop in planar.loops(shape, source, s):
            parts.append(loop)
            number.append(np.full(len(loop.start), -1 - i))
    edges = Candidates.concatenate(parts)
    n = len(edges.start)
    return assemble(edges, np.concatenate(number), Stretches.whole(n), source, max(sag))


def assemble(
    edges: Candidates,
    body: Integers,
    lit: Stretches,
    source: Source,
    sag: float,
    *,
    radius: Reals | None = None,
    longest: Reals | None = None,
    sight: Sight | None = None,
) -> Outline:
    """The lit stretches of n edges in the order of their chains.

    radius (n,) as in `Outline`, else 0; longest (n,): mesh edges that go on in one line become one, and then no
    segment longer than this, else each stretch is a segment; sight: what tells how far behind its body comes next.
    """
    start, end = ends(edges, lit)
    # two cuts can fall on one Float64 place
    some = np.linalg.norm(end - start, axis=1) > 1e-13 * np.abs(start).max(initial=0.0)
    order, chain = chains(start[some], end[some])
    lit = lit[np.flatnonzero(some)[order]]
    radius = np.zeros(len(body)) if radius is None else radius
    lines = each(edges, lit) if longest is None else straight(edges, lit, chain, radius, longest)
    start, end, c = lines.start, lines.end, lines.candidate
    out = _outward(source, 0.5 * (start + end), end - start)
    behind = np.full(len(c), np.inf)
    if sight is not None:
        x = edges.at(c, lines.middle)
        behind = sight.behind(
            c, lines.middle, x + BESIDE * np.abs(x).max(initial=0.0) * _outward(source, x, end - start)
        )
    outward = np.where((body[c] < 0)[:, None], -out, out)  # a hole's open side is the one its loop encloses
    return Outline(
        start,
        end,
        body[c],
        lines.edge,
        lines.interval,
        edges.normals[c],
        outward,
        behind,
        chain[lines.stretch],
        radius[c],
        sag,
    )


def _outward(source: Source, x: Reals, span: Reals) -> Reals:
    """Unit vectors (n, 3) across the rays at x, to the right of edges that run along `span` (n, 3)."""
    out = np.cross(span, -toward(source, x))
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)
