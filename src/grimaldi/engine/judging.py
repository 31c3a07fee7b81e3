"""Which cells of the film serve: where what their nodes tell of M is within its shares of the tolerance.

By Runge's comparison: a quadratic through nodes twice as near errs by an eighth of what the one around it does.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.engine.cubics import apart
from grimaldi.engine.nodes import LARGEST, Evaluate, Grid, Values, all_on, gathered, or_ray, quadratic, summed, told

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

HALVED = 0.25  # what halving a cell leaves of a quadratic's error, at most
AT_BEST = 1 / 16  # what it leaves of it at best: an eighth of a cubic's, less in quarters where M is straighter
STRAIGHT = 0.5  # what a quadratic leaves of a bilinear function's error, at most
SIMPSON = 1 / 6, 4 / 6, 1 / 6  # means of quadratics
OF_PIXEL = 1  # times its share, that the mean over a pixel may be off by, where that is a cell
IN_PIXEL = 3  # times its share, that M may be off by within a pixel; in larger cells less, by their size, so that each
# cell adds the same to a picture's mean square
BY_CUBICS = 1.75  # likewise, that cubics and quadratics may be apart in any cell at most
FAINT = 1.5  # times what |M - M of a ray| may be at nodes, that it may be at one more place
WITNESS = 0.31, 0.64  # where in a cell M is asked for once more: fringes as wide as nodes are apart look like none
WIDE = 0.1  # |M - M of a ray| at all nodes of a cell, above which fringes, and the rim among them, are wider than it


class Shares(NamedTuple):
    """What may be left of M.

    missed: of |M_computed - M|, by interpolation, times |M| + `beside`, the light that it adds to, so that intensities
    are as exact in the dark as in the light; most: of |M_computed - M| itself; rays: of |M - M of a ray|, where M may
    be that.
    """

    missed: float
    most: float
    rays: float
    beside: float = 0.0


class Verdict(NamedTuple):
    """Whether cells serve, with M's error in them and as what (`ray`, `cubic` as in `Cells`); what else is in
    `Cells.mixed`; and whether parts of cells that do not serve may."""

    serves: Any
    error: Any
    ray: Any
    cubic: Any
    mixed: Any
    halved: Any


class _Own(NamedTuple):
    """Cells at pixels (x, y), what their own 3 × 3 nodes say, and which of them lie on one lit shape."""

    x: Any
    y: Any
    size: Any
    values: list[Any]
    shape: Any
    same: Any


def judged(nodes: Values, grid: Grid, x: Any, y: Any, size: Any, finest: int, shares: Shares) -> Verdict:
    """What the nodes of cells at (x, y) tell of them; with an opaque size one kernel for all."""
    dr.eval(x, y)
    values = gathered(nodes, grid, x, y, size)
    index = [grid.node(x, y, size, m, n) for n in range(3) for m in range(3)]
    shapes = [dr.gather(mi.UInt32, nodes.shape, i) for i in index]
    shape, error, clear = shapes[0], mi.Float(0), mi.Float(dr.inf)
    same = shape > 0
    for i, s, c in zip(index, shapes, values, strict=True):
        same &= s == shape
        error = dr.maximum(error, dr.select(s > 0, dr.gather(mi.Float, nodes.error, i), 0))
        clear = dr.minimum(clear, c.w)
    own = _Own(x, y, size, values, shape, same)
    least, most, modulus = _waves(values)
    off, mean = _missed(nodes, grid, own)
    # fringes that are finer than nodes are no better told by twice as many
    doubt = dr.select(most > 0, dr.clip(off / (HALVED**2 * most), 1, 1 / HALVED), 1)
    off, mean = off * doubt, mean * doubt
    light = dr.minimum(modulus, 1) + dr.opaque(mi.Float, shares.beside)
    left, left_of_mean = off * (light + off), mean * (light + mean)

    missed, rays = dr.opaque(mi.Float, shares.missed), dr.opaque(mi.Float, shares.rays)
    allowed = dr.opaque(mi.Float, shares.most)
    at_finest = size == dr.opaque(mi.UInt32, finest)
    resolved = (clear > mi.Float(size)) | at_finest
    wide = resolved | (least > WIDE)
    serves = same & (off <= allowed) & (left <= IN_PIXEL / mi.Float(size) * missed)
    serves &= dr.select(size == 1, left_of_mean <= OF_PIXEL * missed, wide)
    cubic, off_cubic = _by_cubics(nodes, grid, own, light, shares)
    cubic &= ~serves & wide
    is_ray = (size == LARGEST) & same & resolved & (most <= rays)
    ray = dr.select(is_ray, dr.select(values[0].x > 0.5, mi.UInt32(2), 1), 0)
    off = dr.select(is_ray, most, dr.select(cubic, off_cubic, off))
    serves |= cubic | is_ray
    cubic &= ~is_ray
    within = dr.opaque(mi.Float, (IN_PIXEL if finest == 1 else 1) * shares.missed)
    spread = _spread(values, shapes)
    alike = (spread <= allowed) & (spread * (light + spread) <= within)
    mixed = dr.select(at_finest & ~same & alike, error + spread, dr.inf)
    halvings = dr.log2(mi.Float(size) / dr.opaque(mi.Float, finest))
    hopeless = same & (left * dr.power(mi.Float(AT_BEST), halvings) > within)  # not where M is NaN
    halved = ~serves & ~hopeless
    verdict = Verdict(serves, error + off, ray, cubic, mixed, halved)
    dr.eval(*verdict)
    return verdict


def witnessed(
    found: Verdict, nodes: Values, grid: Grid, x: Any, y: Any, size: Any, evaluate: Evaluate, shares: Shares
) -> Verdict:
    """The verdict, but for cells in which M is something else off their nodes."""
    some: Any = dr.compress(found.serves)
    if len(some) == 0:
        return found
    x, y, ray = (dr.gather(mi.UInt32, values, some) for values in (x, y, found.ray))
    cubic = dr.gather(mi.Bool, found.cubic, some)
    u, v = WITNESS
    there = evaluate(mi.Float(x) + mi.Float(size) * u, grid.top + mi.Float(y) + mi.Float(size) * v)
    m, _ = told(nodes.values, grid, x, y, size, cubic, mi.Float(u), mi.Float(v), mi.Bool(True))
    real, imag = or_ray(m, ray)
    off = dr.sqrt(dr.square(real - mi.Float(there.real)) + dr.square(imag - mi.Float(there.imag)))
    light = dr.minimum(dr.sqrt(dr.square(real) + dr.square(imag)), 1) + dr.opaque(mi.Float, shares.beside)
    missed, rays = dr.opaque(mi.Float, shares.missed), dr.opaque(mi.Float, shares.rays)
    fails = dr.select(
        ray > 0, off > FAINT * rays, (off > dr.opaque(mi.Float, shares.most)) | (off * (light + off) > missed)
    )
    dr.scatter(found.serves, ~fails, some)
    dr.scatter(found.halved, fails, some)
    dr.eval(found.serves, found.halved)
    return found


def _by_cubics(nodes: Values, grid: Grid, own: _Own, light: Any, shares: Shares) -> tuple[Any, Any]:
    """Whether cubics serve cells, and what they may leave of M there."""
    steps = grid.steps(own.size)
    first = grid.node(own.x, own.y, own.size, 0, 0) - (steps[0] + steps[1])
    inside = own.same & grid.inside(own.x, own.y, own.size)
    off = apart(nodes.values, nodes.shape, own.values, own.shape, first, steps, inside)
    missed, allowed = dr.opaque(mi.Float, shares.missed), dr.opaque(mi.Float, shares.most)
    share = dr.minimum(IN_PIXEL / mi.Float(own.size), BY_CUBICS)
    return (off <= allowed) & (off * (light + off) <= share * missed), off


def _waves(own: list[Any]) -> tuple[Any, Any, Any]:
    """The least and the largest |M - M of a ray|, and the largest |M| at nodes."""
    least, of_lit, of_dark = mi.Float(dr.inf), mi.Float(0), mi.Float(0)
    for c in own:
        from_one, from_zero = dr.square(c.x - 1) + dr.square(c.y), dr.square(c.x) + dr.square(c.y)
        least = dr.minimum(least, dr.minimum(from_one, from_zero))
        of_lit, of_dark = dr.maximum(of_lit, from_one), dr.maximum(of_dark, from_zero)
    return dr.sqrt(least), dr.sqrt(dr.minimum(of_lit, of_dark)), dr.sqrt(of_dark)


def _missed(nodes: Values, grid: Grid, own: _Own) -> tuple[Any, Any]:
    """What quadratics leave of M in cells at most, and of its mean, by what the cell around them predicted."""
    c00, c10, c20, c01, c11, c21, c02, c12, c22 = own.values
    bent = [c10 - 0.5 * (c00 + c20), c01 - 0.5 * (c00 + c02), c21 - 0.5 * (c20 + c22), c12 - 0.5 * (c02 + c22)]
    bent.append(c11 - 0.25 * (c00 + c20 + c02 + c22))
    off = STRAIGHT * _largest(bent)
    mean = STRAIGHT * _length((bent[0] + bent[1] + bent[2] + bent[3] + 4 * bent[4]) / 9)
    size = 2 * own.size
    around = own.x & ~(size - 1), own.y & ~(size - 1)
    predicted = own.same & (own.size < LARGEST)
    coarse = gathered(nodes, grid, *around, size, predicted)
    predicted &= all_on(nodes, grid, *around, size, own.shape, predicted)
    a, b = (mi.Float(c - c0) / mi.Float(size) for c, c0 in zip((own.x, own.y), around, strict=True))
    columns = [quadratic(a + 0.25 * m) for m in range(3)]
    rows = [quadratic(b + 0.25 * n) for n in range(3)]
    misses = [own.values[3 * n + m] - summed(coarse, columns[m], rows[n]) for n in range(3) for m in range(3)]
    return (
        dr.select(predicted, HALVED * _largest(misses), off),
        dr.select(predicted, HALVED * _length(summed(misses, SIMPSON, SIMPSON)), mean),
    )


def _spread(own: list[Any], shapes: list[Any]) -> Any:
    """The largest difference of M between nodes on one lit shape."""
    most = mi.Float(0)
    for i, a in enumerate(own):
        for j in range(i):
            d = a - own[j]
            same = (shapes[i] == shapes[j]) & (shapes[i] > 0)
            most = dr.maximum(most, dr.select(same, dr.fma(d.x, d.x, d.y * d.y), 0))
    return dr.sqrt(most)


def _length(d: Any) -> Any:
    """|M| of a difference."""
    return dr.sqrt(dr.fma(d.x, d.x, d.y * d.y))


def _largest(differences: list[Any]) -> Any:
    """The largest |M| of differences."""
    most = mi.Float(0)
    for d in differences:
        most = dr.maximum(most, d.x * d.x + d.y * d.y)
    return dr.sqrt(most)
