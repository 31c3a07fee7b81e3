"""The command `grimaldi`. Nothing heavy is imported before a command runs."""

from __future__ import annotations

import os
import sys
from contextlib import suppress

from grimaldi.cli.messages import fail, one_line_each
from grimaldi.engine.interrupt import asked, listen
from grimaldi.errors import InputError

INTERRUPTED = 130


def main() -> None:
    """Run the command line and exit: 0 done, 2 wrong input (one line), 130 interrupted, 1 anything else."""
    listen()
    code = run(sys.argv[1:])
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # a full disk is said already
            stream.flush()
    os._exit(code)  # Mitsuba and Dr.Jit take an eighth of a second to free their memory


def run(arguments: list[str]) -> int:
    """Run the command line, and return what it exits with."""
    one_line_each()
    try:
        import typer

        from grimaldi.cli.app import app

        try:
            code = app(arguments or ["--help"], prog_name="grimaldi", standalone_mode=False) or 0
            if code == INTERRUPTED:  # typer takes Ctrl-C for itself, and says nothing
                raise KeyboardInterrupt
            sys.stdout.flush()
            return code
        except InputError as error:
            return fail(error, 2)
        except typer.TyperException as error:
            return fail(error.format_message(), 2)
        except OSError as error:  # a full disk, say
            return fail(error, 1)
        except MemoryError:
            return fail("out of memory: ask for fewer points, pixels or samples at once", 1)
    except KeyboardInterrupt:
        return fail("interrupted", INTERRUPTED)
    except Exception:
        if asked():  # Dr.Jit wraps what is raised while it records a kernel
            return fail("interrupted", INTERRUPTED)
        raise
