"""Emitter `coherent_directional`: THEORY eq. 2."""

from __future__ import annotations

from typing import Any

from grimaldi.errors import InputError
from grimaldi.plugins import parameters

# Mitsuba tells Python emitters nothing of the scene's size: far enough for any shadow ray, in Float32.
FAR = 1e8


def register(V: Any) -> None:
    """Makes the plugin known to the variant module V (such as `mi.llvm_ad_rgb`)."""
    import drjit as dr
    import mitsuba as mi

    pointer = getattr(V, "EmitterPtr", lambda emitter: emitter)  # scalar variants have plain objects

    class CoherentDirectional(V.Emitter):
        r"""
        .. _emitter-coherent_directional:

        Coherent plane wave (:monosp:`coherent_directional`)
        ----------------------------------------------------

        .. pluginparameters::

         * - direction
           - |vector|
           - Direction d into which the wave travels, of any length but 0, kept in double precision.

         * - amplitude
           - |float|
           - Amplitude A: at P the field is A exp(iφ0 + ik d·P). (Default: 1)

         * - phase
           - |float|
           - Phase φ0 at the origin, in radians. (Default: 0)

         * - group
           - |string|
           - Coherence group: the fields of one group add before the intensity is taken. (Default: "0")

        A monochromatic plane wave. Grimaldi adds its field to that of the other sources of its group and
        lets it diffract; every other integrator sees a :monosp:`directional` light of the irradiance
        :math:`A^2`, the same in every colour channel and unpolarized. Light tracers (:monosp:`ptracer`)
        cannot sample it.
        """

        plugin_name = "coherent_directional"

        def __init__(self, props: Any) -> None:
            V.Emitter.__init__(self, props)
            direction = parameters.vector(props, "direction")
            if not any(direction):
                raise InputError("coherent_directional: direction is zero; give the way the wave travels")
            self.direction = V.Vector3d(direction)
            self.amplitude = V.Float64(parameters.amplitude(props))
            self.phase = V.Float64(parameters.number(props, "phase", 0.0))
            self.group = parameters.group(props)
            dr.make_opaque(self.direction, self.amplitude, self.phase)
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.DeltaDirection
            self.m_needs_sample_2 = self.m_needs_sample_3 = False

        def traverse(self, callback: Any) -> None:
            V.Emitter.traverse(self, callback)
            for name in ("direction", "amplitude", "phase", "group"):
                callback.put(name, getattr(self, name), mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys: list[str]) -> None:
            dr.make_opaque(self.direction, self.amplitude, self.phase)

        def _irradiance(self) -> Any:
            return V.depolarizer(V.UnpolarizedSpectrum(V.Float(self.amplitude * self.amplitude)))

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
            d = V.Vector3f(dr.normalize(self.direction))
            ds = V.DirectionSample3f()
            ds.dist = FAR * (1 + dr.norm(it.p))
            ds.p = it.p - d * ds.dist
            ds.n = d
            ds.uv = 0.0
            ds.time = it.time
            ds.pdf = 1.0
            ds.delta = True
            ds.emitter = pointer(self)
            ds.d = -d
            return ds, self._irradiance()

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return self._irradiance()

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return V.Float(0.0)

        def eval(self, si: Any, active: Any = True) -> Any:
            return V.Spectrum(0.0)

        def bbox(self) -> Any:
            return V.ScalarBoundingBox3f()

        def to_string(self) -> str:
            return (
                f"CoherentDirectional[direction={self.direction}, amplitude={self.amplitude}, "
                f"phase={self.phase}, group={self.group!r}]"
            )

    V.register_emitter(CoherentDirectional.plugin_name, CoherentDirectional)
