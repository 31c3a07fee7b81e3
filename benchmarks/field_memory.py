"""Seconds and peak memory of `grimaldi.field` at many points behind a polygon of many sides."""

from __future__ import annotations

import argparse
import time

import numpy as np
import report

import grimaldi
from grimaldi.bench.memory import peak

LIMIT = 2.0  # GB


def main() -> None:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").split("\n", 1)[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--segments", type=int, default=1_000)
    parser.add_argument("--tolerance", type=float, nargs="+", default=[1e-3])
    args = parser.parse_args()

    angle = 2 * np.pi * np.arange(args.segments) / args.segments
    hole = grimaldi.PlanarOutline(12 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    light = {"type": "coherent_point", "position": [3.0, -2.0, -40.0]}
    scene = grimaldi.load({"type": "scene", "light": light}, outlines=[hole])
    points = np.full((args.points, 3), 60.0)
    points[:, :2] = np.random.default_rng(0).uniform(-20, 20, (args.points, 2))

    grimaldi.field(scene, points[:1000], wavelength=1.0)  # starts Mitsuba
    before = peak()
    rows = []
    for tolerance in args.tolerance:
        start = time.perf_counter()
        grimaldi.field(scene, points, wavelength=1.0, tolerance=tolerance)
        elapsed = time.perf_counter() - start
        rate = args.points * args.segments / elapsed
        rows.append({"tolerance": f"{tolerance:g}", "seconds": f"{elapsed:.2f}", "pairs/s": f"{rate:.3g}"})
    most = peak()
    print(f"{args.points} points, {args.segments} segments\n")
    print(report.table(rows), end="\n\n")
    print(
        report.facts(
            {
                "peak memory [GB]": f"{most:.2f} ({before:.2f} before), {'below' if most < LIMIT else 'ABOVE'} {LIMIT}",
                **report.machine(),
            }
        )
    )


if __name__ == "__main__":
    main()
