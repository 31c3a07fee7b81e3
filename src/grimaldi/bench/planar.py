"""A circular hole at a square of points: `grimaldi.field` beside a plain finufft script, and other libraries.

The plain script is Barnett's method (JATIS 7(2) 021211) in its fewest lines: Fresnel's approximation, one wavelength,
one hole, no bound of the error. LightPipes and diffractio run in a process of their own, where a Python has them.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.timing import timed, written

Complexes = NDArray[np.complex128]
Reals = NDArray[np.float64]
Run = Callable[[], tuple[Complexes, float]]

RADIUS, DISTANCE, WAVELENGTH = 0.05, 550.0, 5e-7  # Fresnel number 9
WIDER = 2  # times, the square that the libraries compute: light needs room beside the hole
TOLERANCE = 1e-6
CHECKS = 50  # points at which fields are compared
PLAIN = 1.2  # times the plain script's time, at most
OTHERS = 0.1  # times the others' time, at most

LIBRARIES = {
    "LightPipes, Fresnel": """
import LightPipes as lp
def run():
    hole = lp.CircAperture(lp.Begin(n * step, wavelength, n), a)
    return lp.Fresnel(hole, z).field
assert abs(lp.Begin(n * step, wavelength, n).xvalues - x).max() < 1e-9 * a
""",
    "diffractio, RS": """
from diffractio.scalar_masks_XY import Scalar_mask_XY
def run():
    hole = Scalar_mask_XY(1e6 * x, 1e6 * x, 1e6 * wavelength)
    hole.circle(r0=(0, 0), radius=1e6 * a)
    return hole.RS(z=1e6 * z, new_field=True, verbose=False).u
""",
}
SETUP = """
import sys, time
import numpy as np
a, z, wavelength, step = {a}, {z}, {wavelength}, {step}
n = {n} * {wider}
asked = n // 2 + np.arange({n}) - {n} // 2
x = step * (np.arange(n) - n // 2)
"""
SERVE = """
run()
print("ready", flush=True)
for file in sys.stdin:
    begun = time.perf_counter()
    u = run()
    seconds = time.perf_counter() - begun
    np.save(file.strip(), u[np.ix_(asked, asked)])
    print("seconds", seconds, flush=True)
"""


class Absent(Exception):
    """A library that does not run, and why."""


class Other:
    """Another library in a Python of its own, which waits for its turns; raises Absent where it does not run."""

    def __init__(self, python: str, library: str, n: int, folder: Path) -> None:
        values = {
            **{"n": n, "a": RADIUS, "z": DISTANCE, "wavelength": WAVELENGTH},
            **{"step": 2 * RADIUS / n, "wider": WIDER},
        }
        self.file, self.said = folder / "u.npy", folder / "said"
        with self.said.open("w") as said:
            self.process = subprocess.Popen(
                [python, "-c", SETUP.format(**values) + library + SERVE],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=said,
                text=True,
            )
        self._wait_for("ready")

    def __call__(self) -> tuple[Complexes, float]:
        """U at the points, and the seconds of a run."""
        assert self.process.stdin is not None
        print(self.file, file=self.process.stdin, flush=True)
        (_, seconds) = self._wait_for("seconds").split()
        return np.load(self.file).ravel(), float(seconds)

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()

    def _wait_for(self, word: str) -> str:
        """The next line that starts with a word: libraries print of themselves."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith(word):
                return line
        self.close()
        raise Absent((self.said.read_text().strip().splitlines() or ["it ended"])[-1])


def measure(settings: Settings) -> Result:
    return compare(32 if settings.quick else 1024, settings)


def compare(n: int, settings: Settings) -> Result:
    """The field of a plane wave at n² points behind the hole, on the square about it."""
    side, points = square(n)
    hole = grimaldi.PlanarOutline.ellipse(np.diag([RADIUS, RADIUS, 1, 1]))
    light = {"type": "coherent_directional", "direction": [0, 0, 1]}
    scene = grimaldi.load({"type": "scene", "light": light}, outlines=[hole])

    def field() -> Complexes:
        return grimaldi.field(scene, points, wavelength=WAVELENGTH, tolerance=TOLERANCE).U.values[0, 0]

    def script() -> Complexes:
        return plain(RADIUS, DISTANCE, WAVELENGTH, side, TOLERANCE).ravel()

    chosen = np.random.default_rng(settings.seed).choice(len(points), CHECKS, replace=False)
    strict = {"tolerance": 1e-2 * TOLERANCE, "precision": "double", "fast": False}
    exact = grimaldi.field(scene, points[chosen], wavelength=WAVELENGTH, **strict).U.values[0, 0]

    runs: dict[str, Run] = {"`grimaldi.field`": lambda: timed(field), "plain finufft script": lambda: timed(script)}
    absent: dict[str, str] = {}
    others: dict[str, Other] = {}
    with tempfile.TemporaryDirectory() as folder:
        try:
            for name, library in LIBRARIES.items():
                try:
                    others[name] = Other(settings.peers or sys.executable, library, n, Path(folder))
                except Absent as error:
                    absent[name] = str(error)
            seconds, errors = _in_turn({**runs, **others}, settings.runs, chosen, exact)
        finally:
            for other in others.values():
                other.close()

    ours, theirs = (seconds[name] for name in runs)
    error = errors["`grimaldi.field`"]
    lines = [{"": name, "time": written(seconds[name]), "error": f"{errors[name]:.1e}"} for name in seconds]
    lines += [{"": name, "time": f"not run: {why}"} for name, why in absent.items()]
    targets = [Target("time / plain finufft script", ours / theirs, PLAIN, "×"), Target("error", error, TOLERANCE)]
    for name in LIBRARIES:
        there = name in seconds
        targets.append(Target(f"time / {name}", ours / seconds[name] if there else None, OTHERS, "×"))
        targets.append(Target(f"error / {name}", error / errors[name] if there else None, 1.0, "×"))
    text = (
        f"A plane wave through a circle of radius {RADIUS:g} at {n}² points, {2 * RADIUS:g} wide and {DISTANCE:g} "
        f"behind, λ = {WAVELENGTH:g}, tolerance {TOLERANCE:g}, all at the same points and in turn. The error is the "
        f"largest |ΔU| at {CHECKS} of them, |U0| = 1, against the line integral at a hundredth of the tolerance; the "
        "libraries compute a square twice as wide, since light needs room beside the hole, and their phase is compared "
        "but for a constant."
    )
    return Result(text, tuple(lines), tuple(targets))


def square(n: int) -> tuple[Reals, Reals]:
    """The coordinates (n,) of points along each side, and the points (n², 3) behind the hole, row by row."""
    side: Reals = (2.0 * RADIUS / n) * (np.arange(n, dtype=float) - n // 2)
    x, y = np.meshgrid(side, side)
    return side, np.stack([x, y, np.full_like(x, DISTANCE)], axis=-1).reshape(-1, 3)


def plain(a: float, z: float, wavelength: float, side: Reals, tolerance: float) -> Complexes:
    """U at side × side points of a plane wave through a circle, by Fresnel's integral."""
    import finufft

    k, n = 2 * np.pi / wavelength, len(side)
    phase = k * a * (a + np.sqrt(2) * abs(side).max()) / z
    n_r, n_t = int(phase / 4) + 20, int(phase) + 40
    r, w = np.polynomial.legendre.leggauss(n_r)
    r, w = 0.5 * a * (r + 1), 0.5 * a * w
    t = 2 * np.pi * np.arange(n_t) / n_t
    x, y = (np.outer(r, f(t)).ravel() for f in (np.cos, np.sin))
    c = np.repeat(w * r * np.exp(0.5j * k / z * r**2), n_t) * (2 * np.pi / n_t * k / (2j * np.pi * z))
    step = k / z * (side[1] - side[0])
    middle = side[n // 2]
    c = c * np.exp(-1j * k / z * middle * (x + y))
    u = finufft.nufft2d1(step * y, step * x, c, (n, n), isign=-1, eps=tolerance / 10)
    outer = np.exp(0.5j * k / z * side**2)
    u *= outer[:, None]
    u *= outer * np.exp(1j * k * z)
    return u


def _in_turn(
    runs: dict[str, Run], count: int, chosen: NDArray[np.int64], exact: Complexes
) -> tuple[dict[str, float], dict[str, float]]:
    """The median seconds of each, and its largest error at the chosen points, by a first run that is not timed."""
    errors = {name: _error(run()[0][chosen], exact, isinstance(run, Other)) for name, run in runs.items()}
    times = [{name: run()[1] for name, run in runs.items()} for _ in range(count)]
    return {name: statistics.median(turn[name] for turn in times) for name in runs}, errors


def _error(u: Complexes, exact: Complexes, turned: bool) -> float:
    """max |ΔU|, where `turned` but for a constant phase."""
    if turned:
        u = u * np.exp(1j * np.angle(np.vdot(u, exact)))
    return float(abs(u - exact).max())
