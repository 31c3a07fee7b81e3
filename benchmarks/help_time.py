"""Seconds until `grimaldi --help` has been printed."""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time

import report


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--runs", type=int, default=11)
    args = parser.parse_args()

    times = []
    for _ in range(args.runs):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "grimaldi", "--help"], check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - start)
    median, best, worst = statistics.median(times), min(times), max(times)
    row = {"median [s]": f"{median:.3f}", "best [s]": f"{best:.3f}", "worst [s]": f"{worst:.3f}", "runs": args.runs}
    print(report.table([row]), end="\n\n")
    print(report.facts(report.machine()))


if __name__ == "__main__":
    main()
