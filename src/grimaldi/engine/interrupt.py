"""Ctrl-C that cannot get lost: raised within a callback from C++ it may be swallowed, or come out as another error."""

from __future__ import annotations

import signal
from types import FrameType

_asked = False


def listen() -> None:
    """From now on Ctrl-C raises KeyboardInterrupt where it falls and, if that was lost, at the next `check`."""
    signal.signal(signal.SIGINT, _interrupt)


def asked() -> bool:
    """Whether Ctrl-C was pressed."""
    return _asked


def check() -> None:
    """Raise KeyboardInterrupt if Ctrl-C was pressed."""
    if _asked:
        raise KeyboardInterrupt


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    global _asked
    _asked = True
    raise KeyboardInterrupt
