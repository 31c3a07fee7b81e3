"""What a row of the benchmark is: times beside their yardstick, the error, what is to be reached; plain frozen data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class Target:
    """A figure and the most that it may be. `value` is None where the figure itself could not be measured."""

    what: str
    value: float | None
    most: float
    unit: str = ""

    @property
    def verdict(self) -> Literal["reached", "MISSED", "not measured"]:
        if self.value is None:
            return "not measured"
        return "reached" if self.value <= self.most else "MISSED"  # NaN misses


@dataclass(frozen=True)
class Result:
    """One row measured.

    text: what was timed, how, and what the error is of; lines: a table, each line by the names of the columns that it
    has something in.
    """

    text: str
    lines: tuple[Mapping[str, str], ...]
    targets: tuple[Target, ...] = ()


@dataclass(frozen=True)
class Skipped:
    """A row that cannot be measured here, and why."""

    why: str


@dataclass(frozen=True)
class Settings:
    """What all rows are asked for.

    seed: of scenes and random numbers; runs: timed ones, whose median counts; data: the folder of the benchmark data;
    peers: a Python that has LightPipes or diffractio, this one unless given; quick: small sizes, which show that all
    works and no more.
    """

    seed: int = 0
    runs: int = 5
    data: Path | None = None
    peers: str | None = None
    quick: bool = False

    def file(self, *names: str) -> Path | None:
        """A file of the benchmark data, where it is at hand."""
        path = None if self.data is None else self.data.joinpath(*names)
        return path if path is not None and path.is_file() else None


Measure = Callable[[Settings], Result | Skipped]
