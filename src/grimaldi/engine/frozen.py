"""Models recorded once and replayed: to trace one takes Python longer than its kernel takes for many a receiver."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FunctionType, MethodType
from typing import Any

import drjit as dr
import mitsuba

from grimaldi.diffraction.model import Evaluate, Factor, Receivers
from grimaldi.variants import on_cuda

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

KEPT = 8  # recordings of a model: one for each way in which its arrays have equal sizes
SHAPES = 2000  # in all scenes that a model holds: Dr.Jit looks at each of more for longer than Python takes to trace


class Recording:
    """What Dr.Jit recorded of a model, and of those that differ from it in nothing but their arrays."""

    def __init__(self) -> None:
        self._model: Evaluate | None = None  # while it is asked
        self._state: tuple[Any, ...] = ()
        self._replayed = dr.freeze(self._asked, state_fn=lambda *_: self._state, limit=KEPT, warn_after=1 << 31)

    def _asked(self, *receivers: Any) -> tuple[Any, ...]:
        assert self._model is not None
        return tuple(mi.Float64(v) for v in self._model(Receivers(*receivers)))

    def ask(self, model: Evaluate, state: tuple[Any, ...], receivers: Receivers, again: bool) -> tuple[Any, ...]:
        """M by the model, which holds what is in `state`; `again`: whether it may be replayed."""
        self._model, self._state = model, state
        try:
            return (self._replayed if again else self._asked)(*receivers)
        finally:
            self._model, self._state = None, ()


def frozen(model: Evaluate, recording: Recording | None = None) -> Evaluate:
    """The same model, evaluated at receivers: Float64 arrays."""
    recording = recording or Recording()
    state = held(model)
    shapes = sum(len(part.shapes()) for part in state if isinstance(part, mi.Scene))
    again = not on_cuda() and shapes <= SHAPES

    def evaluated(receivers: Receivers) -> Factor:
        dr.make_opaque(*receivers)  # a literal would need a recording of its own
        with _no_garbage_collected():
            m = Factor(*recording.ask(model, state, receivers, again))
        dr.eval(*m)
        return m

    return evaluated


@contextmanager
def _no_garbage_collected() -> Iterator[None]:
    """While Dr.Jit records it cannot give back what NumPy lent it, and ends the process if it has to."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def held(evaluate: Evaluate) -> tuple[Any, ...]:
    """The arrays and scenes that a model's data and functions hold, however deep."""
    found: list[Any] = []
    seen: set[int] = set()

    def visit(value: Any) -> None:
        if id(value) in seen:
            return
        seen.add(id(value))
        if dr.is_array_v(value) or isinstance(value, mi.Scene):
            found.append(value)
            return
        for part in _parts(value):
            visit(part)

    visit(evaluate)
    return tuple(found)


def _parts(value: Any) -> Iterable[Any]:
    """What plain data and functions hold."""
    if isinstance(value, (tuple, list)):
        return value
    if isinstance(value, partial):
        return value.func, *value.args
    if isinstance(value, MethodType):
        return (value.__self__,)
    if isinstance(value, FunctionType):
        return [cell.cell_contents for cell in value.__closure__ or ()]
    if type(value).__module__.startswith("grimaldi."):
        return list(vars(value).values())
    return ()
