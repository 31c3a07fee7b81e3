"""Emitter `coherent_point`: THEORY eq. 1."""

from __future__ import annotations

from typing import Any

import numpy as np

from grimaldi.plugins import parameters


def register(V: Any) -> None:
    """Makes the plugin known to the variant module V (such as `mi.llvm_ad_rgb`)."""
    import drjit as dr
    import mitsuba as mi

    pointer = getattr(V, "EmitterPtr", lambda emitter: emitter)  # scalar variants have plain objects

    class CoherentPoint(V.Emitter):
        r"""
        .. _emitter-coherent_point:

        Coherent point source (:monosp:`coherent_point`)
        ------------------------------------------------

        .. pluginparameters::

         * - position
           - |point|
           - Position S of the source, kept in double precision.

         * - amplitude
           - |float|
           - Amplitude A: at the distance R the field is A exp(iφ0 + ikR) / R. (Default: 1)

         * - phase
           - |float|
           - Phase φ0 in radians. (Default: 0)

         * - group
           - |string|
           - Coherence group: the fields of one group add before the intensity is taken. (Default: "0")

        A monochromatic point source. Grimaldi adds its field to that of the other sources of its group
        and lets it diffract; every other integrator sees a :monosp:`point` light of the radiant
        intensity :math:`A^2`, the same in every colour channel and unpolarized.
        """

        plugin_name = "coherent_point"

        def __init__(self, props: Any) -> None:
            V.Emitter.__init__(self, props)
            self.position = V.Point3d(parameters.vector(props, "position"))
            self.amplitude = V.Float64(parameters.amplitude(props))
            self.phase = V.Float64(parameters.number(props, "phase", 0.0))
            self.group = parameters.group(props)
            dr.make_opaque(self.position, self.amplitude, self.phase)
            self.m_flags = mi.EmitterFlags.DeltaPosition
            self.m_needs_sample_2 = self.m_needs_sample_3 = False

        def traverse(self, callback: Any) -> None:
            V.Emitter.traverse(self, callback)
            for name in ("position", "amplitude", "phase", "group"):
                callback.put(name, getattr(self, name), mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys: list[str]) -> None:
            dr.make_opaque(self.position, self.amplitude, self.phase)

        def _intensity(self) -> Any:
            return V.Float(self.amplitude * self.amplitude)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
            ds = V.DirectionSample3f()
            ds.p = V.Point3f(self.position)
            ds.n = 0.0
            ds.uv = 0.0
            ds.time = it.time
            ds.pdf = 1.0
            ds.delta = True
            ds.emitter = pointer(self)
            ds.d = ds.p - it.p
            ds.dist = dr.norm(ds.d)
            inv_dist = dr.rcp(ds.dist)
            ds.d *= inv_dist
            return ds, V.depolarizer(V.UnpolarizedSpectrum(self._intensity() * dr.square(inv_dist)))

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return V.depolarizer(V.UnpolarizedSpectrum(self._intensity() * dr.rcp(dr.square(ds.dist))))

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return V.Float(0.0)

        def eval(self, si: Any, active: Any = True) -> Any:
            return V.Spectrum(0.0)

        def bbox(self) -> Any:
            return V.ScalarBoundingBox3f(V.ScalarPoint3f(np.array(self.position).reshape(3)))

        def to_string(self) -> str:
            return (
                f"CoherentPoint[position={self.position}, amplitude={self.amplitude}, "
                f"phase={self.phase}, group={self.group!r}]"
            )

    V.register_emitter(CoherentPoint.plugin_name, CoherentPoint)
