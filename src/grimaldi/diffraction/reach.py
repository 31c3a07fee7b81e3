"""How far from a ray outlines still count: measured on some of the points where the field will be asked."""

from __future__ import annotations

import drjit as dr
import numpy as np

from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import Problem, unoccluded
from grimaldi.diffraction.model import Options
from grimaldi.diffraction.table import MANY, cut
from grimaldi.outlines.model import Outline, Reals
from grimaldi.scene.model import Scene, Source

POINTS = 64  # where it is measured
LEFT_OUT = 0.3  # of the tolerance, at most at these points
LADDER = 2.0 ** np.arange(5, 15)  # of kΔ


def reach(scene: Scene, source: Source, outline: Outline, k: float, options: Options, where: Reals) -> float:
    """Δ from which on what is left out changes M by `LEFT_OUT` of the tolerance at most, at some points (n, 3).

    Waves of far edges come from corners and the ends of bodies and are as good as random in phase, unless bodies stand
    in a lattice; there this tells. Infinite where everything counts.
    """
    if scene.screen or len(where) == 0 or len(outline) < MANY or len(cut(outline)) < MANY:
        return np.inf
    points = where[np.linspace(0, len(where) - 1, min(POINTS, len(where))).astype(int)]
    rungs = np.append(LADDER / k, 1e30)
    double = types(double=True)
    asked, far = np.repeat(points, len(rungs), axis=0), np.tile(rungs, len(points))
    problem = Problem(scene, source, outline, k, options, None)
    sums = unoccluded(problem, double, double.buffer(far))
    real, imag = sums(double.Vector(*(double.buffer(asked[:, i]) for i in range(3))))
    dr.eval(real, imag)
    M = (real.numpy() + 1j * imag.numpy()).reshape(len(points), len(rungs))
    left_out = np.abs(M - M[:, -1:]).max(axis=0)
    too_near = np.flatnonzero(~(left_out <= LEFT_OUT * options.tolerance))
    return float(rungs[too_near[-1] + 1]) if len(too_near) and too_near[-1] + 1 < len(LADDER) else np.inf
