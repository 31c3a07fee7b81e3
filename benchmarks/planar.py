"""A circular hole at a square of points: `grimaldi.field` beside a plain finufft script, and other libraries.

The plain script is Barnett's method (JATIS 7(2) 021211) in its fewest lines: Fresnel's approximation, one wavelength,
one hole, no bound of the error. LightPipes and diffractio run where --lightpipes and --diffractio name a Python that
has them, on the points' grid, --wider since light needs room beside the hole, and --finer if asked; their phase is
compared but for a constant. All are held against the line integral at some of the points. Runs take turns, so that
what else the machine does slows all of them.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import finufft
import numpy as np
import report
from numpy.typing import NDArray

import grimaldi
from grimaldi.reference import circle

Complex = NDArray[np.complex128]

LIGHTPIPES = """
import LightPipes as lp
def run():
    hole = lp.CircAperture(lp.Begin(n * step, wavelength, n), a)
    return lp.Fresnel(hole, z).field
assert abs(lp.Begin(n * step, wavelength, n).xvalues - x).max() < 1e-9 * a
"""
DIFFRACTIO = """
from diffractio.scalar_masks_XY import Scalar_mask_XY
def run():
    hole = Scalar_mask_XY(1e6 * x, 1e6 * x, 1e6 * wavelength)
    hole.circle(r0=(0, 0), radius=1e6 * a)
    return hole.RS(z=1e6 * z, new_field=True, verbose=False).u
"""
SETUP = """
import sys, time
import numpy as np
a, z, wavelength, finer = {a}, {z}, {wavelength}, {finer}
n, step = {n} * finer * {wider}, {step} / finer
asked = n // 2 + finer * (np.arange({n}) - {n} // 2)
x = step * (np.arange(n) - n // 2)
"""
SERVE = """
run()
while True:
    line = sys.stdin.readline()
    if not line:
        break
    start = time.perf_counter()
    u = run()
    seconds = time.perf_counter() - start
    np.save(line.strip(), u[np.ix_(asked, asked)])
    print("seconds", seconds, flush=True)
"""


class Other:
    """Another library in a Python of its own, which waits for its turns."""

    def __init__(self, python: str, text: str, folder: Path, **values: Any) -> None:
        self.file = folder / "u.npy"
        # what the library says of itself goes elsewhere
        self.process = subprocess.Popen(
            [python, "-c", SETUP.format(**values) + text + SERVE],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def __call__(self) -> tuple[float, Complex]:
        """Seconds of a run, and U at the points."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(self.file, file=self.process.stdin, flush=True)
        for line in self.process.stdout:
            if line.startswith("seconds "):
                return float(line.split()[1]), np.load(self.file).ravel()
        raise SystemExit("a library failed: run its lines in this file by its own Python to see why")


def script(a: float, z: float, wavelength: float, side: NDArray[np.float64], tolerance: float) -> Complex:
    """U at side × side points of a plane wave through a circle, by Fresnel's integral."""
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


def timed(run: Callable[[], Complex]) -> tuple[float, Complex]:
    start = time.perf_counter()
    u = run()
    return time.perf_counter() - start, u


def errors(u: Complex, exact: Complex, turned: bool) -> dict[str, str]:
    """How far u is from `exact`, where `turned` but for a constant phase."""
    if turned:
        u = u * np.exp(1j * np.angle(np.vdot(u, exact)))
    off = np.abs(u - exact)
    return {"largest error": f"{off.max():.2g}", "rms error": f"{np.sqrt((off**2).mean()):.2g}"}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").split("\n", 1)[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--size", type=int, default=1024, help="points along a side")
    parser.add_argument("--radius", type=float, default=0.05)
    parser.add_argument("--distance", type=float, default=550.0)
    parser.add_argument("--wavelength", type=float, default=5e-7)
    parser.add_argument("--half-side", type=float, default=None, help="of the square; the radius unless given")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--checks", type=int, default=50, help="points compared with the line integral")
    parser.add_argument("--finer", type=int, default=1, help="times, the grid of the two libraries")
    parser.add_argument("--wider", type=int, default=2, help="times, the square that they compute")
    parser.add_argument("--lightpipes", help="a Python that has LightPipes")
    parser.add_argument("--diffractio", help="a Python that has diffractio")
    args = parser.parse_args()

    a, z, wavelength, n = args.radius, args.distance, args.wavelength, args.size
    step = 2 * (args.half_side or a) / n
    side = step * (np.arange(n) - n // 2)
    x, y = np.meshgrid(side, side)
    points = np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3)
    hole = grimaldi.PlanarOutline.ellipse(np.diag([a, a, 1, 1]))
    light = {"type": "coherent_directional", "direction": [0, 0, 1]}
    scene = grimaldi.load({"type": "scene", "light": light}, outlines=[hole])

    def ours(where: NDArray[np.float64] = points, tolerance: float = args.tolerance, **options: Any) -> Complex:
        return grimaldi.field(scene, where, wavelength=wavelength, tolerance=tolerance, **options).U.values[0, 0]

    def plain() -> Complex:
        return script(a, z, wavelength, side, args.tolerance).ravel()

    chosen = np.random.default_rng(0).choice(len(points), args.checks, replace=False)
    line = ours(points[chosen], 1e-2 * args.tolerance, precision="double", fast=False)
    axis = np.array([[0, 0, z]])
    on_axis = abs(abs(ours(axis, fast=False)[0]) - abs(circle.fresnel(a, z, wavelength)))
    values = {"n": n, "a": a, "z": z, "wavelength": wavelength, "step": step, "finer": args.finer, "wider": args.wider}
    others = (("LightPipes, Fresnel", args.lightpipes, LIGHTPIPES), ("diffractio, RS", args.diffractio, DIFFRACTIO))
    with tempfile.TemporaryDirectory() as folder:
        ways: dict[str, Callable[[], tuple[float, Complex]]] = {
            "grimaldi.field": lambda: timed(ours),
            "plain finufft script": lambda: timed(plain),
            **{name: Other(python, text, Path(folder), **values) for name, python, text in others if python},
        }
        times: dict[str, list[float]] = {name: [] for name in ways}
        u = {name: run()[1] for name, run in ways.items()}  # the first run compiles
        for _ in range(args.runs):
            for name, run in ways.items():
                times[name].append(run()[0])
    us = statistics.median(times["grimaldi.field"])
    rows = [
        {
            "": name,
            "seconds": f"{statistics.median(times[name]):.3f}",
            "over ours": f"{statistics.median(times[name]) / us:.2f}",
            **errors(u[name][chosen], line, turned=isinstance(run, Other)),
        }
        for name, run in ways.items()
    ]
    print(f"{n}² points, N = {a * a / wavelength / z:.3g}, tolerance {args.tolerance:g}, medians of {args.runs}\n")
    print(report.table(rows), end="\n\n")
    print(report.facts({"line integral beside Fresnel's on the axis": f"{on_axis:.2g}", **report.machine()}))


if __name__ == "__main__":
    main()
