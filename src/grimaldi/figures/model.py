"""What a figure is: pictures with captions, what the report claims of it, and what we find; plain frozen data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

Verdict = Literal["reproduced", "corrected", "bettered", "left out"]


@dataclass(frozen=True)
class Picture:
    """An image file in the page's folder."""

    file: str
    caption: str


@dataclass(frozen=True)
class Answer:
    """One claim of the report, and what is found of it."""

    claim: str
    verdict: Verdict
    found: str


@dataclass(frozen=True)
class Figure:
    """A figure of the page."""

    key: str
    title: str
    text: str
    pictures: tuple[Picture, ...]
    parameters: Mapping[str, str] = field(default_factory=dict)
    results: Mapping[str, str] = field(default_factory=dict)  # times and errors
    answers: tuple[Answer, ...] = ()


@dataclass(frozen=True)
class Settings:
    """Where pictures go, at which size, and where the benchmark data lies, if anywhere."""

    folder: Path
    full: bool = False
    data: Path | None = None

    @property
    def killeroo(self) -> Path | None:
        """The benchmark scene of the report's figure 5, where it is at hand."""
        path = None if self.data is None else self.data / "scenes" / "killeroo.xml"
        return path if path is not None and path.is_file() else None


Draw = Callable[[Settings], Figure]
