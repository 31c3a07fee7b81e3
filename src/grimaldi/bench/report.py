"""Rows as markdown, and as the page docs/performance.md."""

from __future__ import annotations

import os
import platform
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

    grimaldi bench -o docs

Times are medians of {runs} runs after one untimed run, unless a row says otherwise; scenes come from `--seed {seed}`.
Times of two machines do not compare; ratios nearly do.
"""
QUICK = """
These are the small sizes of `--quick`: they show that every row works, and nothing of the figures to reach.
"""


def machine() -> dict[str, str]:
    """Processor, versions and variant that a time depends on, and the day."""
    import drjit as dr
    import mitsuba as mi

    return {
        "CPU": f"{processor()}, {os.cpu_count()} threads",
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
        **{name: metadata.version(name) for name in ("grimaldi", "mitsuba", "drjit", "numpy", "finufft")},
        "LLVM": ".".join(map(str, dr.detail.llvm_version())),
        "variant": str(mi.variant()),
        "date": date.today().isoformat(),
    }


def page(rows: Mapping[str, Result | Skipped], settings: Settings, where: Mapping[str, str]) -> str:
    """The whole page; `where` as `machine` says it."""
    targets = [(name, target) for name, row in rows.items() if isinstance(row, Result) for target in row.targets]
    parts = [INTRO.format(runs=settings.runs, seed=settings.seed) + (QUICK if settings.quick else "")]
    parts.append(facts(where) + "\n")
    if targets:
        parts.append("## What was to be reached\n\n" + table([_summary(*target) for target in targets]) + "\n")
    parts += [section(name, row) for name, row in rows.items()]
    return "\n".join(parts)


def section(name: str, row: Result | Skipped) -> str:
    """One row under its heading."""
    from grimaldi.bench import ROWS

    title = ROWS[name]
    head = f"## {name}: {title}\n"
    if isinstance(row, Skipped):
        return f"{head}\nNot measured: {row.why}.\n"
    said = "".join(f"- {target.what}: {measured(target)}, {target.verdict}\n" for target in row.targets)
    return "\n".join([head, row.text + "\n", table(row.lines) + "\n", *([said] if said else [])])


def measured(target: Target) -> str:
    """A target's value beside the most that it may be."""
    value = "-" if target.value is None else _number(target.value, target.unit)
    return f"{value} (to reach: ≤ {_number(target.most, target.unit)})"


def write(rows: Mapping[str, Result | Skipped], settings: Settings, folder: Path) -> Path:
    """performance.md in `folder`; its path."""
    path = folder / PAGE
    with replacing(path) as temporary:
        temporary.write_text(page(rows, settings, machine()), encoding="utf-8")
    return path


def table(rows: Sequence[Mapping[str, object]]) -> str:
    """A markdown table with the keys of the first row as its head."""
    head = list(rows[0])
    lines = [head, ["---"] * len(head), *([str(row[key]).replace("|", "\\|") for key in head] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def facts(values: Mapping[str, object]) -> str:
    """A markdown table of names and values."""
    return table([{"": key, "value": value} for key, value in values.items()])


def _summary(name: str, target: Target) -> dict[str, str]:
    return {
        "row": f"[{name}](#{_anchor(name)})",
        "figure": target.what,
        "measured": "-" if target.value is None else _number(target.value, target.unit),
        "to reach": f"≤ {_number(target.most, target.unit)}",
        "": target.verdict,
    }


def _anchor(name: str) -> str:
    """The place of a row's heading in the page, as markdown's readers make it."""
    from grimaldi.bench import ROWS

    kept = "".join(c for c in f"{name}: {ROWS[name]}".lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def _number(value: float, unit: str) -> str:
    return f"{value:.3g}{' ' if unit and unit != '×' else ''}{unit}"
