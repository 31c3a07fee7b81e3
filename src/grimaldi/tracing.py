"""Camera paths as in Mitsuba's `path`, with the diffracting sources' light added by eq. 3a at every vertex."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from grimaldi.light import Reflected
from grimaldi.scene.sources import diffracts
from grimaldi.syntax import syntax
from grimaldi.variants import end_kernel, on_cuda


class Path(NamedTuple):
    """Radiance along camera rays; U and its error for each key (wavelength, group) at the first surface seen."""

    L: Any
    valid: Any  # whether the ray met anything
    seen: Any  # whether it met a surface that scatters the sources' light
    real: list[Any]
    imag: list[Any]
    error: list[Any]


@syntax
def trace(
    scene: Any,
    sampler: Any,
    ray: Any,
    reflected: Callable[..., Reflected],
    keys: int,
    max_depth: int,
    rr_depth: int,
    hide_emitters: bool,
    active: Any,
) -> Path:
    """Follow rays through a scene to at most `max_depth` segments (-1: no limit).

    Ordinary emitters are sampled one at a time and weighted against BSDF sampling, as in Mitsuba; the diffracting
    ones are all summed at each vertex by `reflected` (`Light.reflected` of `keys` keys, told also which rays are the
    camera's own), since their fields may interfere.
    """
    ordinary = ordinary_emitters(scene)
    limit = 0xFFFFFFFF if max_depth < 0 else max_depth
    goes_further = len(ordinary) > 0 or limit > 2  # sources of waves have no surface that a ray might meet
    # kernels are quicker without a loop; one that is recorded cannot end them
    mode = "scalar" if not goes_further else "evaluated" if on_cuda() else None

    # --------------------- Loop state ----------------------
    ray = mi.Ray3f(ray)
    depth = mi.UInt32(0)
    L = mi.Spectrum(0)
    beta: Any = mi.Spectrum(1)
    eta = mi.Float(1)
    active = mi.Bool(active)
    valid = mi.Bool(False)
    seen = mi.Bool(False)
    real, imag, error = _zeros(keys), _zeros(keys), _zeros(keys)
    si_prev = dr.zeros(mi.SurfaceInteraction3f)
    pdf_prev = mi.Float(1)
    delta_prev = mi.Bool(True)

    again = active if goes_further else True
    while dr.hint(again, mode=mode):
        si = scene.ray_intersect(ray, mi.RayFlags.All, depth == 0, active)
        end_kernel(si)
        bsdf = si.bsdf(ray)

        # ---------------------- Emission ----------------------
        emitter = si.emitter(scene)
        ds = mi.DirectionSample3f(scene, si, si_prev)
        pdf_light = mi.Float(0)
        if ~delta_prev:
            pdf_light = emitter.pdf_direction(si_prev, ds, active) / max(len(ordinary), 1)
        emits = active & (emitter != None)  # noqa: E711 (an array of pointers)
        if dr.hint(hide_emitters, mode="scalar"):
            emits &= depth > 0
        mis = dr.select(delta_prev, 1, _power_heuristic(pdf_prev, pdf_light))
        L[emits] += beta * mis * emitter.eval(si, emits)

        valid |= active & si.is_valid() | (emits & (depth == 0))
        active &= si.is_valid() & (depth + 1 < limit)
        goes_on = mi.Bool(len(ordinary) > 0) | (depth + 2 < limit)  # the last segment meets emitters or nothing
        scatters = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)

        # ---------------------- Diffracting sources ----------------------
        if scatters:
            n = mi.Vector3f(dr.mulsign(si.n, -dr.dot(si.n, ray.d)))
            out = reflected(ray, si, bsdf, n, scatters, depth == 0)
            L += beta * out.L
            first = scatters & ~seen
            real = _where(first, out.real, real)
            imag = _where(first, out.imag, imag)
            error = _where(first, out.error, error)
        seen |= scatters
        end_kernel(L, real, imag, error)

        # ---------------------- Ordinary emitters ----------------------
        if dr.hint(len(ordinary) > 0, mode="scalar"):
            L += beta * ordinary_light(scene, sampler, ordinary, si, bsdf, scatters)

        # ---------------------- BSDF sampling ----------------------
        if dr.hint(goes_further, mode="scalar"):
            bs, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(active), sampler.next_2d(active), active)
            ray = si.spawn_ray(si.to_world(bs.wo))
            beta *= weight
            eta *= bs.eta
            si_prev = si
            pdf_prev = bs.pdf
            delta_prev = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)

        # ---------------------- Stopping ----------------------
        strongest = dr.max(mi.unpolarized_spectrum(beta))
        active &= goes_on & (strongest != 0)
        if dr.hint(limit > rr_depth, mode="scalar"):
            survival = dr.minimum(strongest * eta * eta, 0.95)
            roulette = depth >= rr_depth
            active &= ~roulette | (sampler.next_1d(active) < survival)
            beta[roulette] *= dr.rcp(survival)
        depth += 1
        again = active if goes_further else False

    return Path(L, valid, seen, real, imag, error)


def _zeros(n: int) -> list[Any]:
    return [mi.Float(0) for _ in range(n)]


def _where(mask: Any, new: list[Any], old: list[Any]) -> list[Any]:
    return [dr.select(mask, a, b) for a, b in zip(new, old, strict=True)]


def _power_heuristic(a: Any, b: Any) -> Any:
    """Weight of a sample by the density a when b could have made it too (Veach 1997, §9.2.4)."""
    a2 = a * a
    return dr.select(a > 0, a2 / dr.fma(b, b, a2), 0)


def ordinary_emitters(scene: Any) -> list[int]:
    """Where the emitters that are not sources of waves stand in the scene's list."""
    return [i for i, emitter in enumerate(scene.emitters()) if not diffracts(emitter)]


def ordinary_light(scene: Any, sampler: Any, ordinary: list[int], si: Any, bsdf: Any, active: Any) -> Any:
    """One ordinary emitter's light at a vertex, chosen uniformly, by sampling it."""
    u = sampler.next_2d(active)
    scaled = u.x * len(ordinary)
    choice = dr.minimum(mi.UInt32(scaled), len(ordinary) - 1)
    u.x = scaled - choice
    index = dr.gather(mi.UInt32, mi.UInt32(ordinary), choice, active)
    emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), index, active)
    ds, weight = emitter.sample_direction(si, u, active)
    ds.pdf /= len(ordinary)
    active &= ds.pdf != 0
    active &= ~scene.ray_test(si.spawn_ray_to(ds.p), active)
    wo = si.to_local(ds.d)
    f, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, wo, active)
    mis = dr.select(ds.delta, 1, _power_heuristic(ds.pdf, pdf))
    return dr.select(active, f * weight * (mis * len(ordinary)), 0)
