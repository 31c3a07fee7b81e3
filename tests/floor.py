"""A floor under bodies as a camera sees it: where M is asked of blocks, and without them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba
import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.bench import scenes
from grimaldi.engine.asking import Recordings, ask
from grimaldi.engine.blocks import Sight, Squares, squares
from grimaldi.engine.tiles import Shot, sight
from grimaldi.light import prepare
from grimaldi.options import Settings

mi: Any = mitsuba

Reals = NDArray[np.float64]


@dataclass
class Floor:
    """A floor under twelve bodies as a camera sees it, M there by all pieces and by lists of blocks."""

    tolerance: float
    occlusion: str
    radius: float | None = None  # of a ball that the floor is the top of
    other: dict[str, Any] | None = None  # scene

    def __post_init__(self) -> None:
        dictionary = self.other or scenes.bodies(12, seed=2, size=64, spp=1)
        if self.radius is not None:
            ball = {"type": "sphere", "center": [0, 0, scenes.FLOOR - self.radius], "radius": self.radius}
            dictionary["floor"] = ball | {"bsdf": dictionary["floor"]["bsdf"]}
        self.scene = grimaldi.load(dictionary)
        settings = Settings(wavelength=scenes.WAVELENGTH, tolerance=self.tolerance, occlusion=self.occlusion)
        self.light = prepare(self.scene, settings)
        self.film = squares(self.sight, 64, 0, 64)

    def sight(self, x: Any, y: Any) -> Sight:
        return sight(self.light, self.scene.mitsuba.sensors()[0], Shot(64, 64, 1, 0, 2, 5, False), x, y)[0]

    def both(self, film: Squares, x: Reals, y: Reals) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """M by the blocks of `film`, and by all pieces, at places of it."""
        x, y = (mi.Float(v.astype(np.float32)) for v in (x, y))
        receivers = self.sight(x, y).receivers
        factor = self.light.beams[0].factor
        assert receivers.active.numpy().all()
        return tuple(
            m.real.numpy() + 1j * m.imag.numpy()
            for m in (ask(film, factor, Recordings())(x, y, receivers), factor(receivers))
        )
