"""The checked scene: plain frozen data in Float64, all that the later stages read."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from grimaldi.scene.planar import PlanarOutline

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spot:
    """A beam's profile: 1 within `beam_width` of its axis, falling linearly with the angle to 0 at `cutoff` [rad]."""

    axis: Vector  # (3,), unit
    beam_width: float
    cutoff: float


@dataclass(frozen=True, eq=False)
class Source:
    """One monochromatic source, a point (eq. 1) or a plane wave (eq. 2).

    Exactly one of `position` and `direction` is set. A point may have the profile of a `spot`; a plane wave may come
    out of an `aperture`, which is the shape of index `shape` in `mi.Scene.shapes()`. `tint` (channels,) is the power
    of each colour channel of the light relative to their mean, so that channel c has the amplitude
    `amplitude * sqrt(tint[c])`.
    """

    name: str
    group: str
    amplitude: float  # A [√irradiance · length for a point, √irradiance for a plane wave]
    phase: float  # φ0 [rad]
    position: Vector | None = None  # S (3,)
    direction: Vector | None = None  # d (3,), unit
    origin: Vector = field(default_factory=lambda: np.zeros(3))  # O (3,) of eq. 2
    tint: tuple[float, ...] = (1.0, 1.0, 1.0)
    spot: Spot | None = None
    aperture: PlanarOutline | None = None
    shape: int | None = None

    @property
    def is_plane(self) -> bool:
        return self.direction is not None


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: vertices (n, 3) in world space, faces (m, 3) indices. Not welded."""

    vertices: Vector
    faces: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Facets(Mesh):
    """Triangles in the place of those of a mesh; edges (m, 3): where in the mesh the edge from each corner on begins.

    They are numbers 3 f + i of edges from corner i of face f on; inside a facet, that of some edge at its border.
    """

    edges: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Joined(Mesh):
    """Meshes one after the other; begin (n + 1,): where the faces of each begin, and how many there are."""

    begin: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sphere:
    centre: Vector
    radius: float


@dataclass(frozen=True, eq=False)
class Disk:
    """The disc |x|² + |y|² <= 1, z = 0 under the affine map `to_world` (4, 4): in general an ellipse."""

    to_world: Vector


@dataclass(frozen=True, eq=False)
class Cylinder:
    """The open tube x² + y² = 1, 0 <= z <= 1 under the affine map `to_world` (4, 4)."""

    to_world: Vector


Geometry = Mesh | Sphere | Disk | Cylinder


@dataclass(frozen=True, eq=False)
class Body:
    """An opaque shape that casts outlines.

    `shape` is the index in `mi.Scene.shapes()` of what shows it, alone or joined to others; `facets` stands for the
    geometry of a mesh that has much more triangles than its plane parts need.
    """

    name: str
    shape: int
    geometry: Geometry
    facets: Facets | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A checked scene.

    `mitsuba` is the whole scene as the camera sees it; `blockers` holds only what stops light
    (apertures, null and mask surfaces left out) and is what visibility rays are traced in, None where
    there is nothing. `surfaces` are all of `mi.Scene.shapes()`, bodies or not, None for kinds that are no
    `Geometry`. `holes` are the openings of one infinite opaque screen, `masks` opaque planar outlines
    without a shape of their own.
    """

    name: str
    mitsuba: Any
    blockers: Any
    surfaces: tuple[Geometry | None, ...]
    bodies: tuple[Body, ...]
    sources: tuple[Source, ...]
    holes: tuple[PlanarOutline, ...] = ()
    masks: tuple[PlanarOutline, ...] = ()
    unit: str | None = None  # length of one scene unit, as text for pint: "1 um"
    wavelength: Any = None  # of the scene's own `wave` integrator, as it was written there
    smooth: int = 0  # levels by which meshes with vertex normals are divided

    @property
    def screen(self) -> tuple[PlanarOutline, ...]:
        """The planar outlines that act: the holes of the one screen, or the masks."""
        return self.holes or self.masks

    def before(self, source: Source) -> Scene:
        """The scene as the waves of one of its sources meet it: behind the aperture that they come out of."""
        if source.aperture is None:
            return self
        others = tuple(body for body in self.bodies if body.shape != source.shape)
        return replace(self, bodies=others, holes=(source.aperture,), masks=())
