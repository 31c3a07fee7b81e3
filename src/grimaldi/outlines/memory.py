"""What was found for a scene is kept as long as the scene is."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TypeVar
from weakref import WeakKeyDictionary

from grimaldi.scene.model import Scene

KEPT = 8  # results a scene: a few sources', or one's at several wavelengths

T = TypeVar("T")

_found: WeakKeyDictionary[Scene, dict[Hashable, object]] = WeakKeyDictionary()


def once(scene: Scene, key: tuple[Hashable, ...], make: Callable[[], T]) -> T:
    """`make()`, or what it gave the last time for this scene and key: scenes and what is made of them are frozen."""
    kept = _found.setdefault(scene, {})
    if key in kept:
        kept[key] = value = kept.pop(key)  # the last to go
    else:
        kept[key] = value = make()
        for old in list(kept)[:-KEPT]:
            del kept[old]
    return value  # type: ignore[return-value]
