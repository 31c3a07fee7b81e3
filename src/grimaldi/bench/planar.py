"""A circular hole at a square of points: `grimaldi.field` beside a plain finufft script, and other libraries.

The plain script is Barnett's method (JATIS 7(2) 021211) in its fewest lines: Fresnel's approximation, one wavelength,
one hole, no bound of the error.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.bench.model import Result, Settings, Target
from grimaldi.bench.timing import medians, written

Complexes = NDArray[np.complex128]
Reals = NDArray[np.float64]

RADIUS, DISTANCE, WAVELENGTH = 0.5, 5e3, 2.2e-6  # Fresnel number 22.7
TOLERANCE = 1e-6
CHECKS = 50  # points at which fields are compared
PLAIN = 1.2  # times the plain script's time, at most
OTHERS = 0.1  # times the others' time, at most

LIBRARIES = {
    "LightPipes, Fresnel": """
import LightPipes as lp
def run():
    return lp.Fresnel(lp.CircAperture(lp.Begin(4 * a, wavelength, n), a), z).field
""",
    "diffractio, RS": """
from diffractio.scalar_masks_XY import Scalar_mask_XY
def run():
    mask = Scalar_mask_XY(x, x, wavelength)
    mask.circle(r0=(0, 0), radius=a)
    return mask.RS(z=z, new_field=True, verbose=False).u
""",
}
TIMED = """
import json, time
import numpy as np
n, a, z, wavelength = {n}, {a}, {z}, {wavelength}
x = np.linspace(-2 * a, 2 * a, n, endpoint=False)
{library}
u = run()
times = []
for _ in range({runs}):
    begun = time.perf_counter()
    run()
    times.append(time.perf_counter() - begun)
print(json.dumps([sorted(times)[len(times) // 2], np.abs(np.asarray(u)).ravel()[{chosen}].tolist()]))
"""


class Elsewhere(NamedTuple):
    """Another library's seconds, and its |U| at the chosen points."""

    seconds: float
    modulus: Reals


def measure(settings: Settings) -> Result:
    return compare(32 if settings.quick else 1024, settings)


def compare(n: int, settings: Settings) -> Result:
    """The field of a plane wave at n² points behind the hole, on a square that it just fits in."""
    side, points = _square(RADIUS, n)
    hole = grimaldi.PlanarOutline.ellipse(np.diag([RADIUS, RADIUS, 1, 1]))
    light = {"type": "coherent_directional", "direction": [0, 0, 1]}
    scene = grimaldi.load({"type": "scene", "light": light}, outlines=[hole])

    def field() -> Complexes:
        return grimaldi.field(scene, points, wavelength=WAVELENGTH, tolerance=TOLERANCE).U.values[0, 0]

    def exact(where: Reals) -> Complexes:
        strict = {"tolerance": 1e-2 * TOLERANCE, "precision": "double", "fast": False}
        return grimaldi.field(scene, where, wavelength=WAVELENGTH, **strict).U.values[0, 0]

    def script() -> Complexes:
        return plain(RADIUS, DISTANCE, WAVELENGTH, side, TOLERANCE).ravel()

    rng = np.random.default_rng(settings.seed)
    chosen = rng.choice(len(points), CHECKS, replace=False)
    expected = exact(points[chosen])
    ours, theirs = medians(settings.runs, field, script)
    error = abs(field()[chosen] - expected).max()
    lines = [
        _line("`grimaldi.field`", written(ours), f"{error:.1e}"),
        _line("plain finufft script", written(theirs), f"{abs(script()[chosen] - expected).max():.1e}"),
    ]
    targets = [Target("time / plain finufft script", ours / theirs, PLAIN, "×"), Target("error", error, TOLERANCE)]

    row, column = rng.integers(n // 4, n - n // 4, (2, CHECKS))
    inner = row * n + column
    modulus = abs(exact(_square(2 * RADIUS, n)[1][inner]))
    for name, text in LIBRARIES.items():
        found = _elsewhere(settings, text, n, inner)
        if isinstance(found, str):
            lines.append(_line(name, found, "-"))
            targets.append(Target(f"time / {name}", None, OTHERS, "×"))
        else:
            off = abs(found.modulus - modulus).max()
            lines.append(_line(name, written(found.seconds), f"{off:.1e} of the modulus"))
            targets.append(Target(f"time / {name}", ours / found.seconds, OTHERS, "×"))
            targets.append(Target(f"error / {name}", error / off, 1.0, "×"))
    text = (
        f"A plane wave through a circle of radius {RADIUS:g} at {n}² points, {2 * RADIUS:g} wide and {DISTANCE:g} "
        f"behind, λ = {WAVELENGTH:g}, tolerance {TOLERANCE:g}. The error is the largest |ΔU| at {CHECKS} points, "
        "|U0| = 1, against the line integral at a hundredth of the tolerance. Other libraries run in a process of "
        "their own, afterwards, with as many points over twice the width, for theirs must hold the hole with a margin."
    )
    return Result(text, tuple(lines), tuple(targets))


def _square(half: float, n: int) -> tuple[Reals, Reals]:
    """The coordinates (n,) of points along each side, and the points (n², 3) behind the hole, row by row."""
    side = np.linspace(-half, half, n, endpoint=False)
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
    return u * (outer[:, None] * (outer * np.exp(1j * k * z)))


def _line(name: str, time: str, error: str) -> dict[str, str]:
    return {"": name, "time": time, "error": error}


def _elsewhere(settings: Settings, library: str, n: int, chosen: NDArray[np.int64]) -> Elsewhere | str:
    """Another library's run in the Python that has it; why there is none."""
    text = TIMED.format(
        n=n, a=RADIUS, z=DISTANCE, wavelength=WAVELENGTH, runs=settings.runs, chosen=chosen.tolist(), library=library
    )
    done = subprocess.run([settings.peers or sys.executable, "-c", text], capture_output=True, text=True)
    if done.returncode:
        return f"not run: {(done.stderr.strip().splitlines() or ['it failed'])[-1]}"
    seconds, modulus = json.loads(done.stdout.splitlines()[-1])
    return Elsewhere(seconds, np.array(modulus))
