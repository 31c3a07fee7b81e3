"""What was found for a scene is kept as long as the scene is."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TypeVar
from weakref import WeakKeyDictionary

from grimaldi.scene.model import Scene

KEPT = 8  # results a scene of each kind: a few sources', or one's at several wavelengths

T = TypeVar("T")

_found: WeakKeyDictionary[Scene, dict[tuple[Hashable, ...], object]] = WeakKeyDictionary()


def once(scene: Scene, key: tuple[Hashable, ...], make: Callable[[], T]) -> T:
    """`make()`, or what it gave the last time for this scene and key: scenes and what is made of them are frozen.

    A key begins with the kind of the result, which must not hold the scene: neither would ever be given back.
    """
    kept = _found.setdefault(scene, {})
    if key in kept:
        kept[key] = value = kept.pop(key)  # the last to go
    else:
        kept[key] = value = make()
        for old in [other for other in kept if other[0] == key[0]][:-KEPT]:
            del kept[old]
    return value  # type: ignore[return-value]
