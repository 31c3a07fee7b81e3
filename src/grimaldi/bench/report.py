"""Rows as markdown, and as the page docs/performance.md."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Mapping, Sequence
from datetime import date
from importlib import metadata
from pathlib import Path

from grimaldi.bench.model import Result, Settings, Skipped, Target
from grimaldi.files import replacing
from grimaldi.machine import processor

PAGE = "performance.md"

INTRO = """# Performance

Every figure beside its yardstick, timed in the same run and in turn with it, written by

    grimaldi bench -o FOLDER

Times are medians of as many runs as `--runs` of a row says, after one untimed run, unless the row says otherwise.
A row stays as of its day until it is measured anew, as long as machine and versions are the same. Times of two
machines do not compare; ratios nearly do.
"""


def machine() -> dict[str, str]:
    """Processor, versions and variant that a time depends on."""
    import drjit as dr
    import mitsuba as mi

    return {
        "CPU": f"{processor()}, {os.cpu_count()} threads",
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
        **{name: metadata.version(name) for name in ("grimaldi", "mitsuba", "drjit", "numpy", "finufft")},
        "LLVM": ".".join(map(str, dr.detail.llvm_version())),
        "variant": str(mi.variant()),
    }


def head(where: Mapping[str, str]) -> str:
    """The start of the page; `where` as `machine` says it."""
    return f"{INTRO}\n{facts(where)}\n"


def page(sections: Mapping[str, str], where: Mapping[str, str]) -> str:
    """The whole page, of sections by the names of their rows."""
    from grimaldi.bench import ROWS

    there = {name: sections[name] for name in ROWS if name in sections}
    targets = [
        f"- [{name}](#{_anchor(name)}), {line.removeprefix('- ')}"
        for name, text in there.items()
        for line in text.splitlines()
        if line.startswith("- ")
    ]
    summary = ["## What was to be reached\n\n" + "\n".join(targets) + "\n"] if targets else []
    return "\n".join([head(where), *summary, *there.values()])


def kept(text: str, where: Mapping[str, str]) -> dict[str, str]:
    """The sections of an earlier page; none if machine or versions were others."""
    if not text.startswith(head(where) + "\n"):
        return {}
    sections = re.split(r"^## (?=\w+: )", text, flags=re.MULTILINE)[1:]
    return {section.partition(":")[0]: f"## {section.rstrip()}\n" for section in sections}


def section(name: str, row: Result | Skipped, settings: Settings) -> str:
    """One row under its heading."""
    from grimaldi.bench import ROWS

    title = f"## {name}: {ROWS[name]}\n"
    if isinstance(row, Skipped):
        return f"{title}\nNot measured: {row.why}.\n"
    small = " --quick`: small sizes, which show that the row works and nothing more" if settings.quick else "`"
    asked = f"Measured on {date.today()} by `--only {name} --runs {settings.runs} --seed {settings.seed}{small}.\n"
    said = "".join(f"- {target.what}: {measured(target)}, {target.verdict}\n" for target in row.targets)
    return "\n".join([title, row.text + "\n", asked, table(row.lines) + "\n", *([said] if said else [])])


def measured(target: Target) -> str:
    """A target's value beside the most that it may be."""
    value = "-" if target.value is None else _number(target.value, target.unit)
    return f"{value} (to reach: ≤ {_number(target.most, target.unit)})"


def write(name: str, row: Result | Skipped, settings: Settings, folder: Path) -> None:
    """Put a row into performance.md in `folder`, beside those that are there already."""
    path, where = folder / PAGE, machine()
    earlier = kept(path.read_text(encoding="utf-8"), where) if path.exists() else {}
    with replacing(path) as temporary:
        temporary.write_text(page({**earlier, name: section(name, row, settings)}, where), encoding="utf-8")


def table(rows: Sequence[Mapping[str, object]]) -> str:
    """A markdown table of all columns that rows have, in their order; "-" where one has nothing."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [[str(row.get(column, "-")).replace("|", "\\|") for column in columns] for row in rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in [columns, ["---"] * len(columns), *cells])


def facts(values: Mapping[str, object]) -> str:
    """A markdown table of names and values."""
    return table([{"": key, "value": value} for key, value in values.items()])


def _anchor(name: str) -> str:
    """The place of a row's heading in the page, as markdown's readers make it."""
    from grimaldi.bench import ROWS

    kept = "".join(c for c in f"{name}: {ROWS[name]}".lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def _number(value: float, unit: str) -> str:
    return f"{value:.3g}{' ' if unit and unit != '×' else ''}{unit}"
