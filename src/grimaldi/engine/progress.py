"""A progress bar for whatever takes more than a second."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from grimaldi.engine.interrupt import check


@contextmanager
def progress(total: int, label: str) -> Iterator[Callable[[int], None]]:
    """A bar of `total` steps with the time left on stderr; yields `advance(n)`.

    It shows after the first second, and never where stderr is not a terminal. `advance` raises
    KeyboardInterrupt where Ctrl-C was pressed and the exception got lost.
    """
    if not sys.stderr.isatty():
        yield lambda _: check()
        return

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
    task = bar.add_task(label, total=total)
    begun = monotonic()

    def advance(steps: int) -> None:
        check()
        bar.advance(task, steps)
        if not bar.live.is_started and monotonic() - begun > 1:
            bar.start()

    try:
        yield advance
    finally:
        if bar.live.is_started:
            bar.stop()
