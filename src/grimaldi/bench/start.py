"""From the command to the first picture, with no kernel compiled before and with all of them."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.timing import written
from grimaldi.scene import builtin

COLD, WARM = 6.0, 2.0  # seconds


def measure(settings: Settings) -> Result:
    if settings.quick:
        return first_pictures(("slit",), 8, settings)
    return first_pictures(builtin.names(), 128, settings)


def first_pictures(scenes: Sequence[str], size: int, settings: Settings) -> Result:
    """The command's seconds for size × size pixels of one sample, as a process; and of `--help`, for comparison."""
    lines, targets = [], []
    for scene in scenes:
        runs = [_cold_and_warm(scene, size, settings.seed) for _ in range(settings.runs)]
        cold, warm = map(statistics.median, zip(*runs, strict=True))
        lines.append({"": scene, "empty cache": written(cold), "full cache": written(warm)})
        targets += [
            Target(f"{scene}, empty cache", cold, COLD, "s"),
            Target(f"{scene}, full cache", warm, WARM, "s"),
        ]
    aid = statistics.median(_command(["--help"], os.environ) for _ in range(settings.runs))
    lines.append({"": "`--help`", "full cache": written(aid)})
    text = (
        f"`grimaldi render SCENE --size {size}x{size} --spp 1 -o OUT.png` as a process: start of Python, loading, "
        "compiling and writing included, at the default tolerance of 1e-3. The cache is Dr.Jit's, a new folder each "
        "time; the second picture finds the first one's kernels there."
    )
    return Result(text, tuple(lines), tuple(targets))


def _cold_and_warm(scene: str, size: int, seed: int) -> tuple[float, float]:
    with tempfile.TemporaryDirectory() as folder:
        cache, out = Path(folder, "cache"), Path(folder, "out.png")
        cache.mkdir()
        words = ["render", scene, "--size", f"{size}x{size}", "--spp", "1", "--seed", str(seed), "-o", str(out)]
        environment = {**os.environ, "DRJIT_CACHE_DIR": str(cache)}
        return _command(words, environment), _command(words, environment)


def _command(words: Sequence[str], environment: Mapping[str, str]) -> float:
    """The seconds of `grimaldi` with these words."""
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-m", "grimaldi", *words], check=True, capture_output=True, env=environment)
    return time.perf_counter() - begun
