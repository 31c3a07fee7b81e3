"""Seconds and peak memory of `grimaldi.field` at many points behind a polygon of many sides.

Beside it, where g++ and oracle/roofline.cpp are here, a hand-written AVX-512 loop over the same pairs.
"""

from __future__ import annotations

import argparse
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import report

import grimaldi

LIMIT = 2.0  # GB


def roofline(segments: int) -> float | None:
    """The best rate of three of the hand-written loop [pairs/s], None where it cannot be built or run."""
    source = report.SHARED / "oracle" / "roofline.cpp"
    compiler = shutil.which("g++")
    if compiler is None or not source.exists():
        return None
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder, "roofline")
        flags = ["-O3", "-march=native", "-ffast-math", "-pthread"]
        built = subprocess.run([compiler, *flags, str(source), "-o", str(program)], capture_output=True)
        if built.returncode:
            return None
        run = subprocess.run([program, str(segments)], capture_output=True, text=True)
    rates = re.findall(r"([\d.eE+-]+) Gpair/s", run.stdout)
    return max(map(float, rates)) * 1e9 if rates else None


def peak_memory() -> float:
    """The largest resident size of this process so far [GB]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9


def main() -> None:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").split("\n", 1)[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--segments", type=int, default=1_000)
    parser.add_argument("--tolerance", type=float, nargs="+", default=[1e-3])
    parser.add_argument("--no-roofline", action="store_true", help="leave the hand-written loop out")
    args = parser.parse_args()

    # The geometry of roofline.cpp: a circle of 12 wavelengths, the source 40 before it, points 60 behind.
    angle = 2 * np.pi * np.arange(args.segments) / args.segments
    hole = grimaldi.PlanarOutline(12 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    light = {"type": "coherent_point", "position": [3.0, -2.0, -40.0]}
    scene = grimaldi.load({"type": "scene", "light": light}, outlines=[hole])
    points = np.full((args.points, 3), 60.0)
    points[:, :2] = np.random.default_rng(0).uniform(-20, 20, (args.points, 2))

    grimaldi.field(scene, points[:1000], wavelength=1.0)  # starts Mitsuba
    before = peak_memory()
    rows = []
    for tolerance in args.tolerance:
        start = time.perf_counter()
        grimaldi.field(scene, points, wavelength=1.0, tolerance=tolerance)
        elapsed = time.perf_counter() - start
        rate = args.points * args.segments / elapsed
        rows.append({"tolerance": f"{tolerance:g}", "seconds": f"{elapsed:.2f}", "pairs/s": f"{rate:.3g}"})
    peak = peak_memory()
    print(f"{args.points} points, {args.segments} segments\n")
    print(report.table(rows), end="\n\n")
    limit = None if args.no_roofline else roofline(args.segments)
    print(
        report.facts(
            {
                "peak memory [GB]": f"{peak:.2f} ({before:.2f} before), {'below' if peak < LIMIT else 'ABOVE'} {LIMIT}",
                "hand-written loop [pairs/s]": "not run" if limit is None else f"{limit:.3g}",
                **report.machine(),
            }
        )
    )


if __name__ == "__main__":
    main()
