"""Integrator `wave`: direct light by eq. 3a at what the camera sees, everything else as Mitsuba's `path`."""

from __future__ import annotations

from typing import Any

from grimaldi.plugins import parameters


def register(V: Any) -> None:
    """Makes the plugin known to the variant module V (such as `mi.llvm_ad_rgb`)."""

    class Wave(V.SamplingIntegrator):
        r"""
        .. _integrator-wave:

        Wave integrator (:monosp:`wave`)
        --------------------------------

        .. pluginparameters::

         * - wavelength
           - |float| or |string|
           - Wavelength in scene units, or text with a unit ("532 nm"); several as text, "450 nm, 550 nm", whose
             intensities add. Needed as soon as something is rendered.

         * - scene_unit
           - |string|
           - Length of one scene unit, such as "1 um"; needed where the wavelength has a unit.

         * - diffraction
           - |string|
           - "boundary", Kirchhoff's integral along the outlines; "huygens", sources along silhouettes; "area", brute
             force; or "none", rays. (Default: "boundary")

         * - interference
           - |bool|
           - Whether the fields of one coherence group add; if not, each source is its own group. (Default: true)

         * - tolerance
           - |float|
           - Error allowed in M = U/U0, for each source and point. (Default: 1e-3)

         * - precision
           - |string|
           - "auto" or "double". (Default: "auto")

         * - occlusion
           - |bool| or |string|
           - How bodies block the way from an outline to a surface: true or "graded", by Fresnel's factor where it
             grazes another silhouette (model "boundary"); "binary", by yes or no; false or "none", not at all.
             (Default: true)

         * - rim
           - |string|
           - How the model "boundary" takes the rims of smooth bodies: "sharp", as black screens, or "smooth", with
             waves into the shadow damped like creeping waves. (Default: "sharp")

         * - n
           - |int| or |string|
           - Of the models "huygens" and "area": sources an edge ("nyquist": half a wavelength apart), or samples a
             point. (Default: 3 an edge; quadrature)

         * - weights
           - |string|
           - Of the model "huygens": "report", "length" or "kernel". (Default: "report")

         * - epsilon
           - |float|
           - Of the model "huygens" with the weights "report": how far beside an edge its silhouette test looks, in
             scene units. (Default: 2e-4 of the body's size)

         * - max_depth
           - |int|
           - Longest path from the camera; 2 is direct light, -1 no limit. (Default: 2)

         * - rr_depth
           - |int|
           - Path length from which Russian roulette may end a path. (Default: 5)

         * - hide_emitters
           - |bool|
           - Whether the camera does not see emitters directly. (Default: false)

         * - coherent
           - |string|
           - Ids of :monosp:`point`, :monosp:`directional` and :monosp:`spot` lights that join coherence group "0",
             separated by commas; each is a group of its own otherwise. (Default: none)

         * - groups
           - |string|
           - Coherence groups whose fields U.<group>.re and U.<group>.im become AOVs, separated by commas.
             (Default: none)

        Light of the sources that diffract adds by THEORY eq. 3a at every surface the camera sees, also in mirrors
        and through glass. One wavelength has one hue: each light keeps its own colour as a weight of the channels,
        and a surface its reflectance in each. All other emitters are ordinary light. With diffraction "none"
        and interference off this is Mitsuba's :monosp:`direct` (`max_depth` 2) or :monosp:`path`.

        The film's and sampler's own ways are kept. For pictures that do not depend on the number of threads or on
        tiling, and for the complex layers, use `grimaldi.render`.
        """

        def __init__(self, props: Any) -> None:
            V.SamplingIntegrator.__init__(self, props)
            from grimaldi.light_of import LightOf
            from grimaldi.options import Settings

            self.max_depth = parameters.depth(props, "max_depth", 2, least=0)
            self.rr_depth = parameters.depth(props, "rr_depth", 5, least=1)
            self.hidden = bool(props.get("hide_emitters", False))
            self.groups = parameters.names(props, "groups")
            settings = Settings(
                wavelength=props.get("wavelength", None),
                scene_unit=props.get("scene_unit", None),
                diffraction=str(props.get("diffraction", "boundary")),
                interference=bool(props.get("interference", True)),
                tolerance=parameters.number(props, "tolerance", 1e-3),
                precision=str(props.get("precision", "auto")),
                occlusion=props.get("occlusion", True),
                rim=props.get("rim", "sharp"),
                n=props.get("n", None),
                weights=str(props.get("weights", "report")),
                epsilon=props.get("epsilon", None),
                coherent=parameters.names(props, "coherent"),
            )
            settings.check()
            self.light_of = LightOf(settings)

        def aov_names(self) -> list[str]:
            return [f"U.{group}.{part}" for group in self.groups for part in ("re", "im")]

        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> tuple[Any, Any, list[Any]]:
            from grimaldi.tracing import trace

            light = self.light_of(scene)
            chosen = light.select(self.groups)
            path = trace(
                scene,
                sampler,
                ray,
                lambda ray, si, bsdf, n, active, _: light.reflected(ray, si, bsdf, n, active),
                len(light.keys),
                self.max_depth,
                self.rr_depth,
                self.hidden,
                active,
            )
            return path.L, path.valid, [V.Float(x) for i in chosen for x in (path.real[i], path.imag[i])]

        def to_string(self) -> str:
            return f"Wave[{self.light_of.settings}, max_depth={self.max_depth}]"

    V.register_integrator("wave", Wave)
