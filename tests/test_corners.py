"""Corners for whole segments, and the sines that they take, against the integral and NumPy's own."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba
import numpy as np
import pytest

from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.corners import between, by_halves, corner
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.segment import Corners, Rule, line, segment_wave
from grimaldi.diffraction.sines import sincos

mitsuba.set_variant("llvm_ad_rgb")


def ways(rng: np.random.Generator, n: int, plane: bool) -> tuple[Any, Any, Any, Any, Any]:
    """Rays along z through the origin at k = 1, and segments from X0 to X1 beside them, in Fresnel widths and more."""
    F, V, *_ = types(double=True)
    z1, z2 = 10 ** rng.uniform(0, 6, (2, n))
    width = np.sqrt(z2 if plane else z1 * z2 / (z1 + z2))
    q, angle = width * 10 ** rng.uniform(-2, 2, n), rng.uniform(0, 2 * np.pi, n)
    e = rng.normal(size=(3, n)) * np.array([1, 1, 0.3])[:, None]
    e /= np.linalg.norm(e, axis=0)
    X0 = np.stack([q * np.cos(angle), q * np.sin(angle), 0 * q])
    length = width * 10 ** rng.uniform(-2, 2, n)
    zero = F(np.zeros(n))
    frame = Frame(V(zero, zero, zero + 1), V(zero, zero, zero), F(z1), F(z2), zero, plane)
    return frame, V(*map(F, X0)), V(*map(F, X0 + length * e)), V(*map(F, e)), F(length)


@pytest.mark.parametrize("plane", [False, True])
@pytest.mark.parametrize("tolerance", [5e-2, 1e-3, 1e-6])
def test_corners_tell_what_the_whole_segment_does(tolerance, plane):
    """Each form within a tenth of the tolerance of the integral to 1e-10, wherever it says that it serves; so is each
    half where a segment goes by halves."""
    frame, X0, X1, e, length = ways(np.random.default_rng(3), 200_000, plane)
    k = type(length)(1)
    exact = segment_wave(frame, line(frame, X0, e), length, k, Rule.of(1e-10), dr.mask_t(k)(True))
    rule = Corners.of(tolerance)
    a, b = corner(frame, X0, k), corner(frame, X1, k)
    for form in (rule._replace(far=np.inf), rule._replace(bend=0.0)):  # short, far
        ends = between(frame.a, a, b, k, form)
        off = np.hypot((ends.real - exact.real).numpy(), (ends.imag - exact.imag).numpy()) / (2 * np.pi)
        serves = ends.serves.numpy()
        assert serves.sum() > 300
        assert off[serves].max() < 0.1 * tolerance
    real, imag, serves = by_halves(frame, a, b, k, rule)
    off = np.hypot((real - exact.real).numpy(), (imag - exact.imag).numpy()) / (2 * np.pi)
    more = serves.numpy() & ~between(frame.a, a, b, k, rule).serves.numpy()
    assert more.sum() > 300
    assert off[serves.numpy()].max() < 2 * 0.1 * tolerance


@pytest.mark.parametrize("double", [False, True])
def test_sines_are_exact_but_for_how_their_argument_is_rounded(double):
    kind = types(double).Float
    x = kind(np.random.default_rng(0).uniform(-1e4, 1e4, 100_000))
    exact, rounding = x.numpy().astype(np.float64), dr.epsilon(kind)
    for found, expected in zip(sincos(x), (np.sin(exact), np.cos(exact)), strict=True):
        assert (abs(found.numpy() - expected) < rounding * (4 + 2 * abs(exact))).all()
