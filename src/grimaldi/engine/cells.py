"""M over a picture: at nodes of cells of the film, and between them by quadratics, or cubics where these do not serve.

Nodes are a cell's corners and the middles of its sides and of itself.
M = U/U0 is far smoother than U: what a pinhole camera sees of it takes a node every few pixels, fewer where it
changes slowly. Cells are halved until what a cell's own nodes say differs by little from what the cell around them
predicted (Runge's comparison: a quadratic through nodes twice as near errs by an eighth), and where an outline's
shadow is as near as the next node, unless its fringes are wider than that; not where even the finest would differ by
too much. Where M differs from a ray's by less than a share of the tolerance, at all nodes of one of the largest cells,
that is not halved: there M is a ray's. Cells lie at fixed places of the film, so that any part of a picture has the
same nodes as the whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.model import ACROSS
from grimaldi.engine.cubics import apart, weights

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

LARGEST = 16  # pixels across the largest cells
ROWS = 64  # of pixels, over whose borders no cubic goes, so that parts of a film begin at them
HALVED = 0.25  # what halving a cell leaves of a quadratic's error, at most
AT_BEST = 1 / 16  # what it leaves of it at best: an eighth of a cubic's, less in quarters where M is straighter
STRAIGHT = 0.5  # what a quadratic leaves of a bilinear function's error, at most
SIMPSON = 1 / 6, 4 / 6, 1 / 6  # means of quadratics
OF_PIXEL = 1  # times its share, that the mean over a pixel may be off by, where that is a cell
BY_CUBICS = 1.75, 1  # times its share, that cubics and quadratics may be apart in a pixel, and in a larger cell
IN_PIXEL = 3  # times its share, that M may be off by within a pixel
FAINT = 1.5  # times what |M - M of a ray| may be at nodes, that it may be at one more place
WITNESS = 0.31, 0.64  # where in a cell M is asked for once more: fringes as wide as nodes are apart look like none
WIDE = 0.1  # |M - M of a ray| at all nodes of a cell, above which fringes, and the rim among them, are wider than it
ASIDE = 0.02  # of the distance from the camera, that a node may lie nearer or further to count as on the same side
DEPTH = 1e-4  # of the distance from the camera, that a surface may lie off the cell's


class Nodes(NamedTuple):
    """M and its error at places of the film, how far the camera's ray went, and which surface it met (0: none lit).

    `clearance` is the way to the nearest outline's shadow, in pixels as they lie on the surface.
    """

    real: Any
    imag: Any
    error: Any
    distance: Any
    shape: Any
    clearance: Any


Evaluate = Callable[[Any, Any], Nodes]
"""evaluate(x, y): nodes at places of the film [pixels], Float32 arrays."""


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


class Known(NamedTuple):
    """M between nodes, its error, and where it holds."""

    real: Any
    imag: Any
    error: Any
    holds: Any


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of some rows of a film, and what their nodes say."""

    grid: _Grid
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
        found, room = _told(self.nodes, self.grid, i, j, size, cubic, u, v, holds)
        holds &= dr.abs(distance - found.z) <= dr.maximum(DEPTH * distance, 0.25 * room)
        real, imag = _or_ray(found, dr.gather(mi.UInt32, self.ray, pixel, holds))
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


class _Grid(NamedTuple):
    """Nodes at every half of the finest cell's 2^shift pixels, `columns` in a row, over `rows` rows of `pixels`."""

    pixels: Any
    rows: Any
    columns: Any
    shift: int
    top: Any

    def square_by_square(self, rows: int) -> tuple[Any, Any]:
        """All nodes' indices, those of a block together, and in it those of a patch, and which of them there are."""
        side = 2 * LARGEST >> self.shift
        across = (self.columns + (side - 1)) // side
        down = -(-rows // side)
        index = dr.arange(mi.UInt32, int(across[0]) * down * side * side)
        square, within = index // (side * side), index % (side * side)
        part = max(side // ACROSS, 1)
        patch, place = within // (part * part), within % (part * part)
        patches = side // part
        column = (square % across) * side + (patch % patches) * part + place % part
        row = (square // across) * side + (patch // patches) * part + place // part
        return row * self.columns + column, (row < rows) & (column < self.columns)

    def pixel(self, x: Any, y: Any) -> Any:
        """The index of the pixel that holds place (x, y) of these rows."""
        return mi.UInt32(y) * self.pixels + mi.UInt32(x)

    def node(self, x: Any, y: Any, size: Any, m: int, n: int) -> Any:
        """The index of node (m, n) of 3 × 3 in the cell at pixel (x, y)."""
        return ((2 * y + n * size) >> self.shift) * self.columns + ((2 * x + m * size) >> self.shift)

    def inside(self, x: Any, y: Any, size: int) -> Any:
        """Whether there are nodes on all sides of cells that cubics may take."""
        before, after = (x > 0) & (y % ROWS > 0), (x + size < self.pixels) & (y + size < self.rows)
        return before & after & ((y + size) % ROWS > 0)

    def steps(self, size: Any) -> tuple[Any, Any]:
        """From node to node of a cell, along rows and columns."""
        return size >> self.shift, (size >> self.shift) * self.columns


class _Nodes(NamedTuple):
    """All nodes' values on the device, and which of them are there."""

    values: Any  # packets: M's real and imaginary part, distance, clearance
    error: Any
    shape: Any
    there: Any

    @staticmethod
    def empty(n: int) -> _Nodes:
        return _Nodes(dr.zeros(mi.Float, 4 * n), dr.zeros(mi.Float, n), dr.zeros(mi.UInt32, n), dr.zeros(mi.Bool, n))


class _Level(NamedTuple):
    """Cells of one size: which of the film's serve, and with what error."""

    size: int
    serves: Any
    error: Any
    ray: Any
    cubic: Any
    mixed: Any


class _Verdict(NamedTuple):
    """Whether cells serve, with M's error in them and as what (`ray`, `cubic` as in `Cells`); what else is in
    `Cells.mixed`; and whether parts of cells that do not serve may."""

    serves: Any
    error: Any
    ray: Any
    cubic: Any
    mixed: Any
    halved: Any


def cells(evaluate: Evaluate, width: int, top: int, rows: int, finest: int, shares: Shares) -> Cells:
    """The cells of `rows` rows of a film `width` pixels wide, from row `top` on, which `ROWS` divides.

    Cells are `finest` pixels or more across, a power of two.
    """
    across, down = -(-width // LARGEST), -(-rows // LARGEST)
    columns = 2 * across * LARGEST // finest + 1
    grid = _Grid(
        dr.opaque(mi.UInt32, across * LARGEST),
        dr.opaque(mi.UInt32, down * LARGEST),
        dr.opaque(mi.UInt32, columns),
        finest.bit_length() - 1,
        dr.opaque(mi.Float, top),
    )
    node_rows = 2 * down * LARGEST // finest + 1
    nodes = _Nodes.empty(columns * node_rows)
    order = grid.square_by_square(node_rows)
    index = dr.arange(mi.UInt32, across * down)
    x, y = (index % across) * LARGEST, (index // across) * LARGEST
    levels: list[_Level] = []
    size = LARGEST
    while True:
        _fill(nodes, grid, order, x, y, size, evaluate)
        found = _judged(nodes, grid, x, y, size, finest, shares)
        if size == finest:
            found = _with_nodes_about(found, nodes, grid, order, x, y, size, evaluate, shares)
        if size > 1:
            found = _witnessed(found, nodes, grid, x, y, size, evaluate, shares)
        levels.append(_level(size, x, y, across * LARGEST // size, down * LARGEST // size, found))
        left: Any = dr.compress(found.halved)
        if size == finest or len(left) == 0:
            break
        size //= 2
        x, y = _quarters(dr.gather(mi.UInt32, x, left), dr.gather(mi.UInt32, y, left), size)
    return _by_pixel(nodes, grid, levels, across * LARGEST, down * LARGEST)


def _with_nodes_about(
    found: _Verdict,
    nodes: _Nodes,
    grid: _Grid,
    order: tuple[Any, Any],
    x: Any,
    y: Any,
    size: int,
    evaluate: Evaluate,
    shares: Shares,
) -> _Verdict:
    """The verdict on the finest cells again, those that do not serve with all nodes that cubics take."""
    shape = dr.gather(mi.UInt32, nodes.shape, grid.node(x, y, size, 0, 0))
    same = (shape > 0) & _all_on(nodes, grid, x, y, size, shape)
    some: Any = dr.compress(~found.serves & same & grid.inside(x, y, size))
    if len(some) == 0:
        return found
    x, y = dr.gather(mi.UInt32, x, some), dr.gather(mi.UInt32, y, some)
    _fill(nodes, grid, order, x, y, size, evaluate, about=1)
    for values, again in zip(found, _judged(nodes, grid, x, y, size, size, shares), strict=True):
        dr.scatter(values, again, some)
    dr.eval(*found)
    return found


def _fill(
    nodes: _Nodes, grid: _Grid, order: tuple[Any, Any], x: Any, y: Any, size: int, evaluate: Evaluate, about: int = 0
) -> None:
    """Ask for M at the nodes of cells, and at as many about them, that are not there yet.

    Neighbours go together: they are quicker so.
    """
    asked = dr.zeros(mi.Bool, len(nodes.there))
    across, down = grid.steps(size)
    first = grid.node(x, y, size, 0, 0) - about * (across + down)
    for n in range(3 + 2 * about):
        for m in range(3 + 2 * about):
            dr.scatter(asked, mi.Bool(True), first + (n * down + m * across))
    asked &= ~nodes.there
    left: Any = dr.compress(dr.gather(mi.Bool, asked, order[0], order[1]))
    index = dr.gather(mi.UInt32, order[0], left)
    if len(index) == 0:
        return
    step = 0.5 * (1 << grid.shift)
    row = index // grid.columns
    found = evaluate(step * mi.Float(index - row * grid.columns), grid.top + step * mi.Float(row))
    values = mi.Array4f(found.real, found.imag, found.distance, found.clearance)
    dr.scatter(nodes.values, values, index)
    dr.scatter(nodes.error, mi.Float(found.error), index)
    dr.scatter(nodes.shape, found.shape, index)
    dr.scatter(nodes.there, mi.Bool(True), index)
    dr.eval(nodes.values, nodes.error, nodes.shape, nodes.there)


def _judged(nodes: _Nodes, grid: _Grid, x: Any, y: Any, size: int, finest: int, shares: Shares) -> _Verdict:
    """What the nodes of cells at (x, y) tell of them."""
    own = _gathered(nodes, grid, x, y, size)
    index = [grid.node(x, y, size, m, n) for n in range(3) for m in range(3)]
    shapes = [dr.gather(mi.UInt32, nodes.shape, i) for i in index]
    shape, error, clear = shapes[0], mi.Float(0), mi.Float(dr.inf)
    same = shape > 0
    for i, s, c in zip(index, shapes, own, strict=True):
        same &= s == shape
        error = dr.maximum(error, dr.gather(mi.Float, nodes.error, i))
        clear = dr.minimum(clear, c.w)
    least, most, modulus = _waves(own)
    off, mean = _missed(nodes, grid, x, y, size, own, shape, same)
    # fringes that are finer than nodes are no better told by twice as many
    doubt = dr.select(most > 0, dr.clip(off / (HALVED**2 * most), 1, 1 / HALVED), 1)
    off, mean = off * doubt, mean * doubt
    light = dr.minimum(modulus, 1) + dr.opaque(mi.Float, shares.beside)
    left, left_of_mean = off * (light + off), mean * (light + mean)

    missed, rays = dr.opaque(mi.Float, shares.missed), dr.opaque(mi.Float, shares.rays)
    allowed = dr.opaque(mi.Float, shares.most)
    ray, mixed = mi.UInt32(0), mi.Float(dr.inf)
    resolved = (clear > size) | (size == finest)
    serves = same & (off <= allowed)
    if size == 1:
        serves &= (left_of_mean <= OF_PIXEL * missed) & (left <= IN_PIXEL * missed)
    else:
        serves &= (left <= missed) & (resolved | (least > WIDE))
    cubic, off_cubic = _by_cubics(nodes, grid, x, y, size, light, shares)
    cubic &= ~serves & (resolved | (least > WIDE))
    serves |= cubic
    off = dr.select(cubic, off_cubic, off)
    if size == LARGEST:
        ray = dr.select(same & resolved & (most <= rays), dr.select(own[0].x > 0.5, mi.UInt32(2), 1), 0)
        serves |= ray > 0
        cubic &= ray == 0
        off = dr.select(ray > 0, most, off)
    within = (IN_PIXEL if finest == 1 else 1) * missed
    if size == finest:
        spread = _spread(own, shapes)
        alike = (spread <= allowed) & (spread * (light + spread) <= within)
        mixed = dr.select(~same & alike, error + spread, dr.inf)
    hopeless = same & (left * AT_BEST ** math.log2(size / finest) > within)  # not where M is NaN
    halved = ~serves & ~hopeless
    verdict = _Verdict(serves, error + off, ray, cubic, mixed, halved)
    dr.eval(*verdict)
    return verdict


def _witnessed(
    found: _Verdict, nodes: _Nodes, grid: _Grid, x: Any, y: Any, size: int, evaluate: Evaluate, shares: Shares
) -> _Verdict:
    """The verdict, but for cells in which M is something else off their nodes."""
    some: Any = dr.compress(found.serves)
    if len(some) == 0:
        return found
    x, y, ray = (dr.gather(mi.UInt32, values, some) for values in (x, y, found.ray))
    cubic = dr.gather(mi.Bool, found.cubic, some)
    u, v = WITNESS
    there = evaluate(mi.Float(x) + size * u, grid.top + mi.Float(y) + size * v)
    told, _ = _told(nodes.values, grid, x, y, size, cubic, mi.Float(u), mi.Float(v), mi.Bool(True))
    real, imag = _or_ray(told, ray)
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


def _waves(own: list[Any]) -> tuple[Any, Any, Any]:
    """The least and the largest |M - M of a ray|, and the largest |M| at nodes."""
    least, of_lit, of_dark = mi.Float(dr.inf), mi.Float(0), mi.Float(0)
    for c in own:
        from_one, from_zero = dr.square(c.x - 1) + dr.square(c.y), dr.square(c.x) + dr.square(c.y)
        least = dr.minimum(least, dr.minimum(from_one, from_zero))
        of_lit, of_dark = dr.maximum(of_lit, from_one), dr.maximum(of_dark, from_zero)
    return dr.sqrt(least), dr.sqrt(dr.minimum(of_lit, of_dark)), dr.sqrt(of_dark)


def _missed(
    nodes: _Nodes, grid: _Grid, x: Any, y: Any, size: int, own: list[Any], shape: Any, same: Any
) -> tuple[Any, Any]:
    """What quadratics leave of M in cells at most, and of its mean, by what the cell around them predicted."""
    c00, c10, c20, c01, c11, c21, c02, c12, c22 = own
    bent = [c10 - 0.5 * (c00 + c20), c01 - 0.5 * (c00 + c02), c21 - 0.5 * (c20 + c22), c12 - 0.5 * (c02 + c22)]
    bent.append(c11 - 0.25 * (c00 + c20 + c02 + c22))
    off = STRAIGHT * _largest(bent)
    mean = STRAIGHT * _length((bent[0] + bent[1] + bent[2] + bent[3] + 4 * bent[4]) / 9)
    if size == LARGEST:
        return off, mean
    around = x & ~mi.UInt32(2 * size - 1), y & ~mi.UInt32(2 * size - 1)
    coarse = _gathered(nodes, grid, *around, 2 * size)
    predicted = same & _all_on(nodes, grid, *around, 2 * size, shape)
    a, b = (mi.Float(c - c0) / (2 * size) for c, c0 in zip((x, y), around, strict=True))
    columns = [_quadratic(a + 0.25 * m) for m in range(3)]
    rows = [_quadratic(b + 0.25 * n) for n in range(3)]
    misses = [own[3 * n + m] - _sum(coarse, columns[m], rows[n]) for n in range(3) for m in range(3)]
    return (
        dr.select(predicted, HALVED * _largest(misses), off),
        dr.select(predicted, HALVED * _length(_sum(misses, SIMPSON, SIMPSON)), mean),
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


def _gathered(nodes: _Nodes, grid: _Grid, x: Any, y: Any, size: int) -> list[Any]:
    """The values of cells' nodes, row by row."""
    return [dr.gather(mi.Array4f, nodes.values, grid.node(x, y, size, m, n)) for n in range(3) for m in range(3)]


def _all_on(nodes: _Nodes, grid: _Grid, x: Any, y: Any, size: int, shape: Any) -> Any:
    """Whether all nodes of cells lie on a shape."""
    same = mi.Bool(True)
    for n in range(3):
        for m in range(3):
            same &= dr.gather(mi.UInt32, nodes.shape, grid.node(x, y, size, m, n)) == shape
    return same


def _length(d: Any) -> Any:
    """|M| of a difference."""
    return dr.sqrt(dr.fma(d.x, d.x, d.y * d.y))


def _or_ray(m: Any, ray: Any) -> tuple[Any, Any]:
    """M of nodes, real and imaginary, or a ray's where it is that (`Cells.ray`)."""
    return dr.select(ray > 0, mi.Float(ray) - 1, m.x), dr.select(ray > 0, 0, m.y)


def _largest(differences: list[Any]) -> Any:
    """The largest |M| of differences."""
    most = mi.Float(0)
    for d in differences:
        most = dr.maximum(most, d.x * d.x + d.y * d.y)
    return dr.sqrt(most)


def _quadratic(t: Any) -> tuple[Any, Any, Any]:
    """Weights of the values at 0, 1/2 and 1."""
    return (1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)


def _sum(values: list[Any], columns: tuple[Any, Any, Any], rows: tuple[Any, Any, Any]) -> Any:
    """What the quadratic through 3 × 3 values is where the weights are those of its columns and rows."""
    total = mi.Array4f(0)
    for n, v in enumerate(rows):
        for m, u in enumerate(columns):
            total = dr.fma(mi.Array4f(u * v), values[3 * n + m], total)
    return total


def _level(size: int, x: Any, y: Any, across: int, down: int, found: _Verdict) -> _Level:
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


def _quarters(x: Any, y: Any, size: int) -> tuple[Any, Any]:
    """The four cells, `size` pixels across, of each cell at (x, y)."""
    part = dr.arange(mi.UInt32, 4 * len(x))
    of = part >> 2
    return dr.gather(mi.UInt32, x, of) + (part & 1) * size, dr.gather(mi.UInt32, y, of) + ((part >> 1) & 1) * size


def _by_pixel(nodes: _Nodes, grid: _Grid, levels: list[_Level], pixels: int, rows: int) -> Cells:
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


def _by_cubics(nodes: _Nodes, grid: _Grid, x: Any, y: Any, size: int, light: Any, shares: Shares) -> tuple[Any, Any]:
    """Whether cubics serve cells, and what they may leave of M there."""
    across, down = grid.steps(size)
    first = grid.node(x, y, size, 0, 0) - (across + down)
    off = apart(nodes.values, nodes.shape, first, (across, down), grid.inside(x, y, size))
    missed, allowed = dr.opaque(mi.Float, shares.missed), dr.opaque(mi.Float, shares.most)
    return (off <= allowed) & (off * (light + off) <= BY_CUBICS[size > 1] * missed), off


@dr.syntax
def _told(values: Any, grid: _Grid, x: Any, y: Any, size: Any, cubic: Any, u: Any, v: Any, active: Any) -> Any:
    """What nodes say at places (u, v), 0..1, of cells at pixels (x, y), and the range of their distances."""
    steps = grid.steps(size)
    first = grid.node(x, y, size, 0, 0)
    found, low, high = mi.Array4f(0), mi.Float(dr.inf), mi.Float(0)
    if active & cubic:
        (left_out, of_u), (top_out, of_v) = weights(u), weights(v)
        corner = first - dr.select(left_out, 0, steps[0]) - dr.select(top_out, 0, steps[1])
        found, low, high = _weighted(values, corner, steps, of_u, of_v)
    if active & ~cubic:
        found, low, high = _weighted(values, first, steps, _quadratic(u), _quadratic(v))
    return found, high - low


def _weighted(values: Any, first: Any, steps: tuple[Any, Any], across: Any, down: Any) -> tuple[Any, Any, Any]:
    """Nodes from the first on by weights of their columns and rows, summed; their least and largest distance."""
    found, low, high = mi.Array4f(0), mi.Float(dr.inf), mi.Float(0)
    for n, b in enumerate(down):
        for m, a in enumerate(across):
            value = dr.gather(mi.Array4f, values, first + (n * steps[1] + m * steps[0]))
            found = dr.fma(mi.Array4f(a * b), value, found)
            low, high = dr.minimum(low, value.z), dr.maximum(high, value.z)
    return found, low, high
