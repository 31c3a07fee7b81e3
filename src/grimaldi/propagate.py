"""One source's light at points: its outlines, the model's M along them, U = U0 M. Shared by `field` and `wave`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from grimaldi.diffraction.arrays import Types, types
from grimaldi.diffraction.boundary import boundary
from grimaldi.diffraction.curves import phase_allowed
from grimaldi.diffraction.frame import incident
from grimaldi.diffraction.fresnel_plane import fresnel_plane
from grimaldi.diffraction.hierarchy import morton
from grimaldi.diffraction.model import Evaluate, Factor, Model, Options, Receivers
from grimaldi.diffraction.none import none
from grimaldi.diffraction.planes import planes
from grimaldi.diffraction.reach import reach
from grimaldi.diffraction.screen import beyond
from grimaldi.engine.points import Part, at_points
from grimaldi.outlines.candidate import least_sag
from grimaldi.outlines.extract import LONGEST, curve, is_curved, outline
from grimaldi.outlines.model import Outline, Reals
from grimaldi.scene.model import Mesh, Scene, Source

FINELY = 5e-3  # tolerance up to which X→P visibility is told as finely as anywhere along straight edges
COARSEST = 16.0  # times looser ones and more, at which it is told by the root of that as coarsely


class Wave(NamedTuple):
    """U, |U_computed - U| and |U0| at receivers, as Dr.Jit arrays."""

    real: Any
    imag: Any
    error: Any
    free: Any


def propagate(
    scene: Scene, source: Source, model: Model, k: float, options: Options, where: Reals
) -> Callable[[Receivers], Wave]:
    """Find what stands in the source's light; return U (eq. 1-2 times M) as a function of receivers.

    k: wavenumber [1/scene unit]; where (n, 3): some of the points where the field will be asked. The function is
    pure and can be traced inside a larger kernel.
    """
    return _wave(source, k, factor(scene, source, model, k, options, where))


def factor(scene: Scene, source: Source, model: Model, k: float, options: Options, where: Reals) -> Evaluate:
    """M alone, as `propagate` finds it."""
    scene = scene.before(source)
    if model is none and not scene.screen:  # shadow rays need no outlines
        return none(scene, source, Outline.empty(), k, options)
    sags, detour = _sags(scene, source, phase_allowed(scene, options.tolerance) / k, where)
    longest = LONGEST * min(max(options.tolerance / FINELY, 1.0), COARSEST) ** 0.5
    seen = replace(outline(scene, source, sag=sags, longest=longest), detour=detour)
    if model is boundary:
        seen = replace(seen, far=reach(scene, source, seen, k, options, where))
    return model(scene, source, seen, k, options)


def propagate_all(
    scene: Scene, source: Source, model: Model, k: float, options: Options, points: Reals
) -> Iterator[Part]:
    """U of one source at all points (n, 3), in parts.

    Points behind planar holes or masks that one transform serves go first (`fresnel_plane`), if the model is
    `boundary` and `options.fast`; then the others, block by block.
    """
    left = np.ones(len(points), bool)
    if options.fast and model is boundary:
        before = scene.before(source)
        for group in planes(before, source, points):
            p = points[group.which]
            evaluate = fresnel_plane(before, source, k, options, p, group.lattice)
            if evaluate is not None:
                (part,) = at_points(_wave(source, k, evaluate), scene, source, p, block=len(p))
                yield part._replace(which=group.which)
                left[group.which] = False
    rest = np.flatnonzero(left)
    if len(rest):
        if not scene.before(source).screen:  # rays to neighbours go the same ways
            rest = rest[np.argsort(morton(points[rest]), kind="stable")]
        wave = propagate(scene, source, model, k, options, points[rest])
        for part in at_points(wave, scene, source, points[rest]):
            yield part._replace(which=rest[part.which])


def _wave(source: Source, k: float, evaluate: Evaluate) -> Callable[[Receivers], Wave]:
    times = carrier(source, k, types(double=True))
    return lambda receivers: times(receivers, evaluate(receivers))


def carrier(source: Source, k: float, precision: Types) -> Callable[[Receivers, Factor], Wave]:
    """What makes U of M: U0 at receivers, times it, in one precision or the other."""
    ahead = None if source.aperture is None else beyond(source.aperture, source)

    def times(receivers: Receivers, m: Factor) -> Wave:
        modulus, cos, sin = incident(source, receivers.p, k, precision)
        if ahead is not None:
            modulus = dr.select(ahead(receivers.p), modulus, 0)
        F = precision.Float
        re, im = F(m.real), F(m.imag)
        return Wave(modulus * (cos * re - sin * im), modulus * (cos * im + sin * re), modulus * F(m.error), modulus)

    return times


def _sags(scene: Scene, source: Source, path: float, where: Reals) -> tuple[list[float], float]:
    """How coarse each curve's polygon may be for Δ to err by `path` at points `where`, and by what it will; meshes: 0.

    Across the ray |∇Δ| <= d (1/z1 + 1/z2), d the distance of the outline from it, and never more than 2.
    """
    sags, detour = [], 0.0
    for shape in scene.screen or [body.geometry for body in scene.bodies]:
        if isinstance(shape, Mesh):
            sags.append(0.0)
            continue
        centre, radius = curve(shape)
        if source.position is None:
            assert source.direction is not None
            z1, a = np.inf, np.broadcast_to(source.direction, where.shape)
        else:
            z1 = max(float(np.linalg.norm(centre - source.position)) - radius, 0.5 * radius)
            a = where - source.position
            a = a / np.maximum(np.linalg.norm(a, axis=1, keepdims=True), 1e-300)
        v = where - centre
        d = np.linalg.norm(v - np.einsum("ij,ij->i", v, a)[:, None] * a, axis=1) + radius
        z2 = np.maximum(np.linalg.norm(v, axis=1) - radius, 0.5 * radius)
        slope = min(float((d * (1 / z1 + 1 / z2)).max(initial=0.0)), 2.0)
        sags.append(min(path / max(slope, 1e-3), 0.01 * radius))
        if is_curved(shape):
            detour = max(detour, slope * max(sags[-1], least_sag(radius)))
    return sags, float(detour)
