"""Sums in Float32 of waves whose phases are told in Float64, against Float64 throughout."""

from __future__ import annotations

from typing import Any

import mitsuba
import numpy as np
import pytest
from floor import Floor

import grimaldi
from grimaldi.diffraction.arrays import mixed, types
from grimaldi.diffraction.boundary import _Bodies
from grimaldi.diffraction.table import SINGLE
from grimaldi.scene.builtin import creature

mi: Any = mitsuba
mi.set_variant("llvm_ad_rgb")


@pytest.mark.parametrize("occlusion", ["none", "graded"])
def test_sums_differ_by_a_part_of_the_tolerance(occlusion):
    """Of a mesh, at what a camera sees of it and of its shadow, rims included; at the least tolerance they serve."""
    floor = Floor(SINGLE, occlusion, other=creature.build())
    factor: Any = floor.light.beams[0].factor
    assert isinstance(factor, _Bodies)
    assert factor.tab.types == mixed()
    x, y = (mi.Float(v.astype(np.float32)) for v in np.random.default_rng(1).uniform(0, 64, (2, 4000)))
    receivers = floor.sight(x, y).receivers
    sums, double = (_Bodies(factor.problem, precision)(receivers) for precision in (mixed(), types(double=True)))
    off = np.hypot((sums.real - double.real).numpy(), (sums.imag - double.imag).numpy())
    assert abs(double.real.numpy() - 1).max() > 0.5
    assert off.max() < 0.1 * SINGLE
    assert sums.error.numpy().max() < SINGLE


def test_arago_spot_of_a_large_disc():
    """All of the rim is late by kΔ = 2.6e5 rad there: with phases in Float32 as well, M errs by 4e-3."""
    T = mi.ScalarTransform4f
    disc: dict[str, Any] = {
        "type": "scene",
        "light": {"type": "coherent_directional", "direction": [0, 0, 1]},
        "disc": {"type": "disk", "to_world": T().scale(1e5)},
    }
    points = np.stack([np.linspace(0, 3, 50), np.zeros(50), np.full(50, 1e5)], axis=1)
    sums, double = (
        grimaldi.field(disc, points, wavelength=1.0, tolerance=1e-3, precision=precision).U.values.ravel()
        for precision in ("auto", "double")
    )
    assert abs(double).max() > 0.8
    assert abs(sums - double).max() < 2e-4
