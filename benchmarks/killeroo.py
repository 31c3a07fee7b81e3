"""Seconds to render killeroo with diffraction, beside Mitsuba's `direct` in the same process."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import report

import grimaldi  # before mitsuba: it finds libLLVM


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--scene", type=Path, default=report.SHARED / "scenes" / "killeroo.xml")
    parser.add_argument("--wavelength", type=float, nargs="+", default=[0.4, 4.0], help="in scene units")
    parser.add_argument("--size", type=int, default=700, help="pixels of each side")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--tolerance", type=float, default=1e-3)
    parser.add_argument("--runs", type=int, default=1, help="timed runs; the median is printed")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    args = parser.parse_args()
    if not args.scene.exists():
        parser.exit(2, f"{args.scene}: not here; name the scene with --scene\n")

    import drjit as dr
    import mitsuba as mi

    mi.set_variant(args.variant)
    rays = mi.load_file(str(args.scene), spp=args.spp, res=args.size)
    waves = grimaldi.load(args.scene)
    lit = {source.name: len(grimaldi.outline(waves, source)) for source in waves.sources}

    def direct(seed: int) -> None:
        dr.eval(mi.render(rays, spp=args.spp, seed=mi.UInt32(seed)))
        dr.sync_thread()

    rows = []
    for wavelength in args.wavelength:

        def wave(seed: int, wavelength: float = wavelength) -> None:
            grimaldi.render(
                waves,
                wavelength=wavelength,
                spp=args.spp,
                seed=seed,
                size=(args.size, args.size),
                tolerance=args.tolerance,
            )

        direct(0)  # compiles Mitsuba's kernels; ours compile in the first timed run
        first = seconds(lambda run=wave: run(0))
        ours = [first] if args.runs == 1 else [seconds(lambda i=i, run=wave: run(i)) for i in range(1, args.runs + 1)]
        theirs = [seconds(lambda i=i: direct(i)) for i in range(1, max(3, args.runs) + 1)]
        rows.append(
            {
                "wavelength": wavelength,
                "segments lit": sum(lit.values()),
                "first run [s]": f"{first:.1f}",
                "grimaldi [s]": f"{statistics.median(ours):.1f}",
                "direct [s]": f"{statistics.median(theirs):.3g}",
                "ratio": f"{statistics.median(ours) / statistics.median(theirs):.3g}",
            }
        )
    print(
        f"{args.scene.name}, {args.size}×{args.size}, {args.spp} samples, tolerance {args.tolerance:g}, "
        f"median of {args.runs}\n"
    )
    print(report.table(rows), end="\n\n")
    print(report.facts(report.machine()))


if __name__ == "__main__":
    main()
