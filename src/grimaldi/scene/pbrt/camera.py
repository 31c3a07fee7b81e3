"""pbrt's camera, film and sampler as a Mitsuba sensor."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from grimaldi.scene.pbrt.parameters import Parameters
from grimaldi.scene.pbrt.tokens import Place
from grimaldi.scene.pbrt.transforms import Reals, as_mitsubas, inverse


@dataclass
class Shot:
    """What is said before WorldBegin; a directive that is not there keeps pbrt's defaults."""

    kind: str = "perspective"
    to_camera: Reals = field(default_factory=lambda: np.eye(4))
    place: Place | None = None
    camera: Parameters | None = None
    width: int = 1280
    height: int = 720
    samples: int = 16
    bounces: int = 1

    def set_film(self, kind: str, film: Parameters) -> None:
        width, height = (640, 480) if kind == "image" else (1280, 720)  # version 3; version 4
        self.width = film.one("xresolution", width)
        self.height = film.one("yresolution", height)
        film.one("filename", "")  # where the picture goes is said elsewhere

    def set_sampler(self, sampler: Parameters) -> None:
        self.samples = sampler.one("pixelsamples", 16)
        if sampler.has("xsamples"):
            self.samples = sampler.one("xsamples", 4) * sampler.one("ysamples", 4)

    def set_integrator(self, kind: str, integrator: Parameters) -> bool:
        """False for one that traces no paths."""
        if kind in ("path", "volpath", "simplepath"):
            self.bounces = integrator.one("maxdepth", 5)
        return kind in ("path", "volpath", "simplepath", "directlighting", "whitted")

    def sensor(self) -> dict[str, Any]:
        """The Mitsuba sensor; InputError for a camera that is neither perspective nor orthographic, or flattened."""
        camera, place = self.camera, self.place
        if camera is None or place is None:
            return {}
        try:
            to_world = inverse(self.to_camera)
        except np.linalg.LinAlgError:
            raise place.error("the camera's transform flattens it; give a scale that is nowhere 0") from None
        to_world = to_world @ np.diag([-1.0, 1.0, 1.0, 1.0])  # Mitsuba's x points left
        common = {
            "film": {
                "type": "hdrfilm",
                "width": self.width,
                "height": self.height,
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent", "sample_count": self.samples},
        }
        if self.kind == "orthographic":
            wide = max(self.width / self.height, 1.0)
            to_world = to_world @ np.diag([wide, wide, 1.0, 1.0])
            return {"type": "orthographic", "to_world": as_mitsubas(to_world), **common}
        if self.kind != "perspective":
            raise place.error(f"camera {self.kind!r} is none of Mitsuba's; use perspective or orthographic")
        to_world[:3, :3] /= np.linalg.norm(to_world[:3, :3], axis=0)
        lens: dict[str, Any] = {"type": "perspective"}
        if camera.one("lensradius", 0.0) > 0:
            focus = camera.one("focaldistance", 1e6)
            lens = {"type": "thinlens", "aperture_radius": camera.one("lensradius", 0.0), "focus_distance": focus}
        angle = {"fov": camera.one("fov", 90.0), "fov_axis": "smaller"}
        return {**lens, **angle, "to_world": as_mitsubas(to_world), **common}
