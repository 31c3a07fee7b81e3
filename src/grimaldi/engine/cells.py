"""M over a picture: at nodes of cells of the film, and between them by quadratics, or cubics where these do not serve.

M = U/U0 is far smoother than U: what a pinhole camera sees of it takes a node every few pixels, fewer where it
changes slowly. Cells are halved until what a cell's own nodes say differs by little from what the cell around them
predicted (Runge's comparison: a quadratic through nodes twice as near errs by an eighth), and where an outline's
shadow is as near as the next node, unless its fringes are wider than that; not where even the finest would differ by
too much. Where M differs from a ray's by less than a share of the tolerance, at all nodes of one of the largest cells,
that is not halved: there M is a ray's. Cells lie at fixed places of the film, so that any part of a picture has the
same nodes as the whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.engine.judging import Shares, Verdict, judged, witnessed
from grimaldi.engine.nodes import LARGEST, Evaluate, Grid, Values, all_on, fill, or_ray, told

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

ASIDE = 0.02  # of the distance from the camera, that a node may lie nearer or further to count as on the same side
DEPTH = 1e-4  # of the distance from the camera, that a surface may lie off the cell's


class Known(NamedTuple):
    """M between nodes, its error, and where it holds."""

    real: Any
    imag: Any
    error: Any
    holds: Any


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of some rows of a film, and what their nodes say."""

    grid: Grid
    nodes: Any  # packets: M's real and imaginary part, distance, clearance
    shapes: Any  # of nodes
    size: Any  # of a pixel's cell in pixels, 0 where M is not known
    shape: Any  # what the cell shows
    error: Any
    ray: Any  # 1 + M where that is a ray's, 0 elsewhere
    cubic: Any  # whether M is there by cubics, not quadratics
    mixed: Any  # the error of M in pixels without a cell, whose nodes lie on several shapes; infinite in others
    unknown: int  # pixels that have none of both

    def knows(self, x: Any, y: Any) -> Any:
        """Whether pixels (x, y) of the film have a cell."""
        pixel = (y - mi.UInt32(self.grid.top)) * self.grid.pixels + x
        return dr.gather(mi.UInt32, self.size, pixel) > 0

    def at(self, x: Any, y: Any, distance: Any, shape: Any, active: Any) -> Known:
        """M where a ray through (x, y) of the film [pixels] met a surface at a distance."""
        y = y - self.grid.top
        pixel = self.grid.pixel(x, y)
        size = dr.gather(mi.UInt32, self.size, pixel, active)
        holds = active & (size > 0)
        holds &= dr.gather(mi.UInt32, self.shape, pixel, holds) == shape
        i, j = mi.UInt32(x) & ~(size - 1), mi.UInt32(y) & ~(size - 1)
        scale = dr.rcp(mi.Float(size))
        cubic = dr.gather(mi.Bool, self.cubic, pixel, holds)
        u, v = (x - mi.Float(i)) * scale, (y - mi.Float(j)) * scale
        found, room = told(self.nodes, self.grid, i, j, size, cubic, u, v, holds)
        holds &= dr.abs(distance - found.z) <= dr.maximum(DEPTH * distance, 0.25 * room)
        real, imag = or_ray(found, dr.gather(mi.UInt32, self.ray, pixel, holds))
        return Known(real, imag, dr.gather(mi.Float, self.error, pixel, holds), holds)

    def beside(self, x: Any, y: Any, distance: Any, shape: Any, active: Any) -> Known:
        """The same in pixels where several shapes meet: by the nodes on this one, nearer ones counting more."""
        y = y - self.grid.top
        pixel = self.grid.pixel(x, y)
        error = dr.gather(mi.Float, self.mixed, pixel, active)
        active = active & dr.isfinite(error)
        size = 1 << self.grid.shift
        i, j = mi.UInt32(x) & ~mi.UInt32(size - 1), mi.UInt32(y) & ~mi.UInt32(size - 1)
        a, b = (x - mi.Float(i)) / size, (y - mi.Float(j)) / size
        total, weight = mi.Array4f(0), mi.Float(0)
        for n in range(3):
            for m in range(3):
                node = self.grid.node(i, j, size, m, n)
                value = dr.gather(mi.Array4f, self.nodes, node, active)
                own = dr.gather(mi.UInt32, self.shapes, node, active) == shape
                own &= dr.abs(distance - value.z) <= ASIDE * distance
                away2 = dr.square(a - 0.5 * m) + dr.square(b - 0.5 * n)
                w = dr.select(own, dr.rcp(away2 + 0.01), 0)  # finite at the node itself
                total, weight = dr.fma(mi.Array4f(w), value, total), weight + w
        total *= dr.rcp(dr.maximum(weight, 1e-30))
        return Known(total.x, total.y, error, active & (weight > 0))


class _Level(NamedTuple):
    """Cells of one size: which of the film's serve, and with what error."""

    size: Any
    serves: Any
    error: Any
    ray: Any
    cubic: Any
    mixed: Any


def cells(evaluate: Evaluate, width: int, top: int, rows: int, finest: int, shares: Shares) -> Cells:
    """The cells of `rows` rows of a film `width` pixels wide, from row `top` on, which `ROWS` divides.

    Cells are `finest` pixels or more across, a power of two.
    """
    across, down = -(-width // LARGEST), -(-rows // LARGEST)
    columns = 2 * across * LARGEST // finest + 1
    grid = Grid(
        dr.opaque(mi.UInt32, across * LARGEST),
        dr.opaque(mi.UInt32, down * LARGEST),
        dr.opaque(mi.UInt32, columns),
        finest.bit_length() - 1,
        dr.opaque(mi.Float, top),
    )
    node_rows = 2 * down * LARGEST // finest + 1
    nodes = Values.empty(columns * node_rows)
    order = grid.square_by_square(node_rows)
    dr.eval(order)
    index = dr.arange(mi.UInt32, across * down)
    x, y = (index % across) * LARGEST, (index // across) * LARGEST
    levels: list[_Level] = []
    size = LARGEST
    of_size = dr.opaque(mi.UInt32, size)  # no kernel contains it: all levels run the same ones
    while True:
        fill(nodes, grid, order, x, y, of_size, evaluate)
        found = judged(nodes, grid, x, y, of_size, finest, shares)
        if size == finest:
            found = _with_nodes_about(found, nodes, grid, order, x, y, of_size, evaluate, shares)
        if size > 1:
            found = witnessed(found, nodes, grid, x, y, of_size, evaluate, shares)
        levels.append(_level(of_size, x, y, across * LARGEST // size, down * LARGEST // size, found))
        left: Any = dr.compress(found.halved)
        if size == finest or len(left) == 0:
            break
        size //= 2
        of_size = dr.opaque(mi.UInt32, size)
        x, y = _quarters(dr.gather(mi.UInt32, x, left), dr.gather(mi.UInt32, y, left), of_size)
    return _by_pixel(nodes, grid, levels, across * LARGEST, down * LARGEST)


def _with_nodes_about(
    found: Verdict,
    nodes: Values,
    grid: Grid,
    order: tuple[Any, Any],
    x: Any,
    y: Any,
    size: Any,
    evaluate: Evaluate,
    shares: Shares,
) -> Verdict:
    """The verdict on the finest cells again, those that do not serve with all nodes that cubics take."""
    shape = dr.gather(mi.UInt32, nodes.shape, grid.node(x, y, size, 0, 0))
    same = (shape > 0) & all_on(nodes, grid, x, y, size, shape)
    some: Any = dr.compress(~found.serves & same & grid.inside(x, y, size))
    if len(some) == 0:
        return found
    x, y = dr.gather(mi.UInt32, x, some), dr.gather(mi.UInt32, y, some)
    fill(nodes, grid, order, x, y, size, evaluate, about=1)
    for values, again in zip(found, judged(nodes, grid, x, y, size, 1 << grid.shift, shares), strict=True):
        dr.scatter(values, again, some)
    dr.eval(*found)
    return found


def _level(size: Any, x: Any, y: Any, across: int, down: int, found: Verdict) -> _Level:
    """The cells at pixels (x, y) among all of their size."""
    place = (y // size) * dr.opaque(mi.UInt32, across) + x // size
    count = across * down
    level = _Level(
        size,
        dr.zeros(mi.Bool, count),
        dr.zeros(mi.Float, count),
        dr.zeros(mi.UInt32, count),
        dr.zeros(mi.Bool, count),
        dr.full(mi.Float, dr.inf, count),
    )
    for values, of_cells in zip(level[1:], found, strict=False):
        dr.scatter(values, of_cells, place)
    return level


def _quarters(x: Any, y: Any, size: Any) -> tuple[Any, Any]:
    """The four cells, `size` pixels across, of each cell at (x, y)."""
    part = dr.arange(mi.UInt32, 4 * len(x))
    of = part >> 2
    return dr.gather(mi.UInt32, x, of) + (part & 1) * size, dr.gather(mi.UInt32, y, of) + ((part >> 1) & 1) * size


def _by_pixel(nodes: Values, grid: Grid, levels: list[_Level], pixels: int, rows: int) -> Cells:
    """Each pixel's cell."""
    index = dr.arange(mi.UInt32, pixels * rows)
    y = index // grid.pixels
    x = index - y * grid.pixels
    size, error, ray, cubic, mixed = mi.UInt32(0), mi.Float(0), mi.UInt32(0), mi.Bool(False), mi.Float(dr.inf)
    for level in levels:
        place = (y // level.size) * (grid.pixels // level.size) + x // level.size
        serves = dr.gather(mi.Bool, level.serves, place)
        size = dr.select(serves, level.size, size)
        error = dr.select(serves, dr.gather(mi.Float, level.error, place), error)
        ray = dr.select(serves, dr.gather(mi.UInt32, level.ray, place), ray)
        cubic |= dr.gather(mi.Bool, level.cubic, place, serves)
        mixed = dr.minimum(mixed, dr.gather(mi.Float, level.mixed, place))
    first = grid.node(x & ~(size - 1), y & ~(size - 1), size, 0, 0)
    shape = dr.gather(mi.UInt32, nodes.shape, first, size > 0)
    unknown: Any = dr.count((size == 0) & ~dr.isfinite(mixed))
    dr.eval(size, error, ray, cubic, mixed, shape, unknown)
    return Cells(grid, nodes.values, nodes.shape, size, shape, error, ray, cubic, mixed, int(unknown[0]))
