"""What the command says on stderr: a line for each thing."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

from grimaldi._import_hook import after_import
from grimaldi.errors import GrimaldiWarning


def say(message: object) -> None:
    """One line on stderr."""
    print("grimaldi:", " ".join(str(message).split()), file=sys.stderr)


def fail(message: object, code: int) -> int:
    """`code`, once the message is said."""
    say(message)
    return code


def one_line_each() -> None:
    """Have Grimaldi's warnings and Mitsuba's said on a line each, Grimaldi's once."""
    warnings.simplefilter("once", GrimaldiWarning)
    warnings.showwarning = _showing(warnings.showwarning)
    after_import("mitsuba", _take_over_log)


def _showing(otherwise: Callable[..., None]) -> Callable[..., None]:
    """A `warnings.showwarning` that leaves all but Grimaldi's own to `otherwise`."""

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, GrimaldiWarning):
            say(f"warning: {message}")
        else:
            otherwise(message, category, *place, **more)

    return show


def _take_over_log() -> None:
    """Mitsuba's own log goes to stdout, in colour."""
    import mitsuba as mi

    class Lines(mi.Appender):
        def append(self, level: mi.LogLevel, text: str) -> None:
            # `field` computes in a mono variant whatever film the scene has: nothing to warn about.
            if level >= mi.LogLevel.Warn and "Monochrome mode enabled" not in text:
                _date, _time, _level, message = text.split(maxsplit=3)
                say(f"warning: {message}")

        def log_progress(self, progress: float, name: str, formatted: str, eta: str, ptr: Any = None) -> None:
            pass  # Grimaldi shows its own

    logger = mi.logger()  # pyright: ignore[reportCallIssue]  (the stubs declare it as a bare object)
    logger.clear_appenders()
    logger.add_appender(Lines())
