"""Geometrical optics: M is 1 in the light and 0 in the shadow."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba

from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.edges import planar_count
from grimaldi.diffraction.frame import constant, frame
from grimaldi.diffraction.model import Evaluate, Factor, Options, Receivers
from grimaldi.diffraction.screen import beyond
from grimaldi.diffraction.table import packed
from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Scene, Source

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for


def none(scene: Scene, source: Source, outline: Outline, k: float, options: Options) -> Evaluate:
    """The `none` model: one shadow ray to the source as Mitsuba traces it, or what a planar hole lets through.

    Raises InputError in variants without vectorised arrays.
    """
    if scene.screen:
        return _planar(scene, source, outline)

    def evaluate(receivers: Receivers) -> Factor:
        zero = types(double=False).Float(0)
        lit = _lit(scene, source, receivers) if scene.blockers is not None else receivers.active
        return Factor(dr.select(lit, 1.0, zero), zero, zero)

    return evaluate


def _lit(scene: Scene, source: Source, receivers: Receivers) -> Any:
    """Mitsuba's own shadow ray (`SurfaceInteraction.spawn_ray_to`), so that `none` equals its `direct`."""
    p = mi.Point3f(receivers.p)
    lift = (1 + dr.max(dr.abs(p))) * mi.math.RayEpsilon
    if source.position is None:
        assert source.direction is not None
        d = constant(mi.Vector3f, -source.direction)
        origin = p + dr.mulsign(lift, dr.dot(receivers.n, d)) * receivers.n
        return ~scene.blockers.ray_test(mi.Ray3f(origin, d), receivers.active)
    target = constant(mi.Point3f, source.position)
    origin = p + dr.mulsign(lift, dr.dot(receivers.n, target - p)) * receivers.n
    d = target - origin
    distance = dr.norm(d)
    ray = mi.Ray3f(origin, d / distance, distance * (1 - mi.math.ShadowEpsilon), 0, mi.Color0f())
    return ~scene.blockers.ray_test(ray, receivers.active)


def _planar(scene: Scene, source: Source, outline: Outline) -> Evaluate:
    tab = packed(outline, source).on(types(double=True))
    far = beyond(scene.screen[0], source)

    def evaluate(receivers: Receivers) -> Factor:
        shaded = receivers.active & far(receivers.p)
        n = planar_count(frame(source, receivers.p, tab), tab, shaded)
        passed = n if scene.screen[0].hole else 1 - n
        zero = tab.types.Float(0)
        return Factor(dr.select(shaded, passed, 1), zero, zero)

    return evaluate
