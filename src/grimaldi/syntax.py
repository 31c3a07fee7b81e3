"""Dr.Jit's `dr.syntax` when a function is first called: a command then waits for what it needs alone."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import Any, TypeVar, cast

import drjit as dr

F = TypeVar("F", bound=Callable[..., Any])


def syntax(function: F) -> F:
    """The function with Dr.Jit's loops and conditions in place of Python's, where they take arrays."""
    transformed = cache(lambda: dr.syntax(function))

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        return transformed()(*args, **kwargs)

    return cast("F", call)
