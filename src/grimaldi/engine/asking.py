"""M asked at many receivers at once: those that lie in blocks by what acts on these, the others together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import drjit as dr

from grimaldi.diffraction.model import OUTSIDE, Evaluate, Factor, Grouped, Receivers, Twofold
from grimaldi.engine.blocks import Squares
from grimaldi.engine.frozen import Recording, frozen

ALONE = 128  # pieces, that take no longer one by one than lists
FEWEST = 31  # receivers: of as many as there are of something else, or one, each would be recorded anew

Ask = Callable[[Any, Any, Receivers], Factor]
"""ask(x, y, receivers): M at receivers that are seen at places of the film [pixels], Float64, evaluated."""


@dataclass(frozen=True)
class Recordings:
    """Of a model, for all pictures in its light: at receivers anywhere and in blocks, each in both precisions."""

    whole: tuple[Recording, Recording] = field(default_factory=lambda: (Recording(), Recording()))
    placed: tuple[Recording, Recording] = field(default_factory=lambda: (Recording(), Recording()))


def ask(film: Squares | None, factor: Evaluate, recordings: Recordings) -> Ask:
    """How to ask a model for M at what a camera sees; without a film, of each receiver by itself."""
    whole = _replayed(factor, recordings.whole)
    if film is None or pieces(factor) == 0:
        return lambda x, y, receivers: whole(receivers)
    assert isinstance(factor, Grouped)
    placed = _replayed(factor.among(film.blocks), recordings.placed)
    if factor.inside_only:
        return partial(_by_blocks, film, placed, whole)
    return lambda x, y, receivers: placed(film.placed(x, y, receivers))


def pieces(factor: Evaluate) -> int:
    """How much a model looks at for each block."""
    return factor.items if isinstance(factor, Grouped) else 0


def work(factor: Evaluate) -> float:
    """How long it takes to ask a model for M at a receiver, by lists or behind holes about 1."""
    listed = isinstance(factor, Grouped) and factor.inside_only
    return 1.0 if listed else max(pieces(factor) / ALONE, 1.0)


def _replayed(evaluate: Evaluate, recordings: tuple[Recording, Recording]) -> Evaluate:
    """A model recorded once; what it seldom does by itself, since recordings take as long as there is in them."""
    if not isinstance(evaluate, Twofold):
        return frozen(evaluate, recordings[0])
    single, double = (
        frozen(part, own) for part, own in zip((evaluate.single, evaluate.double), recordings, strict=True)
    )
    return partial(_twofold, single, double, evaluate.tolerance)


def _twofold(single: Evaluate, double: Evaluate, tolerance: float, receivers: Receivers) -> Factor:
    m = single(receivers)
    return _with_others(m, receivers.active & (m.error > tolerance), double, receivers)


def _by_blocks(film: Squares, listed: Evaluate, whole: Evaluate, x: Any, y: Any, receivers: Receivers) -> Factor:
    """Where a receiver among many lies in no block, all would wait for it: those are asked by themselves."""
    placed = film.placed(x, y, receivers)
    outside = receivers.active & (placed.block == OUTSIDE)
    m = listed(placed._replace(active=receivers.active & ~outside))
    return _with_others(m, outside, whole, receivers)


def _with_others(m: Factor, where: Any, evaluate: Evaluate, receivers: Receivers) -> Factor:
    """M, but another model's at some receivers."""
    some: Any = dr.compress(where)
    if len(some) == 0:
        return m
    if len(some) < FEWEST:
        some = dr.gather(type(some), some, dr.minimum(dr.arange(type(some), FEWEST), len(some) - 1))
    for values, of_some in zip(m, evaluate(receivers.some(some)), strict=True):
        dr.scatter(values, of_some, some)
    return m
