"""Long arrays in parts."""

from __future__ import annotations

from collections.abc import Iterator

CACHED = 1 << 14  # items, whose numbers a core has at hand


def parts(n: int) -> Iterator[slice]:
    """n items, some at a time: what is made of them on the way never leaves the cache."""
    return (slice(first, min(first + CACHED, n)) for first in range(0, n, CACHED))
