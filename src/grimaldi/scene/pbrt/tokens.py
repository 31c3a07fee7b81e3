"""A pbrt file as words, texts, numbers and brackets, each with its file and line."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Literal, NamedTuple

from grimaldi.errors import InputError

_TOKEN = re.compile(r'\#[^\n]*|(?P<text>"(?:[^"\\\n]|\\.)*")|(?P<open>")|(?P<bracket>[\[\]])|(?P<word>[^\s\[\]"#]+)')


class Place(NamedTuple):
    """Where something stands in a file."""

    path: Path
    line: int

    def error(self, what: str) -> InputError:
        """An InputError that names the place."""
        return InputError(f"{self.path}, line {self.line}: {what}")


class Token(NamedTuple):
    """A word or bracket as it is written, a text without its quotes, or a number."""

    kind: Literal["word", "text", "number", "bracket"]
    text: str
    place: Place

    @property
    def number(self) -> float:
        """The number of a token of that kind; InputError where it is not finite."""
        value = float(self.text)
        if not isfinite(value):
            raise self.place.error(f"{self.text!r} is not finite; give a number")
        return value


def tokens(path: Path) -> Iterator[Token]:
    """The tokens of a file, without its comments.

    Raises InputError for a file that cannot be read and a text without its closing quote.
    """
    try:
        content = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    ends = [match.start() for match in re.finditer("\n", content)]
    for match in _TOKEN.finditer(content):
        place = Place(path, bisect_right(ends, match.start()) + 1)
        if match["open"]:
            raise place.error('a text is not closed; end it with "')
        if text := match["text"]:
            yield Token("text", text[1:-1], place)
        elif bracket := match["bracket"]:
            yield Token("bracket", bracket, place)
        elif word := match["word"]:
            yield Token("number" if _is_number(word) else "word", word, place)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
