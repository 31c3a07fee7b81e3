"""Pairs of point and segment a second, beside a hand-written loop of AVX-512 over the same geometry: a diagnostic.

On a GPU, beside what it could do at most if a pair took no more than the operations of that loop.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import grimaldi
from grimaldi.bench import gpu
from grimaldi.bench.error import field_error
from grimaldi.bench.model import Result, Settings
from grimaldi.bench.timing import medians, written
from grimaldi.variants import on_cuda

FLAGS = ("-O3", "-march=native", "-ffast-math", "-pthread")
TOLERANCE = 1e-3
OPERATIONS = 140  # of the hand-written loop for a pair, a root or a quotient counting as one


def measure(settings: Settings) -> Result:
    return rates(32 if settings.quick else 512, 30 if settings.quick else 1000, settings)


def rates(side: int, segments: int, settings: Settings) -> Result:
    """`grimaldi.field` at side² points behind a polygon of `segments` sides, nothing in the way of its edges."""
    # The geometry of the hand-written loop: a circle of 12 wavelengths, the source 40 before it, points 60 behind.
    angle = 2 * np.pi * np.arange(segments) / segments
    hole = grimaldi.PlanarOutline(12 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    light = {"type": "coherent_point", "position": [3.0, -2.0, -40.0]}
    scene = grimaldi.load({"type": "scene", "light": light}, outlines=[hole])
    x, y = np.meshgrid(*[np.linspace(-20, 20, side)] * 2)
    points = np.stack([x, y, np.full_like(x, 60.0)], axis=-1).reshape(-1, 3)

    def field() -> None:
        grimaldi.field(scene, points, wavelength=1.0, tolerance=TOLERANCE, fast=False)

    (ours,) = medians(settings.runs, field)
    theirs = _hand_written(settings.file("oracle", "roofline.cpp"), segments)
    pairs = len(points) * segments
    error = field_error(scene, points[:: len(points) // 200 + 1], 1.0, TOLERANCE)
    lines = [
        {"": "`grimaldi.field`", "time": written(ours), "pairs/s": f"{pairs / ours:.3g}", "error": f"{error:.1e}"},
        {"": "hand-written loop"},
    ]
    if isinstance(theirs, str):
        lines[1]["time"] = theirs
    else:
        lines[1] |= {"time": written(512**2 * segments / theirs), "pairs/s": f"{theirs:.3g}", "error": "not compared"}
        lines.append({"": "ratio", "pairs/s": f"{pairs / ours / theirs:.3g}"})
    if on_cuda():
        most = gpu.peak(gpu.driver()) / OPERATIONS
        lines.append({"": f"GPU's peak, {OPERATIONS} operations a pair", "pairs/s": f"{most:.3g}"})
        lines.append({"": "share of that", "pairs/s": f"{pairs / ours / most:.1%}"})
    text = (
        f"{side}² points behind a polygonal hole of {segments:,} sides, one point source, tolerance {TOLERANCE:g}, "
        "along the outlines (`fast=False`). A pair that is left out as too weak counts as one. The error is the "
        "largest |ΔM|."
    )
    return Result(text, tuple(lines))


def _hand_written(source: Path | None, segments: int) -> float | str:
    """The best rate of the loop [pairs/s]; why there is none."""
    compiler = shutil.which("g++")
    if source is None:
        return "not run: roofline.cpp is not at hand"
    if compiler is None:
        return "not run: no g++"
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder, "roofline")
        if subprocess.run([compiler, *FLAGS, str(source), "-o", str(program)], capture_output=True).returncode:
            return "not run: g++ cannot build it here"
        run = subprocess.run([program, str(segments)], capture_output=True, text=True)
    found = re.findall(r"([\d.eE+-]+) Gpair/s", run.stdout)
    return max(map(float, found)) * 1e9 if found else "not run: the processor lacks AVX-512"
