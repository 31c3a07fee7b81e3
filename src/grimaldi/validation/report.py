"""Cases as rows of a table, as JSON and as the page docs/accuracy.md."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from grimaldi.files import replacing
from grimaldi.validation.model import Case
from grimaldi.validation.plot import plot

IMAGES = Path("images") / "accuracy"

INTRO = """# Accuracy

Closed forms of `grimaldi.reference` against `grimaldi.field`, written by

    grimaldi validate -o docs

Errors are the largest |ΔM| along the plotted line, M = U/U₀, unless a row says otherwise; digits are -log₁₀ of that.
`asked` is the tolerance that `field` was given, always with `precision="double"`; `remainder` is how far at most the
reference is from Kirchhoff's integral itself, where it is Fresnel's approximation or a far field, or what rounding
path lengths costs; for the starshade, how near to the published field we promise to be. A promise is kept where the
error is within both. References of another model (boundary conditions, double diffraction) are no promise: their rows
state how far a black screen is from them; see [limits.md](limits.md).
"""


def digits(case: Case) -> str:
    return f"{case.digits:.1f}" if math.isfinite(case.digits) else ("all" if case.digits > 0 else "none")


def header(names: Sequence[str]) -> str:
    """The head of the printed table."""
    width = max(map(len, names))
    return f"{'case':{width}}  {'digits':>6}  {'error':>7}  {'asked':>7}  {'remainder':>9}  {'time':>7}  verdict"


def row(case: Case, names: Sequence[str]) -> str:
    """A case's row of the printed table, and below it the reference and the statement."""
    width = max(map(len, names))
    numbers = f"{digits(case):>6}  {case.error:7.1e}  {_or_none(case.tolerance):>7}  {_or_none(case.remainder):>9}"
    return (
        f"{case.name:{width}}  {numbers}  {case.seconds:5.2f} s  {case.verdict}"
        f"  {case.regime}, {case.reference}: {case.statement}"
    )


def as_json(cases: Sequence[Case]) -> dict[str, Any]:
    """Versions and cases as plain data."""
    return {
        "versions": versions(),
        "cases": [
            {
                "name": case.name,
                "regime": case.regime,
                "reference": case.reference,
                "error": case.error if math.isfinite(case.error) else None,
                "digits": case.digits if math.isfinite(case.digits) else None,
                "tolerance": case.tolerance,
                "remainder": case.remainder,
                "seconds": case.seconds,
                "verdict": case.verdict,
                "statement": case.statement,
            }
            for case in cases
        ],
    }


def versions() -> dict[str, str]:
    named = {name: version(name) for name in ("grimaldi", "mitsuba", "drjit", "numpy", "scipy")}
    return {**named, "python": platform.python_version()}


def write(cases: Sequence[Case], folder: Path) -> Path:
    """accuracy.md and its plots in `folder`; the path of the page."""
    images = folder / IMAGES
    images.mkdir(parents=True, exist_ok=True)
    for case in cases:
        plot(case, images / f"{case.name}.png")
    path = folder / "accuracy.md"
    with replacing(path) as temporary:
        temporary.write_text(page(cases), encoding="utf-8")
    return path


def page(cases: Sequence[Case]) -> str:
    """The whole page."""
    written = ", ".join(f"{name} {number}" for name, number in versions().items())
    promises, statements = ([c for c in cases if c.is_promise is kind] for kind in (True, False))
    parts = [INTRO, f"Written with {written}. Times are of one machine, compiling included.\n"]
    for title, some in (("Promises", promises), ("How far other models are", statements)):
        if some:
            parts.append(f"## {title}\n\n{_table(some)}")
    parts.append("## Plots\n\nAbove, values computed and by the reference; below, their difference.\n")
    parts += [
        f"### {case.name}\n\n{_sentence(case.statement)}\n\n![{case.name}]({IMAGES.as_posix()}/{case.name}.png)\n"
        for case in cases
    ]
    return "\n".join(parts)


def _table(cases: Sequence[Case]) -> str:
    lines = [
        "| case | reference | regime | digits | error | asked | remainder | time | verdict | statement |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for case in cases:
        numbers = f"{digits(case)} | {case.error:.1e} | {_or_none(case.tolerance)} | {_or_none(case.remainder)}"
        statement = case.statement.replace("|", "\\|")
        lines.append(
            f"| [{case.name}](#{case.name}) | `{case.reference}` | {case.regime} | {numbers} | {case.seconds:.2g} s"
            f" | {case.verdict} | {statement} |"
        )
    return "\n".join(lines) + "\n"


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:].replace("|", "\\|") + "."


def _or_none(value: float) -> str:
    return f"{value:.1e}" if value else "-"
