"""What blocks S→P, and what blocks X→P (THEORY 2, "Which outlines, and what blocks X→P")."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction.arrays import on_device
from grimaldi.diffraction.frame import constant, toward
from grimaldi.diffraction.table import Piece
from grimaldi.scene.model import Mesh, Scene, Source, Sphere
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

GRAZING = 1e-3  # rad: Float32 rays along a face at x hit it or not, as rounding goes


class Rays(NamedTuple):
    """Visibility rays among the bodies of one scene, for one source."""

    blockers: Any
    source: Source
    extent: float  # the largest coordinate of bodies and source
    sag: float  # how far the outline may lie from its body

    def epsilon(self, p: Any) -> Any:
        """What Float32 coordinates on a ray from p cannot tell apart, with room [scene units]."""
        return 4e-6 * dr.maximum(dr.max(dr.abs(p)), on_device(mi.Float, self.extent))

    def clear(self, origin: Any, target: Any, active: Any) -> Any:
        """Whether nothing stands on origin→target."""
        d = target - origin
        end = 1 - self.epsilon(origin) / dr.norm(d)
        return ~self.blockers.ray_test(mi.Ray3f(origin, d, end, 0, mi.Color0f()), active)

    def lit(self, p: Any, active: Any) -> Any:
        """Whether nothing stands between points and the source; in a corner two surfaces meet at p."""
        origin = p + self.epsilon(p) * toward(self.source, p)
        if self.source.position is not None:
            return self.clear(origin, constant(mi.Point3f, self.source.position), active)
        return ~self.blockers.ray_test(mi.Ray3f(origin, toward(self.source, origin)), active)

    @syntax
    def reaches(self, x: Any, piece: Piece, p: Any, active: Any) -> Any:
        """Whether the wave from x on an outline piece reaches p.

        A last stretch of p→x that runs inside the body ending at x does not block: a smooth body's own bulge
        always stands there. Inside means behind both faces at x, no surface between the first hit and x, and
        not further than where the body's next lit part begins behind x; the border of a sheet has no inside.
        """
        d = x - p
        length = dr.norm(d)
        d = d / length
        epsilon = self.epsilon(p)
        depth = dr.minimum(dr.dot(piece.lit, d), dr.dot(piece.dark, d))  # sine of the angle below the faces at x
        # the body's own surface at x: what lies across the ray counts the more along it the more it grazes
        across = 2 * on_device(mi.Float, self.sag) + 0.25 * epsilon
        margin = dr.minimum(4 * epsilon + across / dr.maximum(dr.abs(depth), GRAZING), 0.5 * length)
        end = length - margin
        hit = self.blockers.ray_intersect_preliminary(
            mi.Ray3f(p + epsilon * d, d, dr.maximum(end - epsilon, 0), 0, mi.Color0f()), active=active
        )
        blocked = hit.is_valid()
        left = end - epsilon - hit.t
        inside = (piece.closed > 0.5) & (depth > 0) & (left < piece.behind)
        blocked &= (piece.closed < 0.5) | (dr.abs(depth) > GRAZING) | (left > 8 * piece.reach)
        if active & blocked & inside:
            start = end - left + margin
            more = end > start  # a ray of negative length would count as blocked
            blocked = more & self.blockers.ray_test(
                mi.Ray3f(p + start * d, d, dr.maximum(end - start, 0), 0, mi.Color0f()), active & more
            )
        return ~blocked


def extent(scene: Scene, source: Source) -> float:
    """The largest coordinate of the bodies and the source."""
    reach = 0.0 if source.position is None else float(np.abs(source.position).max())
    for body in scene.bodies:
        g = body.geometry
        if isinstance(g, Mesh):
            far = float(np.abs(g.vertices).max())
        elif isinstance(g, Sphere):
            far = float(np.abs(g.centre).max()) + g.radius
        else:
            far = float(np.abs(g.to_world[:3]).sum(1).max())
        reach = max(reach, far)
    return reach


def rays(scene: Scene, source: Source, sag: float = 0.0) -> Rays:
    """Visibility rays for one source of a scene that has bodies, towards outlines that lie within `sag` of them."""
    return Rays(scene.blockers, source, extent(scene, source), sag)


def surface_normals(scene: Scene, source: Source) -> Callable[[Any], Any]:
    """A function of points: the unit normal, towards the source, of the body surface they lie on; 0 elsewhere."""
    if scene.blockers is None:
        return lambda p: dr.zeros(mi.Vector3f, dr.width(p))
    probe = rays(scene, source)

    def normals(p: Any) -> Any:
        """What a short ray from the source's side runs into."""
        x = mi.Point3f(p)
        w = toward(source, x)
        reach = 4 * probe.epsilon(x)
        hit = scene.blockers.ray_intersect(mi.Ray3f(x + reach * w, -w, 2 * reach, 0, mi.Color0f()))
        n = dr.mulsign(mi.Vector3f(hit.n), dr.dot(hit.n, w))
        return dr.select(hit.is_valid(), n, 0)

    return normals
