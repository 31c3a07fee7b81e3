"""The command `grimaldi`. Nothing heavy is imported before a command runs."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

from grimaldi.errors import GrimaldiWarning, InputError


def main() -> None:
    """Run the command line and exit: 0 done, 2 wrong input (one line), 130 interrupted, 1 anything else."""
    sys.exit(_run())


def _run() -> int:
    warnings.simplefilter("once", GrimaldiWarning)
    warnings.showwarning = _one_line(warnings.showwarning)
    try:
        import typer

        from grimaldi.cli.app import app

        try:
            return app(sys.argv[1:] or ["--help"], prog_name="grimaldi", standalone_mode=False) or 0
        except InputError as error:
            return _fail(error, 2)
        except typer.TyperException as error:
            return _fail(error.format_message(), 2)
        except OSError as error:  # a full disk, say
            return _fail(error, 1)
        except MemoryError:
            return _fail("out of memory", 1)
    except KeyboardInterrupt:
        return _fail("interrupted", 130)


def _fail(message: object, code: int) -> int:
    _say(str(message))
    return code


def _say(message: str) -> None:
    """One line on stderr."""
    print("grimaldi:", " ".join(message.split()), file=sys.stderr)


def _one_line(otherwise: Callable[..., None]) -> Callable[..., None]:
    """A `warnings.showwarning` that says Grimaldi's own on one line and leaves the others to `otherwise`."""

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, GrimaldiWarning):
            _say(f"warning: {message}")
        else:
            otherwise(message, category, *place, **more)

    return show
