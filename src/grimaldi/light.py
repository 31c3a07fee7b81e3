"""The light of all sources at a surface: fields within a group add, then intensities (THEORY eq. 3a)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from grimaldi.camera import seen
from grimaldi.coherence import groups, separated
from grimaldi.conventions import parse_wavelengths
from grimaldi.diffraction import model
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import boundary
from grimaldi.diffraction.frame import toward
from grimaldi.diffraction.model import Evaluate, Factor, Receivers
from grimaldi.diffraction.none import none
from grimaldi.engine.asking import Recordings
from grimaldi.engine.hits import Hits, hits
from grimaldi.engine.judging import Shares
from grimaldi.errors import InputError
from grimaldi.options import Settings
from grimaldi.outlines.memory import once
from grimaldi.propagate import Wave, carrier, factor
from grimaldi.scene.bodies import vertices
from grimaldi.scene.model import Scene, Source
from grimaldi.syntax import syntax

INTERPOLATED = 0.1, 5e-4, 0.037  # of a strict tolerance, at most; then of a loose one (`_shares`)
MOST = 0.5  # of the tolerance, to interpolation
RAYS = 0.08, 0.012  # of the tolerance, and at most: |M - M of a ray|, where pictures show a ray's
ROUNDINGS = 12  # of Float32, of the largest coordinate: what Mitsuba's points are off by, and paths to them
PHASE = 0.125  # of the tolerance, that they may be in phase


class Beam(NamedTuple):
    """One source at one wavelength: its place in `Light.keys`, M at receivers, U from M there, and M as recorded."""

    source: Source
    key: int
    factor: Evaluate
    times: Callable[[Receivers, Factor], Wave]
    recordings: Recordings


@dataclass(frozen=True, eq=False)
class Light:
    """All beams of a scene; `keys` are the pairs (wavelength, group) whose intensities add."""

    scene: Scene
    hits: Hits
    beams: tuple[Beam, ...]
    keys: tuple[tuple[float, str], ...]
    shares: tuple[Shares, ...]  # for each beam, what may be left of M over the film; none where M is always asked for
    asks: bool  # whether the model does more for M than to trace a ray
    rounding: float | None  # rad, of U's phase at Mitsuba's own points, where that is within the tolerance

    def select(self, names: tuple[str, ...]) -> list[int]:
        """Where the groups called `names` stand in `keys`, at the first wavelength."""
        present = [group for _, group in self.keys]
        for name in names:
            if name not in present:
                raise InputError(f"wave: groups names {name!r}; the scene has {', '.join(dict.fromkeys(present))}")
        return [present.index(name) for name in names]

    def reflected(
        self,
        ray: Any,
        si: Any,
        bsdf: Any,
        n: Any,
        active: Any,
        known: Sequence[tuple[Factor, Any | None]] = (),
    ) -> Reflected:
        """Eq. 3a where rays met surfaces: radiance back along them, and U of each key.

        known: M of each beam, and where it holds (None: wherever it is needed); elsewhere the model is asked.
        """
        asks = not known or any(holds is not None for _, holds in known)
        rounding = None if asks else self.rounding
        p = self.hits.point(ray, si, active) if rounding is None else si.p
        receivers = Receivers(p, n, active)
        context = mi.BSDFContext()
        real, imag, error = ([mi.Float(0)] * len(self.keys) for _ in range(3))
        amplitudes = [(mi.UnpolarizedSpectrum(0), mi.UnpolarizedSpectrum(0)) for _ in self.keys]
        for i, beam in enumerate(self.beams):
            m, holds = known[i] if known else (beam.factor(receivers), None)
            if holds is not None:
                m = _unless(m, holds, beam, receivers)
            u = beam.times(receivers, m)
            wo = si.to_local(toward(beam.source, si.p))
            f = mi.unpolarized_spectrum(bsdf.eval(context, si, wo, active))
            weight = dr.sqrt(dr.maximum(f, 0) * _tint(beam.source))
            k = beam.key
            re, im = amplitudes[k]
            amplitudes[k] = (
                dr.fma(weight, u.real, re),
                dr.fma(weight, u.imag, im),
            )
            off = u.error if rounding is None else dr.fma(u.free, dr.opaque(mi.Float, rounding), u.error)
            real[k], imag[k], error[k] = real[k] + u.real, imag[k] + u.imag, error[k] + off
        L = sum((re * re + im * im for re, im in amplitudes), mi.UnpolarizedSpectrum(0))
        return Reflected(L, real, imag, error)


@syntax
def _unless(m: Factor, holds: Any, beam: Beam, receivers: Receivers) -> Factor:
    """M where it holds, the model's elsewhere."""
    F = mi.Float
    real, imag, error = F(m.real), F(m.imag), F(m.error)
    asked = receivers.active & ~holds
    if asked:
        own = beam.factor(receivers._replace(active=asked))
        real, imag, error = F(own.real), F(own.imag), F(own.error)
    return Factor(real, imag, error)


class Reflected(NamedTuple):
    """Radiance, and for each key U and its error, at surface interactions."""

    L: Any
    real: list[Any]
    imag: list[Any]
    error: list[Any]


def prepare(scene: Scene, settings: Settings) -> Light:
    """Find each source's outlines for what the scene's cameras see; the result is pure data and functions of points.

    Raises InputError where the wavelength is missing or wrong.
    """
    if settings.wavelength is None:
        raise InputError(f"{scene.name}: no wavelength; give one, such as wavelength=0.5 in scene units")
    wavelengths = parse_wavelengths(settings.wavelength, settings.scene_unit or scene.unit)
    options = settings.options()
    chosen = model(settings.diffraction)
    where = np.concatenate([seen(scene, sensor).points for sensor in scene.mitsuba.sensors()])
    sources = scene.sources if settings.interference else separated(scene.sources)
    keys = tuple((wavelength, group) for wavelength in wavelengths for group in groups(sources))
    of = settings.diffraction, options, blake2b(where.tobytes(), digest_size=16).digest()

    def made(wavelength: float, source: Source) -> Beam:
        k = 2 * np.pi / wavelength
        return Beam(
            source,
            keys.index((wavelength, source.group)),
            factor(scene, source, chosen, k, options, where),
            carrier(source, k, types(double=False)),
            once(scene, ("recordings", source, k, *of), Recordings),
        )

    beams = tuple(made(wavelength, source) for wavelength in wavelengths for source in sources)
    interpolates = options.fast and chosen is boundary
    shares = tuple(_shares(beams, beam, options.tolerance) for beam in beams) if interpolates else ()
    rounding = 2 * np.pi / min(wavelengths) * ROUNDINGS * 2.0**-24 * _reach(scene)
    within = rounding if rounding <= PHASE * options.tolerance else None
    return Light(scene, hits(scene), beams, keys, shares, chosen is not none, within)


def _reach(scene: Scene) -> float:
    """The largest coordinate of surfaces, sources and cameras."""
    where = [vertices(surface) for surface in scene.surfaces if surface is not None]
    where += [source.position for source in scene.sources if source.position is not None]
    where += [np.array(sensor.world_transform().translation()).T for sensor in scene.mitsuba.sensors()]
    return max(float(np.abs(x).max()) for x in where)


def _shares(beams: Sequence[Beam], beam: Beam, tolerance: float) -> Shares:
    """What may be left of a beam's M: less of loose tolerances to interpolation, which fringes are below."""
    strict, most, loose = INTERPOLATED
    alone = sum(other.key == beam.key for other in beams) == 1
    missed = max(min(strict * tolerance, most), loose * tolerance)
    rays = min(RAYS[0] * tolerance, RAYS[1])
    return Shares(missed, MOST * tolerance, rays, 0.0 if alone else 1.0)


def _tint(source: Source) -> Any:
    """The light's colour as a weight of the channels."""
    if dr.size_v(mi.UnpolarizedSpectrum) == 1:
        return mi.UnpolarizedSpectrum(1)
    return mi.UnpolarizedSpectrum(*source.tint)
