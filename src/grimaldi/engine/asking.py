"""M asked at many receivers at once: those that lie in blocks by what acts on these, the others together."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import drjit as dr

from grimaldi.diffraction.model import OUTSIDE, Evaluate, Factor, Grouped, Receivers
from grimaldi.engine.blocks import Squares
from grimaldi.engine.frozen import frozen

Ask = Callable[[Any, Any, Receivers], Factor]
"""ask(x, y, receivers): M at receivers that are seen at places of the film [pixels], Float64, evaluated."""


def ask(film: Squares, factor: Evaluate) -> Ask:
    """How to ask a model for M at what a camera sees."""
    whole = frozen(factor)
    listed = factor.among(film.blocks) if isinstance(factor, Grouped) else factor
    if listed is factor:
        return lambda x, y, receivers: whole(receivers)
    return partial(_by_blocks, film, frozen(listed), whole)


def _by_blocks(film: Squares, listed: Evaluate, whole: Evaluate, x: Any, y: Any, receivers: Receivers) -> Factor:
    """Where a receiver among many lies in no block, all would wait for it: those are asked by themselves."""
    placed = film.placed(x, y, receivers)
    outside = receivers.active & (placed.block == OUTSIDE)
    m = listed(placed)
    left: Any = dr.compress(outside)
    if len(left) == 0:
        return m
    own = whole(receivers.some(left))
    for values, of_own in zip(m, own, strict=True):
        dr.scatter(values, of_own, left)
    return m
