"""How far from a ray outlines still count: measured on some of the points where the field will be asked."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import Problem, unoccluded
from grimaldi.diffraction.edges import taper
from grimaldi.diffraction.frame import constant
from grimaldi.diffraction.model import Options
from grimaldi.diffraction.table import MANY, cut, needs_double, packed
from grimaldi.outlines.model import Outline, Reals
from grimaldi.scene.model import Scene, Source

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

POINTS = 64  # where it is measured
LEFT_OUT = 0.3  # of the tolerance, at most at these points
LADDER = np.exp2(np.arange(5.0, 15.0))  # of kΔ


def reach(scene: Scene, source: Source, outline: Outline, k: float, options: Options, where: Reals) -> float:
    """Δ from which on what is left out changes M by `LEFT_OUT` of the tolerance at most, at some points (n, 3).

    Waves of far edges come from corners and the ends of bodies and are as good as random in phase, unless bodies stand
    in a lattice; there this tells. Infinite where everything counts.
    """
    if scene.screen or len(where) == 0 or len(outline) < MANY or len(ranges := cut(outline)) < MANY:
        return np.inf
    points = where[np.linspace(0, len(where) - 1, min(POINTS, len(where))).astype(int)]
    rungs = LADDER / k
    left_out = _left_out(
        Problem(scene, source, outline, k, options, packed(outline, source, ranges), None), points, rungs
    )
    too_near = np.flatnonzero(~(left_out <= LEFT_OUT * options.tolerance))
    return float(rungs[too_near[-1] + 1]) if len(too_near) and too_near[-1] + 1 < len(LADDER) else np.inf


def _left_out(problem: Problem, points: Reals, rungs: Reals) -> Reals:
    """The largest |M| (m,) at points (n, 3) of what is left out beyond each of the Δ `rungs` (m,), an octave apart.

    A piece's wave is left out as a whole at rungs before its Δ, in part at the next one, and not at all at others.
    """
    precision = types(needs_double(problem.outline, problem.k, problem.options))
    F = precision.Float
    number, wave = unoccluded(problem, precision)
    piece = dr.arange(dr.uint32_array_t(F), number)
    ends = precision.buffer(np.append(rungs, np.inf))
    most = np.zeros(len(rungs))
    for point in points:
        delta, real, imag = wave(constant(types(double=True).Vector, point), piece)
        octave = dr.clip(dr.ceil(dr.log2(dr.maximum(delta, 1e-30) / rungs[0])), 0, len(rungs))
        part = 1 - taper(delta / dr.gather(F, ends, type(piece)(octave)))
        waves, rung = (real, imag, part * real, part * imag), mi.Int64(octave)  # as bincount wants it
        dr.eval(waves, rung)
        real, imag, partly_real, partly_imag = (
            np.bincount(rung.numpy(), wave.numpy(), len(rungs) + 1) for wave in waves
        )
        whole, partly = real + 1j * imag, partly_real + 1j * partly_imag
        beyond = np.cumsum(whole[:0:-1])[::-1]
        most = np.maximum(most, np.abs(beyond + partly[:-1]))
    return most
