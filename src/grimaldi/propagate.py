"""One source's light at points: its outlines, the model's M along them, U = U0 M. Shared by `field` and `wave`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from grimaldi.diffraction.frame import incident
from grimaldi.diffraction.model import Model, Options, Receivers
from grimaldi.outlines.extract import outline
from grimaldi.scene.model import Scene, Source

SAG = 0.25  # of tolerance/k: Δ changes by at most twice the sag, and its mean over a polygon's sides vanishes


class Wave(NamedTuple):
    """U and |U_computed - U| at receivers, Float64 Dr.Jit arrays."""

    real: Any
    imag: Any
    error: Any


def propagate(scene: Scene, source: Source, model: Model, k: float, options: Options) -> Callable[[Receivers], Wave]:
    """Find what stands in the source's light; return U (eq. 1-2 times M) as a function of receivers.

    k: wavenumber [1/scene unit]. The function is pure and can be traced inside a larger kernel.
    """
    seen = outline(scene, source, sag=SAG * options.tolerance / k)
    factor = model(scene, source, seen, k, options)

    def wave(receivers: Receivers) -> Wave:
        modulus, cos, sin = incident(source, receivers.p, k)
        m = factor(receivers)
        F = type(modulus)
        re, im = F(m.real), F(m.imag)
        return Wave(modulus * (cos * re - sin * im), modulus * (cos * im + sin * re), modulus * F(m.error))

    return wave
