"""Mitsuba's error messages, several lines with its own source's lines in them, as one line for the user."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from grimaldi.conventions import PLUGINS, did_you_mean

_SOURCE_LINE = re.compile(r"\[[\w.]+\.(?:cpp|h|inl):\d+\]\s*")
_CLASS = re.compile(r"\[[A-Z]\w+\] ")
_PLACE = re.compile(
    r"(?:Error while loading|While loading|At) "
    r'(?P<place>dictionary node "[^"]*"|[^\n]*? \(line \d+, col \d+\))(?:,|:) (?P<rest>.*)',
    re.DOTALL,
)
_PARSING = re.compile(
    r'(?:Parsing of|Error while loading) XML file "(?P<place>.*?)"(?: failed)?: (?P<rest>.*)', re.DOTALL
)
_UNKNOWN_PLUGIN = re.compile(r'Plugin "(?P<name>[^"]*)" not found')
_UNREFERENCED = re.compile(r"Found \d+ unreferenced propert\w+ in (?P<plugin>.*?):\n(?P<list>.*)", re.DOTALL)
_PROPERTY = re.compile(r'- \w+ "(?P<name>[^"]*)"')
_MISSING_PROPERTY = re.compile(r'Property "(?P<name>[^"]*)" cannot be found')
_MISSING_FILE = re.compile(
    r'file "(?P<mesh>[^"]*)": file not found|included file "(?P<include>[^"]*)" not found'
    r'|"(?P<other>[^"]*)": I/O error while attempting to open file: No such file'
)
_INSTANTIATE = re.compile(r'failed to instantiate (?P<kind>\w+(?: plugin)?) (?:plugin )?of type "(?P<type>[^"]*)": ')
_OWN_ERROR = re.compile(r"^(?:[\w.]*\.)?(?:InputError|NotYet): (?P<message>.*)\Z", re.MULTILINE | re.DOTALL)
_NO_TRIANGLES = ("Storing new normals in a Mesh", "operands have incompatible sizes")


def one_line(error: Exception) -> str:
    """Where Mitsuba met the error, what is wrong there and what to do, without line breaks."""
    text = _SOURCE_LINE.sub("", str(error)).strip()
    place = ""
    while (match := _PLACE.match(text) or _PARSING.match(text)) is not None:
        place, text = match["place"], match["rest"].strip()
    message = " ".join(_what(text).split())
    return f"{where(place)}: {message}" if place else message


def where(place: str) -> str:
    """`FILE, line N` of a file; a dictionary's node as it is."""
    return re.sub(r" \(line (\d+), col \d+\)", r", line \1", place)


def _what(text: str) -> str:
    """What is wrong, and what to do where the message tells enough for that."""
    if own := _OWN_ERROR.search(text):
        return own["message"]
    of = f" of {kind['type']!r}" if (kind := _INSTANTIATE.match(text)) else ""
    if match := _UNKNOWN_PLUGIN.search(text):
        advice = did_you_mean(match["name"], _plugin_names(), otherwise="check its spelling")
        return f"unknown plugin {match['name']!r}; {advice}"
    if match := _UNREFERENCED.search(text):
        names = ", ".join(repr(name) for name in _PROPERTY.findall(match["list"]))
        plugin = match["plugin"].rsplit('"', 2)[-2] if '"' in match["plugin"] else match["plugin"]
        return f"unknown parameter {names} of {plugin!r}; check its spelling"
    if match := _MISSING_PROPERTY.search(text):
        return f"parameter {match['name']!r}{of} is missing; give it"
    if match := _MISSING_FILE.search(text):
        name = match["mesh"] or match["include"] or match["other"]
        return f"file {name!r} not found; name it relative to the scene's folder"
    if any(sign in text for sign in _NO_TRIANGLES):
        return f"the mesh{of} is empty; give it at least one triangle"
    said = _CLASS.sub("", _INSTANTIATE.sub(lambda match: f"{match['type']!r}: ", text)).rstrip(" .!")
    return f"{said}; correct it there"


@cache
def _plugin_names() -> tuple[str, ...]:
    """Mitsuba's plugins, one shared library each, and Grimaldi's."""
    import mitsuba as mi

    libraries = (Path(str(mi.__file__)).parent / "plugins").iterdir()
    return tuple(sorted({file.name.partition(".")[0] for file in libraries} | {*PLUGINS}))
