"""The light of a Mitsuba scene that may change between pictures."""

from __future__ import annotations

import warnings
from hashlib import blake2b
from typing import Any

import numpy as np

from grimaldi.light import Light, prepare
from grimaldi.options import Settings
from grimaldi.scene.bodies import indices, vertices
from grimaldi.scene.model import Mesh, Scene


class LightOf:
    """The light of a Mitsuba scene, prepared anew when its bodies or sources have changed.

    A plain object, so that Mitsuba does not look for parameters in it.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self._key = b""
        self._light: Light | None = None

    def __call__(self, scene: Any) -> Light:
        from grimaldi.scene import load

        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            loaded = load(scene, coherent=self.settings.coherent)
        key = fingerprint(loaded)
        if self._light is None or key != self._key:
            for warning in said:
                warnings.warn(warning.message, stacklevel=2)
            self._key, self._light = key, prepare(loaded, self.settings)
        return self._light


def fingerprint(scene: Scene) -> bytes:
    """Changes when a shape, a source or a camera does, and from one Mitsuba scene to the next."""
    digest = blake2b(digest_size=16)
    digest.update(indices(scene.mitsuba).tobytes())
    for surface in scene.surfaces:
        digest.update(b"-" if surface is None else np.ascontiguousarray(vertices(surface)).tobytes())
        if isinstance(surface, Mesh):
            digest.update(np.ascontiguousarray(surface.faces).tobytes())
    for planar in (*scene.screen, *(s.aperture for s in scene.sources if s.aperture is not None)):
        digest.update(np.concatenate([*planar.loops, planar.to_world[:, :2]], axis=None).tobytes())
    for s in scene.sources:
        digest.update(repr((s.name, s.group, s.amplitude, s.phase, s.tint)).encode())
        for v in (s.position, s.direction, s.origin):
            digest.update(b"-" if v is None else v.tobytes())
        digest.update(repr(s.spot and (s.spot.axis.tolist(), s.spot.beam_width, s.spot.cutoff)).encode())
    for sensor in scene.mitsuba.sensors():
        digest.update(repr((sensor.world_transform(), sensor.film().crop_size())).encode())
    return digest.digest()
