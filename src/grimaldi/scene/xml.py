"""Checks a scene's XML before Mitsuba reads it: a file nested thousands deep ends the process there."""

from __future__ import annotations

from pathlib import Path
from xml.parsers import expat

from grimaldi.errors import InputError

DEEPEST = 200


def check_xml(path: Path) -> None:
    """Raises InputError where `path` or a file it includes cannot be read, is no XML or nests too deep."""
    _check(path, set(), {}, [path.parent])


def _check(path: Path, seen: set[Path], defaults: dict[str, str], folders: list[Path]) -> None:
    """The same; what `$name` stands for unless a file says so first, and where includes are looked for."""
    seen.add(path.resolve())
    included: list[str] = []
    depth = 0
    parser = expat.ParserCreate()

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            line = parser.CurrentLineNumber
            raise InputError(f"{path}, line {line}: nested deeper than {DEEPEST} elements; flatten the scene")
        if name == "include" and "filename" in attributes:
            included.append(attributes["filename"])
        elif name == "default" and "name" in attributes:
            defaults.setdefault(attributes["name"], attributes.get("value", ""))
        elif name == "path" and "value" in attributes:
            folders.append(path.parent / attributes["value"])

    def end(_name: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    try:
        parser.Parse(path.read_bytes(), True)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise InputError(
            f"{path}, line {error.lineno}: malformed XML ({reason}); correct it there, or just before"
        ) from error
    for name in included:
        for of in sorted(defaults, key=len, reverse=True):
            name = name.replace(f"${of}", defaults[of])
        for file in (folder / name for folder in dict.fromkeys([path.parent, *folders])):
            if file.is_file() and file.resolve() not in seen:  # a missing one Mitsuba names, with its line
                _check(file, seen, defaults, folders)
