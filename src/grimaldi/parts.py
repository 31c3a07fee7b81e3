"""Long arrays in parts."""

from __future__ import annotations

from collections.abc import Iterator

CACHED = 1 << 14  # items, whose numbers a core has at hand


def parts(n: int, size: int = CACHED) -> Iterator[slice]:
    """n items, `size` at a time; unless given so many that what is made of them on the way never leaves the cache."""
    return (slice(first, min(first + size, n)) for first in range(0, n, size))
