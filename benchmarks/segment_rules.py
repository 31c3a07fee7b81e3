"""Largest errors that the rules for a segment's wave leave in M, over random geometries (docs/theory.md, eq. 9)."""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np
import report
from numpy.polynomial.laguerre import laggauss
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from grimaldi.diffraction.segment import RULES

Reals = NDArray[np.float64]
CUT = 16.0  # of v: beyond it 1e-7 is left


class Edges(NamedTuple):
    """Eq. 9's parameters, in units of 1/k."""

    a: Reals
    b: Reals
    R: Reals
    straight: Reals
    folded: Reals
    sin: Reals

    def F(self, y: NDArray) -> NDArray:
        first = 2 * self.R / (self.R + self.straight + y)
        under = self.b / (self.b + y) * (self.straight + self.R) / (2 * self.straight + y)
        return (
            self.sin
            * first
            * np.sqrt(under)
            * np.sqrt((self.straight + self.folded) / (self.straight + self.folded + y))
        )


def edges(n: int, seed: int) -> Edges:
    """Sources and receivers 1e-4 to 1e8 from the edge, from far beside the shadow's boundary to 1e-8 rad from it."""
    rng = np.random.default_rng(seed)
    rho1, rho2 = 10 ** rng.uniform(-4, 8, n), 10 ** rng.uniform(-4, 6, n)
    along = rng.choice([0, 1], n) * 10 ** rng.uniform(-4, 6, n)
    psi = np.pi - 10 ** rng.uniform(-8, 0.49, n)
    straight, folded = np.hypot(rho1 + rho2, along), np.hypot(rho1 - rho2, along)
    excess = 4 * rho1 * rho2 * np.cos(psi / 2) ** 2
    R = np.sqrt(np.maximum(straight**2 - excess, 0))
    return Edges(excess / (straight + R), 4 * rho1 * rho2 / (straight + folded), R, straight, folded, np.sin(psi / 2))


def tail(e: Edges, Y: float, nodes: Reals, weights: Reals) -> NDArray:
    y = Y + 1j * nodes[:, None]
    return 0.5 * np.sqrt(e.a) * (weights[:, None] * e.F(y) / ((y + e.a) * np.sqrt(y))).sum(axis=0)


def fine() -> tuple[Reals, Reals]:
    """Nodes and weights that integrate e^{-τ} g(τ) to rounding."""
    x, w = leggauss(40)
    ends = np.concatenate([[0], np.geomspace(0.05, 80, 24)])
    nodes = (ends[:-1, None] + np.diff(ends)[:, None] * (x + 1) / 2).ravel()
    return nodes, (np.diff(ends)[:, None] / 2 * w).ravel() * np.exp(-nodes)


def panels(e: Edges, v: Reals, step: float, n: int) -> NDArray:
    """∫ F e^{iy} dv / cosh v from 0 to v."""
    x, w = leggauss(n)
    total = np.zeros(len(v), complex)
    for i in range(int(np.ceil(v.max() / step))):
        low, high = np.minimum(i * step, v), np.minimum((i + 1) * step, v)
        for x_j, w_j in zip(x, w, strict=True):
            at = low + (high - low) * (x_j + 1) / 2
            y = e.a * np.sinh(at) ** 2
            total += w_j / 2 * (high - low) * e.F(y) * np.exp(1j * y) / np.cosh(at)
    return total


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--edges", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()

    e = edges(args.edges, args.seed)
    rows = []
    for least, K, n, step, tails, relative in RULES:
        exact = tail(e, K, *fine())
        left = abs(tail(e, K, *laggauss(int(tails))) - exact)
        v = np.minimum(np.arcsinh(np.sqrt(K / e.a)), CUT)
        open_ = abs(panels(e, v, step, int(n)) - panels(e, v, 0.25, 24))
        rows.append(
            {
                "tolerance from": f"{least:g}",
                "K": f"{K:g}",
                "nodes a panel, width in v": f"{n}, {step:g}",
                "tail nodes": tails,
                "error of a tail": f"{left.max() / np.pi:.1e}",
                "relative, median, beside the rule's": f"{np.median(left / abs(exact)):.1e}, {relative:g}",
                "error of a side's panels": f"{open_.max() / (2 * np.pi):.1e}",
            }
        )
    print(report.table(rows), end="\n\n")
    print(report.facts({"edges": args.edges, "seed": args.seed}))


if __name__ == "__main__":
    main()
