"""M by cubics through 4 × 4 nodes of the finest cells, also those beside: for pixels that quadratics do not serve.

What a cubic and the quadratics through three of its four nodes differ by tells how far to trust it.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

NODES = 5  # in a row about a cell: its own three, and one before and after
APART = 0.064  # of a third difference: what a quadratic and a cubic differ by at most, t (1-t) (2-t) / 6


def doubt(values: Any, shapes: Any, first: Any, columns: Any, active: Any) -> Any:
    """How far cubics and quadratics are apart (root mean square) in cells; infinite off a single lit shape.

    values: packets of M's real and imaginary part and two more; `first`: the node before the cell's own along rows and
    columns, of which there are `columns` in a row.
    """
    index = [[first + (n * columns + m) for m in range(NODES)] for n in range(NODES)]
    own = [[dr.gather(mi.Array4f, values, i, active) for i in row] for row in index]
    shape = dr.gather(mi.UInt32, shapes, index[0][0], active)
    same = active & (shape > 0)
    for row in index:
        for i in row:
            same &= dr.gather(mi.UInt32, shapes, i, active) == shape
    inner = range(1, NODES - 1)
    rows = [own[n] for n in inner] + [[own[n][m] for n in range(NODES)] for m in inner]
    total, count = mi.Float(0), 0
    for v in rows:
        for a, b, c, d in zip(v, v[1:], v[2:], v[3:], strict=False):
            third = (d - a) - 3 * (c - b)
            total, count = total + dr.fma(third.x, third.x, third.y * third.y), count + 1
    return dr.select(same, APART * dr.sqrt(2 * total / count), dr.inf)


def cubic(values: Any, first: Any, columns: Any, u: Any, v: Any, active: Any) -> tuple[Any, Any]:
    """What nodes say at (u, v) in a cell, 0..1 across; and the range of their distances."""
    (i, x), (j, y) = _half(u), _half(v)
    total, low, high = mi.Array4f(0), mi.Float(dr.inf), mi.Float(0)
    for n, b in enumerate(y):
        for m, a in enumerate(x):
            value = dr.gather(mi.Array4f, values, first + (j + n) * columns + (i + m), active)
            total = dr.fma(mi.Array4f(a * b), value, total)
            low, high = dr.minimum(low, value.z), dr.maximum(high, value.z)
    return total, high - low


def _half(t: Any) -> tuple[Any, tuple[Any, ...]]:
    """The first of the four nodes round a place t of a cell, and their weights there (Lagrange)."""
    second = t >= 0.5
    t = 2 * t - dr.select(second, mi.Float(1), 0)
    a, b, c = t + 1, t - 1, t - 2
    weights = (-t * b * c * (1 / 6), 0.5 * a * b * c, -0.5 * a * t * c, a * t * b * (1 / 6))
    return dr.select(second, mi.UInt32(1), 0), weights
