"""BSDF `aperture`: a hole in an opaque screen, THEORY eq. 4."""

from __future__ import annotations

from typing import Any


def register(V: Any) -> None:
    """Makes the plugin known to the variant module V (such as `mi.llvm_ad_rgb`)."""
    import drjit as dr
    import mitsuba as mi

    class Aperture(V.BSDF):
        r"""
        .. _bsdf-aperture:

        Aperture (:monosp:`aperture`)
        -----------------------------

        This plugin has no parameters.

        Turns a planar shape (rectangle, disk, planar mesh) into a hole in an infinite opaque screen that
        lies in the shape's plane; several coplanar ones are holes of one screen. Light from Grimaldi's
        sources reaches the far side through the holes only, with diffraction.

        The screen itself is not drawn: the hole passes camera rays straight on, as the :monosp:`null`
        BSDF does, and the rest of the screen is no surface at all. Shadow rays of Mitsuba's own
        integrators stop at the shape, as they do at :monosp:`null`.
        """

        plugin_name = "aperture"

        def __init__(self, props: Any) -> None:
            V.BSDF.__init__(self, props)
            flags = mi.BSDFFlags.Null | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [flags]
            self.m_flags = flags

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            bs = dr.zeros(V.BSDFSample3f)
            if not ctx.is_enabled(mi.BSDFFlags.Null, 0):
                return bs, V.Spectrum(0.0)
            bs.wo = -si.wi
            bs.sampled_type = V.UInt32(+mi.BSDFFlags.Null)
            bs.eta = 1.0
            bs.pdf = 1.0
            return bs, V.Spectrum(1.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return V.Spectrum(0.0)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return V.Float(0.0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return V.Spectrum(0.0), V.Float(0.0)

        def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
            return V.Spectrum(1.0)

        def to_string(self) -> str:
            return "Aperture[]"

    V.register_bsdf(Aperture.plugin_name, Aperture)
