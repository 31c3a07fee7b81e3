"""The interface of a diffraction model: (scene, source, outline) → a function from points to M and its error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import drjit as dr
import mitsuba

from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Scene, Source

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

Precision = Literal["auto", "double"]
Occlusion = Literal["graded", "binary", "none"]
Rim = Literal["sharp", "smooth"]
Weights = Literal["report", "length", "kernel"]
NYQUIST: Literal["nyquist"] = "nyquist"


@dataclass(frozen=True)
class Options:
    """What every model is asked for.

    tolerance: |M_computed - M| allowed for each source and point; precision: "auto" or "double";
    occlusion: how bodies block the way from an outline to a point: as knife edges where it grazes them, by yes or
    no, or not at all; "graded" is `boundary`'s alone, the other models take it for "binary";
    rim: "sharp", black screens, or "smooth", waves that creep round smooth bodies (`boundary` alone);
    fast: whether `field` may take one transform for all points of a plane behind holes or masks, and `render` may
    interpolate M over the film.

    Of the models that sum over sources: n is how many an edge (`huygens`; "nyquist": λ/2 apart) or a point
    (`area`) gets, None for the model's own choice; `huygens` has `weights`, and the distance epsilon [scene units]
    of the report's silhouette test, None for its own choice.
    """

    tolerance: float = 1e-3
    precision: Precision = "auto"
    occlusion: Occlusion = "graded"
    rim: Rim = "sharp"
    n: int | Literal["nyquist"] | None = None
    weights: Weights = "report"
    epsilon: float | None = None
    fast: bool = True


class Receivers(NamedTuple):
    """Points where the field is asked, as Dr.Jit arrays; part of a traced kernel."""

    p: Any  # Float64 (3)
    n: Any  # unit normal of the surface the point lies on, towards the side that is asked; 0 in free space
    active: Any
    block: Any = None  # of `Blocks`, in which each lies; OUTSIDE where it lies in none
    cell: Any = None  # of that block
    u: Any = None  # where in it, 0..1 along the film's rows and columns
    v: Any = None

    def some(self, index: Any) -> Receivers:
        """Those at places of the arrays, active."""
        p, n, *place = (None if v is None else dr.gather(type(v), v, index) for v in (self.p, self.n, *self[3:]))
        return Receivers(p, n, dr.full(type(self.active), True, dr.width(index)), *place)


OUTSIDE = 0xFFFFFFFF
ACROSS = 4  # cells across a block
LATTICE = ACROSS + 1  # corners of those
UP, LEFT, RIGHT = 1, 3, 4  # places in `Blocks.beside`


class Boxes(NamedTuple):
    """A box about each block on a curved surface, along three axes across each other: a receiver P lies x of the way
    from the middle to a side, x = a·(P - middle)."""

    middle: Any  # Float64 (3)
    axes: Any  # three Float32 packets each, of which the last number is none: a of each axis; 0 of flat blocks

    def axes_of(self, block: Any, active: Any) -> list[Any]:
        """a of each axis of some."""
        rows = (dr.gather(mi.Array4f, self.axes, 3 * block + i, active) for i in range(3))
        return [mi.Vector3f(row.x, row.y, row.z) for row in rows]

    def place(self, p: Any, block: Any, active: Any) -> tuple[Any, ...]:
        """Where receivers lie in the boxes of their blocks."""
        d = mi.Vector3f(p - dr.gather(type(self.middle), self.middle, block, active))
        return tuple(dr.dot(axis, d) for axis in self.axes_of(block, active))


class Blocks(NamedTuple):
    """Groups of receivers side by side, as flat Dr.Jit arrays: what changes slowly is found once for each."""

    p: Any  # Float64 (3): a receiver in the middle
    n: Any  # as in `Receivers`, there
    radius: Any  # of the sphere about p that holds the receivers [scene units]
    bend: Any  # how far their normals differ from n at most; 0 where all lie in the plane through p across n
    active: Any
    lattice: Any  # Float64 (3): receivers at the corners of ACROSS × ACROSS cells of each, row by row
    normals: Any  # as n, there
    right: Any  # a pixel's way along the film's rows, and along its columns, on the plane; 0 where there is none
    down: Any
    members: Any  # UInt32: a bit for each of those that lies on the same surface, or in its plane
    boxes: Boxes
    beside: tuple[Any, ...]  # UInt32: blocks around it in the same plane, itself where none is

    def of(self, receivers: Receivers, block: Any) -> Any:
        """`block` where receivers lie in it, OUTSIDE elsewhere."""
        active = receivers.active & (block < dr.width(self.p))
        active &= dr.gather(type(self.active), self.active, block, active)
        d = receivers.p - dr.gather(type(self.p), self.p, block, active)
        n = dr.gather(type(self.n), self.n, block, active)
        F = type(d.x)
        radius = F(dr.gather(type(self.radius), self.radius, block, active))
        bend = dr.gather(type(self.bend), self.bend, block, active)
        inside = active & (dr.squared_norm(d) <= radius * radius)
        turned = dr.squared_norm(receivers.n - n)
        in_plane = (turned < 1e-6) & (dr.abs(dr.dot(type(d)(n), d)) <= 1e-3 * radius)
        inside &= dr.select(bend == 0, in_plane, turned <= bend * bend)
        return dr.select(inside, block, OUTSIDE)


class Factor(NamedTuple):
    """M = U/U0 at the receivers, the estimated |M_computed - M|, and how near the ray passes an outline.

    `clearance` [scene units] is 0 where a model does not tell.
    """

    real: Any
    imag: Any
    error: Any
    clearance: Any = 0


Evaluate = Callable[[Receivers], Factor]


@runtime_checkable
class Grouped(Protocol):
    """An `Evaluate` that can be quicker where it knows which receivers lie side by side."""

    @property
    def items(self) -> int:
        """How much of the outlines is looked at for each block; 0 where blocks are of no use."""
        ...

    @property
    def inside_only(self) -> bool:
        """Whether `among` gives no M of any meaning to what lies OUTSIDE of all blocks."""
        ...

    def __call__(self, receivers: Receivers) -> Factor: ...

    def among(self, blocks: Blocks) -> Evaluate:
        """The same for receivers that are placed in blocks."""
        ...


@runtime_checkable
class Twofold(Protocol):
    """An `Evaluate` that asks `single`, and `double` where that errs by more than the tolerance: seldom, and slowly."""

    @property
    def single(self) -> Evaluate: ...

    @property
    def double(self) -> Evaluate: ...

    @property
    def tolerance(self) -> float: ...

    def __call__(self, receivers: Receivers) -> Factor: ...


Model = Callable[[Scene, Source, Outline, float, Options], Evaluate]
"""model(scene, source, outline, k, options); a pure function of blocks of points, traceable by Dr.Jit."""
