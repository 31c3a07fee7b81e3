"""Chirps by themselves: what is told of waves that are known everywhere, alone and in bundles."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba
import numpy as np
import pytest

from grimaldi.diffraction import bundles
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.chirps import FARTHEST, FLAT, PLACES, Samples, fit
from grimaldi.diffraction.hierarchy import NONE
from grimaldi.diffraction.solids import SPACE

mi: Any = mitsuba
mi.set_variant("llvm_ad_rgb")


def test_a_chirp_whose_amplitude_goes_through_zero_is_told():
    """A e^{iψ} with A and ψ quadratic in the place, its values and ψ at PLACES, but for a part of a turn."""

    def wave(u: Any, v: Any) -> Any:
        return (0.4 - u + 0.2 * u * v) * np.exp(2j * np.pi * (0.3 + 2.1 * u - 1.3 * v + 0.11 * u * u - 0.06 * v * v))

    place = np.array(FLAT.places).T
    single, one = types(double=False), np.ones(PLACES)
    values = wave(*place).real, wave(*place).imag, 2.05 * place[0] - 1.25 * place[1], one, one, one
    found = fit(Samples(*(single.Float(v) for v in values)), 1, single)
    u, v = np.random.default_rng(2).uniform(-1, 1, (2, 200))
    real, imag = found.chirps.at(dr.zeros(mi.UInt32, 200), (mi.Float(u), mi.Float(v)))
    np.testing.assert_allclose(real.numpy() + 1j * imag.numpy(), wave(u, v), atol=1e-5)
    assert np.sqrt(found.off2.numpy()[0]) < 1e-5


def test_a_chirp_in_space_is_told_by_the_corners_of_an_icosahedron():
    """The same with three coordinates, as about curved blocks; what is cubic is seen to be left out."""

    def wave(u: Any, v: Any, w: Any, cubic: float = 0.0) -> Any:
        turns = 0.2 - 1.7 * u + 0.9 * v + 0.4 * w + 0.05 * u * u - 0.08 * u * v + 0.06 * v * w - 0.03 * w * w
        return (0.5 + 0.1 * u - 0.2 * v * w + 0.05 * w) * np.exp(2j * np.pi * (turns + cubic * u * v * w))

    u, v, w = np.array(SPACE.places).T
    single, one = types(double=False), np.ones(len(u))
    for cubic, left in ((0.0, 1e-5), (0.3, 0.02)):
        values = wave(u, v, w, cubic).real, wave(u, v, w, cubic).imag, -1.65 * u + 0.95 * v + 0.4 * w, one, one, one
        found = fit(Samples(*(single.Float(x) for x in values)), 1, single, stencil=SPACE)
        assert (np.sqrt(found.off2.numpy()[0]) < left) == (cubic == 0)
        if cubic == 0:
            at = np.random.default_rng(3).uniform(-1, 1, (3, 200))
            real, imag = found.chirps.at(dr.zeros(mi.UInt32, 200), [mi.Float(x) for x in at])
            np.testing.assert_allclose(real.numpy() + 1j * imag.numpy(), wave(*at), atol=1e-5)


@pytest.mark.parametrize("blocks", [[0], [0, 1, 2], [0, 0], [0, 0, 0]])
def test_a_bundle_holds_each_of_its_waves_once(blocks):
    """Waves of 1/4 everywhere: those of a block add up, whether one, or several, or none are left to go with it."""
    n, single = len(blocks), types(double=False)
    samples = Samples(*(dr.full(single.Float, value, PLACES * n) for value in (0.25, 0, 0, 0, FARTHEST, FARTHEST)))
    block = mi.UInt32(blocks)
    allowed = dr.full(single.Float, 1.0, n)
    found = fit(samples, n, single)
    chirps, _, chirp = bundles.bundled(found, samples, dr.arange(mi.UInt32, n), block, allowed, max(blocks) + 1)
    own: Any = dr.compress(chirp != NONE)
    real, imag = chirps.at(dr.gather(mi.UInt32, chirp, own), (mi.Float(0.3), mi.Float(-0.2)))
    np.testing.assert_array_equal(dr.gather(mi.UInt32, block, own).numpy(), np.unique(blocks))
    np.testing.assert_allclose(real.numpy(), 0.25 * np.bincount(blocks), rtol=1e-5)
    np.testing.assert_allclose(imag.numpy(), 0, atol=1e-6)
