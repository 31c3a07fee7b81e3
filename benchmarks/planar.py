"""A circular hole at a square of points: `grimaldi.field` beside a plain finufft script, and other libraries.

The plain script is Barnett's method (JATIS 7(2) 021211) in its fewest lines: Fresnel's approximation, one wavelength,
one hole, no bound of the error. LightPipes and diffractio are timed where --lightpipes and --diffractio name a Python
that has them.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import time
from collections.abc import Callable
from typing import Any

import finufft
import numpy as np
import report
from numpy.typing import NDArray

import grimaldi
from grimaldi.reference import circle

Complex = NDArray[np.complex128]

LIGHTPIPES = """
import time, LightPipes as lp
n, a, z, wavelength = {n}, {a}, {z}, {wavelength}
def run():
    field = lp.CircAperture(lp.Begin(4 * a, wavelength, n), a)
    return lp.Fresnel(field, z)
"""
DIFFRACTIO = """
import time, numpy as np
from diffractio.scalar_masks_XY import Scalar_mask_XY
n, a, z, wavelength = {n}, {a}, {z}, {wavelength}
x = np.linspace(-2 * a, 2 * a, n)
def run():
    mask = Scalar_mask_XY(x, x, wavelength)
    mask.circle(r0=(0, 0), radius=a)
    return mask.RS(z=z, new_field=True, verbose=False)
"""
TIMED = """
times = []
for _ in range({runs}):
    start = time.perf_counter(); run(); times.append(time.perf_counter() - start)
print(sorted(times)[{runs} // 2])
"""


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
    return u * (outer[:, None] * (outer * np.exp(1j * k * z)))


def median(run: Callable[[], Any], runs: int) -> float:
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def elsewhere(python: str | None, text: str, **values: Any) -> str:
    """Seconds of another library's run in the environment that has it, as text."""
    if python is None:
        return "not run"
    done = subprocess.run([python, "-c", (text + TIMED).format(**values)], capture_output=True, text=True)
    if done.returncode:
        return f"failed: {(done.stderr.strip().splitlines() or [''])[-1]}"
    return f"{float(done.stdout.split()[-1]):.3f}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").split("\n", 1)[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--size", type=int, default=1024, help="points along a side")
    parser.add_argument("--radius", type=float, default=0.5)
    parser.add_argument("--distance", type=float, default=5e3)
    parser.add_argument("--wavelength", type=float, default=2.2e-6)
    parser.add_argument("--half-side", type=float, default=None, help="of the square; the radius unless given")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--checks", type=int, default=50, help="points compared with the line integral")
    parser.add_argument("--lightpipes", help="a Python that has LightPipes")
    parser.add_argument("--diffractio", help="a Python that has diffractio")
    args = parser.parse_args()

    a, z, wavelength, n = args.radius, args.distance, args.wavelength, args.size
    side = (args.half_side or a) * np.linspace(-1, 1, n)
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
    rows = []
    for name, run in (("grimaldi.field", ours), ("plain finufft script", plain)):
        u = run()  # the first run compiles
        rows.append(
            {
                "": name,
                "seconds": f"{median(run, args.runs):.3f}",
                "largest error": f"{abs(u[chosen] - line).max():.2g}",
            }
        )
    values = {"n": n, "a": a, "z": z, "wavelength": wavelength, "runs": args.runs}
    for name, python, text in (
        ("LightPipes, Fresnel", args.lightpipes, LIGHTPIPES),
        ("diffractio, RS", args.diffractio, DIFFRACTIO),
    ):
        rows.append({"": name, "seconds": elsewhere(python, text, **values), "largest error": "not compared"})
    print(f"{n}² points, N = {a * a / wavelength / z:.3g}, tolerance {args.tolerance:g}, medians of {args.runs}\n")
    print(report.table(rows), end="\n\n")
    print(report.facts({"line integral beside Fresnel's on the axis": f"{on_axis:.2g}", **report.machine()}))


if __name__ == "__main__":
    main()
