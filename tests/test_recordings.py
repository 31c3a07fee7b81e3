"""Models recorded once and replayed tell what they tell when they are traced."""

from __future__ import annotations

import gc
import subprocess
import sys
from dataclasses import replace
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np
import pytest
from floor import Floor

import grimaldi
from grimaldi.bench import scenes
from grimaldi.diffraction.lists import listed_sum
from grimaldi.diffraction.model import Evaluate, Factor, Receivers
from grimaldi.engine.asking import Recordings, ask
from grimaldi.engine.frozen import frozen

mi: Any = mitsuba
mi.set_variant("llvm_ad_rgb")


def test_a_recorded_model_tells_what_the_model_tells_wherever_it_is_asked():
    """For any number of receivers, and of another light with other arrays."""
    for tolerance in (2e-2, 1e-3):
        floor = Floor(tolerance, "graded")
        model = floor.light.beams[0].factor
        recorded = frozen(model)
        for n in (300, 7, 1, 2000):
            x, y = (mi.Float(v.astype(np.float32)) for v in np.random.default_rng(n).uniform(0, 64, (2, n)))
            receivers = floor.sight(x, y).receivers
            for own, plain in zip(recorded(receivers), model(receivers), strict=True):
                np.testing.assert_allclose(own.numpy(), mi.Float64(plain).numpy(), rtol=0, atol=1e-6)


def test_another_picture_in_the_same_light_records_nothing_of_the_model(monkeypatch):
    """And where the film has another size, lists have other arrays: what was recorded tells the same as anew."""
    gc.collect()  # scenes of other tests that go in between would change what Dr.Jit counts
    loaded = grimaldi.load(scenes.bodies(12, seed=2, size=64, spp=1))
    settings: dict[str, Any] = {"wavelength": scenes.WAVELENGTH, "tolerance": 2e-2}
    traced, seen = [], []
    monkeypatch.setattr("grimaldi.diffraction.boundary.listed_sum", lambda *a: traced.append(0) or listed_sum(*a))
    for size in ((64, 64), (64, 64), (80, 80), (96, 48)):
        traced.clear()
        again = grimaldi.render(loaded, size=size, **settings)
        seen.append(len(traced))
        anew = grimaldi.render(replace(loaded), size=size, **settings)
        np.testing.assert_array_equal(again.U.values, anew.U.values)
    assert seen[0] > 0
    assert seen[1] == 0


class Pair(NamedTuple):
    """A model of two precisions."""

    single: Evaluate
    double: Evaluate
    tolerance: float

    def __call__(self, receivers: Receivers) -> Factor:
        raise AssertionError("each of its parts is asked by itself")


@pytest.mark.parametrize("above", [0, 1, 5, 800])
def test_the_finer_part_of_a_model_is_asked_where_the_other_errs(above):
    """Of a few receivers, which are filled up, and of many."""

    def tells(real: float, error: float) -> Evaluate:
        return lambda at: Factor(real + 0 * at.p.x, 0 * at.p.x, error * at.p.x, 1 * at.p.y)

    x = dr.arange(mi.Float64, 1000)
    tolerance = 999.5 - above
    point = Receivers(mi.Point3d(x, 2 * x, 0), mi.Vector3f(0, 0, 1), x >= 0)
    told = ask(None, Pair(tells(1, 1), tells(2, 0.5), tolerance), Recordings())(None, None, point)  # pyright: ignore
    errs = x.numpy() > tolerance
    assert errs.sum() == above
    np.testing.assert_array_equal(told.real.numpy(), np.where(errs, 2, 1))
    np.testing.assert_array_equal(told.error.numpy(), np.where(errs, 0.5, 1) * x.numpy())
    np.testing.assert_array_equal(told.clearance.numpy(), 2 * x.numpy())


def test_a_model_that_hides_an_array_is_refused_not_recorded():
    """What is not found would stay as it was when its kernel was recorded."""
    hidden = {"array": dr.opaque(mi.Float, 2.0)}  # a dict is not among what models are made of

    def model(receivers: Receivers) -> Factor:
        return Factor(hidden["array"] * mi.Float(receivers.p.x), mi.Float(0), mi.Float(0), mi.Float(0))

    point = Receivers(mi.Point3d(1, 2, 3), mi.Vector3f(0, 0, 1), mi.Bool(True))
    with pytest.raises(RuntimeError):
        frozen(model)(point)


GARBAGE = """
import gc
import numpy as np
import grimaldi
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import _Bodies

by_lists = _Bodies._by_lists
def littering(self, *given):
    for _ in range(300):
        ring = [types(double=False).buffer(np.arange(1000.0))]
        ring.append(ring)
    return by_lists(self, *given)
_Bodies._by_lists = littering
gc.set_threshold(5)
grimaldi.render("creature", wavelength=4.0, size=(16, 16), spp=8, tolerance=0.1)
"""


def test_what_python_collects_does_not_end_a_recording():
    """Dr.Jit ends the process where NumPy's memory is given back while it records."""
    done = subprocess.run([sys.executable, "-c", GARBAGE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
