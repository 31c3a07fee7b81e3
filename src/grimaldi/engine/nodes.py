"""Nodes of cells of the film, what is known at them, and M between them by quadratics or cubics.

Nodes are a cell's corners and the middles of its sides and of itself, 3 × 3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba

from grimaldi.diffraction.model import ACROSS
from grimaldi.engine.cubics import weights
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

LARGEST = 16  # pixels across the largest cells
ROWS = 64  # of pixels, over whose borders no cubic goes, so that parts of a film begin at them


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


class Grid(NamedTuple):
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

    def inside(self, x: Any, y: Any, size: Any) -> Any:
        """Whether there are nodes on all sides of cells that cubics may take."""
        before, after = (x > 0) & (y % ROWS > 0), (x + size < self.pixels) & (y + size < self.rows)
        return before & after & ((y + size) % ROWS > 0)

    def steps(self, size: Any) -> tuple[Any, Any]:
        """From node to node of a cell, along rows and columns."""
        return size >> self.shift, (size >> self.shift) * self.columns


class Values(NamedTuple):
    """All nodes' values on the device, and which of them are there."""

    values: Any  # packets: M's real and imaginary part, distance, clearance
    error: Any
    shape: Any
    there: Any

    @staticmethod
    def empty(n: int) -> Values:
        return Values(dr.zeros(mi.Float, 4 * n), dr.zeros(mi.Float, n), dr.zeros(mi.UInt32, n), dr.zeros(mi.Bool, n))


def fill(
    nodes: Values, grid: Grid, order: tuple[Any, Any], x: Any, y: Any, size: Any, evaluate: Evaluate, about: int = 0
) -> None:
    """Ask for M at the nodes of cells, and at as many about them, that are not there yet.

    Neighbours go together: they are quicker so.
    """
    asked = dr.zeros(mi.Bool, len(nodes.there))
    side, before = dr.opaque(mi.UInt32, 3 + 2 * about), dr.opaque(mi.UInt32, about)
    index = dr.arange(mi.UInt32, (3 + 2 * about) ** 2 * len(x))  # all nodes of all cells: in one kernel
    cell, node = index // (side * side), index % (side * side)
    across, down = grid.steps(size)
    first = grid.node(dr.gather(mi.UInt32, x, cell), dr.gather(mi.UInt32, y, cell), size, 0, 0)
    dr.scatter(asked, mi.Bool(True), first + (node % side - before) * across + (node // side - before) * down)
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


def gathered(nodes: Values, grid: Grid, x: Any, y: Any, size: Any, active: Any = True) -> list[Any]:
    """The values of cells' nodes, row by row."""
    index = [grid.node(x, y, size, m, n) for n in range(3) for m in range(3)]
    return [dr.gather(mi.Array4f, nodes.values, i, active) for i in index]


def all_on(nodes: Values, grid: Grid, x: Any, y: Any, size: Any, shape: Any, active: Any = True) -> Any:
    """Whether all nodes of cells lie on a shape."""
    same = mi.Bool(True)
    for n in range(3):
        for m in range(3):
            same &= dr.gather(mi.UInt32, nodes.shape, grid.node(x, y, size, m, n), active) == shape
    return same


def or_ray(m: Any, ray: Any) -> tuple[Any, Any]:
    """M of nodes, real and imaginary, or a ray's where it is that (`Cells.ray`)."""
    return dr.select(ray > 0, mi.Float(ray) - 1, m.x), dr.select(ray > 0, 0, m.y)


def quadratic(t: Any) -> tuple[Any, Any, Any]:
    """Weights of the values at 0, 1/2 and 1."""
    return (1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)


def summed(values: list[Any], columns: tuple[Any, Any, Any], rows: tuple[Any, Any, Any]) -> Any:
    """What the quadratic through 3 × 3 values is where the weights are those of its columns and rows."""
    total = mi.Array4f(0)
    for n, v in enumerate(rows):
        for m, u in enumerate(columns):
            total = dr.fma(mi.Array4f(u * v), values[3 * n + m], total)
    return total


@syntax
def told(values: Any, grid: Grid, x: Any, y: Any, size: Any, cubic: Any, u: Any, v: Any, active: Any) -> Any:
    """What nodes say at places (u, v), 0..1, of cells at pixels (x, y), and the range of their distances."""
    steps = grid.steps(size)
    first = grid.node(x, y, size, 0, 0)
    found, low, high = mi.Array4f(0), mi.Float(dr.inf), mi.Float(0)
    if active & cubic:
        (left_out, of_u), (top_out, of_v) = weights(u), weights(v)
        corner = first - dr.select(left_out, 0, steps[0]) - dr.select(top_out, 0, steps[1])
        found, low, high = _weighted(values, corner, steps, of_u, of_v)
    if active & ~cubic:
        found, low, high = _weighted(values, first, steps, quadratic(u), quadratic(v))
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
