"""Calls from several threads take turns: Dr.Jit's recordings and a scene's film are for one at a time."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from threading import RLock
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

_turn = RLock()  # of the process: Dr.Jit counts all objects of all scenes together


def one_at_a_time(function: Callable[P, T]) -> Callable[P, T]:
    """The function, begun when no other thread is in it or in another of these."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        with _turn:
            return function(*args, **kwargs)

    return call
