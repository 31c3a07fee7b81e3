"""Peak memory of large pictures, each rendered in a process of its own: `python -m grimaldi.bench.memory` is one."""

from __future__ import annotations

import json
import re
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
TOLERANCE = 0.3
PATIENCE = 300.0  # for one process; one that takes longer is ended, and larger pictures are left out [s]
MOST = 4.0  # GB
FLAT = 1.1


class Peak(NamedTuple):
    """What a picture took: the largest resident size [GB], and seconds."""

    memory: float
    time: float
    segments: int


class Late(Exception):
    """A process was not done in time; `memory` is its largest resident size until then [GB], if known."""

    def __init__(self, memory: float | None) -> None:
        self.memory = memory


def measure(settings: Settings) -> Result:
    if settings.quick:
        return peaks(4, (8, 16), settings)
    return peaks(BODIES, FILMS, settings)


def peaks(number: int, films: Sequence[int], settings: Settings, patience: float = PATIENCE) -> Result:
    """Pictures of ever larger films, of one sample a pixel and of several, until one is not done in time."""
    found: dict[tuple[int, int], Peak] = {}
    lines: list[dict[str, str]] = []
    late = ""
    for size in films:
        for spp in SAMPLES:
            lines.append({"film": f"{size}²", "samples a pixel": f"{spp}"})
            if late:
                lines[-1]["time"] = f"left out: {late} was not done"
                continue
            try:
                took = found[size, spp] = _child(size, spp, number, settings.seed, patience)
            except Late as error:
                late = f"{size}², {spp} spp"
                lines[-1] |= {} if error.memory is None else {"peak memory": f"≥ {error.memory:.2f} GB until then"}
                lines[-1]["time"] = f"left out: not done in {patience:g} s"
            else:
                lines[-1] |= {
                    "outline segments": f"{took.segments:,}",
                    "peak memory": f"{took.memory:.2f} GB",
                    "time": written(took.time),
                }
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


def _child(size: int, spp: int, number: int, seed: int, patience: float) -> Peak:
    """A picture in a process; raises Late where it is not done in `patience` seconds."""
    words = [str(word) for word in (size, spp, number, seed)]
    with subprocess.Popen(
        [sys.executable, "-m", "grimaldi.bench.memory", *words], stdout=subprocess.PIPE, text=True
    ) as child:
        try:
            said, _ = child.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            raise Late(_resident(child.pid)) from None
        finally:
            child.kill()
    if child.returncode:
        raise subprocess.CalledProcessError(child.returncode, child.args)
    return Peak(**json.loads(said.splitlines()[-1]))


def peak() -> float:
    """The largest resident size of this process so far [GB]."""
    import resource

    known = _resident("self")  # ru_maxrss counts what the parent held when it started this process
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e9 if known is None else known


def _resident(process: int | str) -> float | None:
    """The largest resident size of a running process so far [GB], where the system tells."""
    status = Path("/proc", str(process), "status")
    found = re.search(r"^VmHWM:\s+(\d+) kB", status.read_text(), re.MULTILINE) if status.exists() else None
    return None if found is None else int(found[1]) * 1024 / 1e9


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
