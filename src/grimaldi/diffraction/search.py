"""What lists of what acts on blocks of receivers are made from: which pieces, and how finely."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.frame import Frames, constant, frame
from grimaldi.diffraction.grazing import Chords
from grimaldi.diffraction.occlusion import Rays
from grimaldi.diffraction.segment import Rule
from grimaldi.diffraction.table import Piece, Table
from grimaldi.scene.model import Source

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for


class Search(NamedTuple):
    """What is asked of pieces: the outlines, in Float32 or Float64, and what is allowed to be left out of M.

    share: |M| below which a piece reaches all without a test; probe: rays X→P, None where nothing blocks them; grazing:
    silhouettes that X→P may graze.
    """

    source: Source
    tab: Table
    k: Any
    rule: Rule
    tolerance: float
    share: float
    probe: Rays | None
    grazing: Chords | None

    def frames(self, p: Any) -> Frames:
        """Of points (Float64), evaluated: once for each, not once for each piece."""
        return Frames.of(frame(self.source, p, self.tab), dr.width(p), self.tab.types)

    def reaches(self, piece: Piece, p: Any, n: Any, active: Any) -> Any:
        """Whether pieces reach points (Float64) of surfaces, normals n, by a ray from each of these."""
        assert self.probe is not None
        x = mi.Point3f(piece.middle + constant(self.tab.types.Vector, self.tab.centre))
        p = mi.Point3f(p)
        return self.probe.reaches(x, piece, p + self.probe.epsilon(p) * n, active)


class Pairs(NamedTuple):
    """Blocks and pieces, each of which may act in the other."""

    block: Any
    piece: Any
    index: Any  # of the pair among all


def sums(parts: Any, block: Any, number: int, some: Any = True) -> Any:
    """Of some whole numbers in each block, the same in any order."""
    total = dr.zeros(mi.UInt64, number)
    dr.scatter_add(total, mi.UInt64(parts), block, some)
    return total
