"""What the benchmarks share: where their data lies, the machine they ran on, and tables in markdown."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path

SHARED = Path(__file__).resolve().parents[2] / "shared"


def machine() -> dict[str, str]:
    """Processor and versions that a timing depends on."""
    import drjit as dr
    import mitsuba as mi

    return {
        "CPU": f"{_processor()}, {os.cpu_count()} threads",
        "Python": platform.python_version(),
        **{name: metadata.version(name) for name in ("grimaldi", "mitsuba", "drjit")},
        "LLVM": ".".join(map(str, dr.detail.llvm_version())),
        "variant": str(mi.variant()),
    }


def table(rows: Sequence[Mapping[str, object]]) -> str:
    """A markdown table with the keys of the first row as its head."""
    head = list(rows[0])
    lines = [head, ["---"] * len(head), *([str(row[key]) for key in head] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def facts(values: Mapping[str, object]) -> str:
    """A markdown table of names and values."""
    return table([{"": key, "value": value} for key, value in values.items()])


def _processor() -> str:
    try:
        with Path("/proc/cpuinfo").open() as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
