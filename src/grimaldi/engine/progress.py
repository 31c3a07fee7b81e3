"""A progress bar for whatever takes more than a second."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from grimaldi.engine.interrupt import check

if TYPE_CHECKING:
    from rich.progress import Progress


@contextmanager
def progress(total: int, label: str) -> Iterator[Callable[[int], None]]:
    """A bar of `total` steps with the time left on stderr; yields `advance(n)`.

    It shows after the first second, and never where stderr is not a terminal. `advance` raises
    KeyboardInterrupt where Ctrl-C was pressed and the exception got lost.
    """
    if not sys.stderr.isatty():
        yield lambda _: check()
        return

    bar: Progress | None = None
    done, begun = 0, monotonic()

    def advance(steps: int) -> None:
        nonlocal bar, done
        check()
        done += steps
        if bar is None and monotonic() - begun > 1:
            bar = _shown(total, label)
        if bar is not None:
            bar.update(bar.task_ids[0], completed=done)

    try:
        yield advance
    finally:
        if bar is not None:
            bar.stop()


def _shown(total: int, label: str) -> Progress:
    """A bar on stderr with one task; rich is loaded for those who see it."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    bar.add_task(label, total=total)
    bar.start()
    return bar
