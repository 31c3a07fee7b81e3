"""Peak memory of large pictures, each rendered in a process of its own: `python -m grimaldi.bench.memory` is one."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import grimaldi
from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.scenes import WAVELENGTH, bodies
from grimaldi.bench.timing import timed, written

BODIES = 3_000  # of 33 silhouette edges each
FILMS = (64, 256, 1024, 4096)
SAMPLES = (1, 4)
TOLERANCE = 2e-2
PATIENCE = 300.0  # a picture that is expected to take longer is left out [s]
MOST = 4.0  # GB
FLAT = 1.1


class Peak(NamedTuple):
    """What a picture took: the largest resident size [GB], and seconds."""

    memory: float
    time: float
    segments: int


def measure(settings: Settings) -> Result:
    if settings.quick:
        return peaks(4, (8, 16), settings)
    return peaks(BODIES, FILMS, settings)


def peaks(number: int, films: Sequence[int], settings: Settings, patience: float = PATIENCE) -> Result:
    """Pictures of ever larger films, of one sample a pixel and of several, as long as they are expected to be done."""
    found: dict[tuple[int, int], Peak] = {}
    lines = []
    for size in films:
        for spp in SAMPLES:
            expected = min((p.time * (size / s) ** 2 * spp / n for (s, n), p in found.items()), default=0.0)
            if expected > patience:
                lines.append(_line(size, spp, time=f"left out: at most {expected:.2g} s expected"))
                continue
            took = found[size, spp] = _child(size, spp, number, settings.seed)
            lines.append(
                _line(
                    size,
                    spp,
                    segments=f"{took.segments:,}",
                    memory=f"{took.memory:.2f} GB",
                    time=written(took.time),
                )
            )
    last = [found[films[-1], spp].memory for spp in SAMPLES if (films[-1], spp) in found]
    both = len(last) == len(SAMPLES)
    text = (
        f"{number:,} bodies in one mesh over a floor, in one plane wave, tolerance {TOLERANCE:g}: a process that loads "
        "the scene and renders it once, its largest resident size, and the seconds of the rendering."
    )
    film = f"{films[-1]}² pixels"
    targets = (
        Target(film, max(last) if both else None, MOST, "GB"),
        Target(f"{film}, {SAMPLES[-1]} samples a pixel / 1", last[-1] / last[0] if both else None, FLAT, "×"),
    )
    return Result(text, tuple(lines), targets)


def _line(size: int, spp: int, *, segments: str = "-", memory: str = "-", time: str) -> dict[str, str]:
    return {
        "film": f"{size}²",
        "samples a pixel": f"{spp}",
        "outline segments": segments,
        "peak memory": memory,
        "time": time,
    }


def _child(size: int, spp: int, number: int, seed: int) -> Peak:
    words = [str(word) for word in (size, spp, number, seed)]
    done = subprocess.run(
        [sys.executable, "-m", "grimaldi.bench.memory", *words], check=True, stdout=subprocess.PIPE, text=True
    )
    return Peak(**json.loads(done.stdout.splitlines()[-1]))


def peak() -> float:
    """The largest resident size of this process so far [GB]."""
    import resource

    status = Path("/proc/self/status")
    if status.exists():  # ru_maxrss counts what the parent held when it started this process
        (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024 / 1e9
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e9


def main() -> None:
    """Render once, and print a `Peak` as JSON."""
    import warnings

    from grimaldi.errors import GrimaldiWarning
    from grimaldi.variants import ensure_variant

    warnings.simplefilter("ignore", GrimaldiWarning)
    size, spp, number, seed = map(int, sys.argv[1:])
    ensure_variant("rgb")
    scene = grimaldi.load(bodies(number, seed=seed, size=size, spp=spp, joined=True))
    _, time = timed(lambda: grimaldi.render(scene, wavelength=WAVELENGTH, seed=seed, tolerance=TOLERANCE))
    memory = peak()  # before the outline is found once more
    print(json.dumps(Peak(memory, time, len(grimaldi.outline(scene)))._asdict()))


if __name__ == "__main__":
    main()
