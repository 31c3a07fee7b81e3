"""Cubics through 4 × 4 nodes, a cell's own and those beside: they tell more of fringes than its quadratic does.

What the two differ by tells how far to trust the cubic.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

NODES = 5  # in a row: a cell's own three, and one before and after
APART = 0.064  # of a third difference: what a quadratic and a cubic differ by at most, t (1-t) (2-t) / 6


def apart(values: Any, shapes: Any, own: list[Any], shape: Any, first: Any, steps: tuple[Any, Any], active: Any) -> Any:
    """How far cubics and quadratics are apart in cells (root mean square); infinite where they leave a shape.

    values: packets of M's real and imaginary part and two more; own: those of the cells' 3 × 3 nodes, which lie on
    `shape` where `active`; first: the node before the cell's own along rows and columns; steps: from node to node along
    each.
    """
    inner = range(1, NODES - 1)
    same, rows = active, []
    for n in range(NODES):
        row = []
        for m in range(NODES):
            if n in inner and m in inner:
                row.append(own[3 * (n - 1) + m - 1])
                continue
            i = first + (n * steps[1] + m * steps[0])
            row.append(dr.gather(mi.Array4f, values, i, active))
            same &= dr.gather(mi.UInt32, shapes, i, active) == shape
        rows.append(row)
    total, count = mi.Float(0), 0
    for line in [rows[n] for n in inner] + [[row[m] for row in rows] for m in inner]:
        for a, b, c, d in zip(line, line[1:], line[2:], line[3:], strict=False):
            third = (d - a) - 3 * (c - b)
            total, count = total + dr.fma(third.x, third.x, third.y * third.y), count + 1
    return dr.select(same, APART * dr.sqrt(2 * total / count), dr.inf)


def weights(t: Any) -> tuple[Any, tuple[Any, Any, Any, Any]]:
    """Whether the cubic at a place t of a cell, 0..1, leaves out the node before, else that after; and its weights."""
    second = t >= 0.5
    t = 2 * t - dr.select(second, mi.Float(1), 0)
    a, b, c = t + 1, t - 1, t - 2
    return second, (-t * b * c * (1 / 6), 0.5 * a * b * c, -0.5 * a * t * c, a * t * b * (1 / 6))
