"""What lists of what acts on blocks of receivers are made from: which pieces, and how finely."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr

from grimaldi.diffraction.frame import Frames, frame
from grimaldi.diffraction.grazing import Chords
from grimaldi.diffraction.occlusion import Rays
from grimaldi.diffraction.segment import Rule
from grimaldi.diffraction.table import Table
from grimaldi.scene.model import Source


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


class Pairs(NamedTuple):
    """Blocks and pieces, each of which may act in the other."""

    block: Any
    piece: Any
    index: Any  # of the pair among all
