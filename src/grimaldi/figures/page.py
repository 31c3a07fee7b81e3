"""The page: figures with captions, parameters, times and errors, and a table of the report's claims, as plain HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from html import escape
from importlib.metadata import version

from grimaldi.figures.model import Answer, Figure

STYLE = """
:root { color-scheme: light dark; --ink: #1b1b1b; --paper: #fdfdfb; --faint: #6a6a6a; --line: #d9d7d0; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e4de; --paper: #171716; --faint: #a09e97; --line: #3a3936; } }
body { font: 17px/1.55 Charter, Georgia, serif; color: var(--ink); background: var(--paper); margin: 0 auto;
  max-width: 72rem; padding: 2.5rem 1.5rem 5rem; }
h1 { font-size: 2rem; line-height: 1.2; margin: 0 0 .5rem; }
h2 { font-size: 1.35rem; margin: 3.5rem 0 .4rem; border-top: 1px solid var(--line); padding-top: 1.2rem; }
p { max-width: 44rem; } figure { margin: 1.2rem 0; overflow-x: auto; }
img { max-width: 100%; height: auto; background: white; display: block; }
figcaption, .faint { color: var(--faint); font-size: .92rem; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .95rem; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .35rem 1rem .35rem 0; border-bottom: 1px solid var(--line); }
th { font-weight: normal; color: var(--faint); width: 24%; } td:last-child { padding-right: 0; }
b { font-weight: 600; } nav a { margin-right: 1rem; color: inherit; white-space: nowrap; }
"""

TEXTUAL = (
    Answer(
        "Secondary sources spaced under the Nyquist limit; results at 1 and 3 sources an edge by a user variable.",
        "reproduced",
        '`n`, an integer or "nyquist": `--diffraction huygens --n nyquist`.',
    ),
    Answer(
        "Cylinders and cones would be easy to add.",
        "reproduced",
        "Cylinders are shapes of their own, cones meshes.",
    ),
    Answer(
        "Apertures and opaque bodies are two sides of one sum (Babinet).",
        "reproduced",
        "Holes by eq. 4, bodies by eq. 5; `area`, which integrates the opening, agrees with `boundary`, which follows "
        "its border, to rounding.",
    ),
    Answer(
        "The summed sources give the diffracted field.",
        "corrected",
        "Equal or length-proportional strengths converge to another integral than Kirchhoff's (amplitudes off by 0.1 "
        "to 3.5 times); with the kernel's weights they converge to it, to second order in the spacing.",
    ),
)


def page(figures: Sequence[Figure], missing: Sequence[str] = ()) -> str:
    """The whole page."""
    answers = [answer for figure in figures for answer in figure.answers] + list(TEXTUAL)
    links = "".join(f'<a href="#figure-{f.key}">{f.key} {escape(f.title)}</a> ' for f in figures)
    notes = "".join(f'<p class="faint">{escape(note)}</p>' for note in missing)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Ray-tracing interference and diffraction, again</title>
<style>{STYLE}</style>
</head>
<body>
<h1>Ray-tracing interference and diffraction, again</h1>
<p>Every figure of D. Johnston and P. Tarjan's report (Stanford CS348b, 2006), by its own method and by Grimaldi's, with
times and errors. Lengths are in the scene's units, or in wavelengths where said.</p>
<p class="faint">Grimaldi {version("grimaldi")}, Mitsuba {version("mitsuba")}, {date.today().isoformat()}. Written by
<code>grimaldi figures</code>.</p>
{notes}
<nav>{links}<a href="#claims">Claims</a></nav>
{"".join(_figure(figure) for figure in figures)}
<h2 id="claims">The report's claims</h2>
{_claims(answers)}
</body>
</html>
"""


def _figure(figure: Figure) -> str:
    pictures = "".join(
        f'<figure><a href="{escape(p.file)}"><img src="{escape(p.file)}" alt="{escape(p.caption)}"></a>'
        f"<figcaption>{escape(p.caption)}</figcaption></figure>\n"
        for p in figure.pictures
    )
    return (
        f'<h2 id="figure-{escape(figure.key)}">{escape(figure.key)}. {escape(figure.title)}</h2>\n'
        f"<p>{escape(figure.text)}</p>\n{pictures}{_table({**figure.parameters, **figure.results})}"
    )


def _table(rows: Mapping[str, str]) -> str:
    body = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>\n" for name, value in rows.items())
    return f"<table>{body}</table>\n"


def _claims(answers: Sequence[Answer]) -> str:
    body = "".join(
        f"<tr><td>{escape(a.claim)}</td><td><b>{escape(a.verdict)}</b></td><td>{escape(a.found)}</td></tr>\n"
        for a in answers
    )
    return f"<table>{body}</table>\n"
