"""How the time of the report's own method grows with its sources: ordinary lights, so as n."""

from __future__ import annotations

import argparse

import report

from grimaldi.figures.bodies import exponent, sum_times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--counts", type=int, nargs="+", default=[3, 10, 30, 100], help="sources an edge")
    parser.add_argument("--points", type=int, default=1024)
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()

    times = sum_times(args.counts, args.points, args.runs)
    rows = [{"sources an edge": n, "seconds": f"{t:.3g}"} for n, t in zip(args.counts, times, strict=True)]
    print(report.table(rows), end="\n\n")
    last = exponent(args.counts[-3:], times[-3:])
    print(f"The sum's time grows as n^{last:.2f} over the last three rows, medians of {args.runs}.", end="\n\n")
    print(report.facts(report.machine()))


if __name__ == "__main__":
    main()
