"""Emitter `coherent_area`: THEORY eq. 2 out of an aperture, eq. 4."""

from __future__ import annotations

from typing import Any

from grimaldi.plugins import parameters


def register(V: Any) -> None:
    """Makes the plugin known to the variant module V (such as `mi.llvm_ad_rgb`)."""
    import drjit as dr
    import mitsuba as mi

    class CoherentArea(V.Emitter):
        r"""
        .. _emitter-coherent_area:

        Coherent area light (:monosp:`coherent_area`)
        ---------------------------------------------

        .. pluginparameters::

         * - amplitude
           - |float|
           - Amplitude A: on the shape the field is A exp(iφ0). (Default: 1)

         * - phase
           - |float|
           - Phase φ0 on the shape, in radians. (Default: 0)

         * - group
           - |string|
           - Coherence group: the fields of one group add before the intensity is taken. (Default: "0")

        Part of a planar shape (rectangle, disk, planar mesh), which sends out a plane wave of uniform phase along its
        normal: an aperture lit from behind. Grimaldi lets it diffract at the shape's border (Kirchhoff); behind the
        shape it is dark. Every other integrator, and the camera, sees a surface that does not glow: a wave that
        leaves in one direction is no radiance that could be sampled.
        """

        plugin_name = "coherent_area"

        def __init__(self, props: Any) -> None:
            V.Emitter.__init__(self, props)
            self.amplitude = V.Float64(parameters.amplitude(props))
            self.phase = V.Float64(parameters.number(props, "phase", 0.0))
            self.group = parameters.group(props)
            dr.make_opaque(self.amplitude, self.phase)
            self.m_flags = mi.EmitterFlags.Surface
            self.m_needs_sample_2 = self.m_needs_sample_3 = False

        def traverse(self, callback: Any) -> None:
            V.Emitter.traverse(self, callback)
            for name in ("amplitude", "phase", "group"):
                callback.put(name, getattr(self, name), mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys: list[str]) -> None:
            dr.make_opaque(self.amplitude, self.phase)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
            return dr.zeros(V.DirectionSample3f), V.Spectrum(0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return V.Spectrum(0.0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return V.Float(0.0)

        def eval(self, si: Any, active: Any = True) -> Any:
            return V.Spectrum(0.0)

        def bbox(self) -> Any:
            return V.ScalarBoundingBox3f()

        def to_string(self) -> str:
            return f"CoherentArea[amplitude={self.amplitude}, phase={self.phase}, group={self.group!r}]"

    V.register_emitter(CoherentArea.plugin_name, CoherentArea)
