"""What a field's numbers are worth: said where the tolerance was not reached, and where light is fainter than it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import GrimaldiWarning
from grimaldi.outlines.extract import outline
from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Scene, Source, Vector

Reals = NDArray[np.float64]

SAMPLES = 1 << 14  # points that tell whether the light is faint at most
SURELY = 0.4  # of these: where no more are faint, less than half of all points are
FEW = 3  # tolerances: light fainter than that has no digits


@dataclass
class Misses:
    """At how many points |M_computed - M| is estimated above the tolerance, and where it is largest."""

    tolerance: float
    count: int = 0
    of: int = 0
    worst: float = 0.0
    source: Source | None = None
    point: Vector | None = None

    def add(self, source: Source, points: Reals, error: Reals, free: Reals) -> None:
        """Take in one source's estimated |U_computed - U| and its |U0| at points (n, 3)."""
        self.of += len(points)
        if not (error > self.tolerance * free).any():
            return
        of_m = np.divide(error, free, out=np.zeros_like(error), where=free > 0)
        self.count += int((of_m > self.tolerance).sum())
        if of_m.max() > self.worst:
            self.worst, self.source, self.point = float(of_m.max()), source, points[of_m.argmax()]

    def warn(self, scene: Scene) -> None:
        """GrimaldiWarning that names the worst point and the edge nearest to it, if there are any."""
        if not self.count or self.source is None or self.point is None:
            return
        seen = outline(scene.before(self.source), self.source)
        edge = f", beside {_nearest(scene, seen, self.point)}" if len(seen) else ""
        place = ", ".join(f"{x:.9g}" for x in self.point)
        warnings.warn(
            f"tolerance {self.tolerance:g} is not reached at {self.count} of {self.of} points: the error of M may be "
            f"{self.worst:.1g} at ({place}){edge}; `error` has it for each point",
            GrimaldiWarning,
            stacklevel=4,
        )


def _nearest(scene: Scene, seen: Outline, p: Vector) -> str:
    """The outline segment nearest to a point, in words."""
    i = int(seen.distances(p).argmin())
    body = int(seen.body[i])
    name = scene.bodies[body].name if body >= 0 else f"planar outline {-1 - body}"
    ends = (", ".join(f"{x:.6g}" for x in end) for end in (seen.start[i], seen.end[i]))
    return f"the edge of {name!r} from ({') to ('.join(ends)})"


def warn_of_faint_light(U: NDArray[np.complex128], free: Reals, tolerance: float) -> None:
    """GrimaldiWarning where at most points |U| is below a few tolerances of the light without obstacles.

    U (wavelength, group, point); free (wavelength, point), the sum of all sources' |U0|.
    """
    if not free.size:
        return
    every = max(free.shape[1] // SAMPLES, 1) | 1  # odd: no row of a lattice has the same ones as the next
    if (np.abs(U[:, :, ::every]).sum(axis=1) < FEW * tolerance * free[:, ::every]).mean() <= SURELY:
        return
    size = np.abs(U).sum(axis=1)
    faint = size < FEW * tolerance * free  # and so light > 0
    if faint.mean() <= 0.5:
        return
    typical = float(np.median(size[faint] / free[faint]))
    finer = max(10.0 ** np.floor(np.log10(1e-2 * max(typical, 1e-2 * tolerance))), 1e-12)
    warnings.warn(
        f"the light is below {FEW * tolerance:g} of what it is without obstacles at {faint.sum()} of {faint.size} "
        f"points, where tolerance={tolerance:g} leaves few digits; ask for tolerance={finer:g}",
        GrimaldiWarning,
        stacklevel=4,
    )
