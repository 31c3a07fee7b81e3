"""Whether the aperture screen, its holes, the bodies and the sources can be computed together yet."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError, NotYet
from grimaldi.scene.bodies import FLAT, is_flat, plane, vertices
from grimaldi.scene.model import Body, Disk, Geometry, Mesh, Scene, Source, Sphere
from grimaldi.scene.planar import PlanarOutline

Reals = NDArray[np.float64]

_BESIDE = "a body beside an aperture screen or mask is not handled yet"


def check_screen(scene: Scene) -> None:
    """Checks a scene that has holes or masks: all in one plane, all sources on one side of it, no body in the way.

    Flat bodies that hide nothing of each other may receive the light on either side, and one body of any shape
    on the sources' own side.

    Raises:
        InputError: holes or masks that overlap.
        NotYet: anything else that is not as said above.
    """
    if not scene.screen:
        return
    if scene.holes and scene.masks:
        raise NotYet("outlines: an opaque mask beside an aperture is not handled yet; cut it out as an island")
    kind = "holes" if scene.holes else "masks"
    points = np.concatenate([loop for outline in scene.screen for loop in outline.world_loops()])
    origin, normal = scene.screen[0].origin, scene.screen[0].normal
    slack = FLAT * (np.ptp(points, axis=0).max() + np.abs(points).max())
    if np.abs((points - origin) @ normal).max() > slack:
        raise NotYet(f"aperture: {kind} in different planes are not handled yet; put all into one plane")
    _check_overlap(scene.screen)

    if not scene.sources:
        return
    normal = normal * _side(scene.sources, origin, normal, slack)  # now towards the sources
    far: list[Body] = []
    near: list[Body] = []
    for body in scene.bodies:
        low, high = _heights(body.geometry, origin, normal)
        if high <= slack and low < -slack:
            far.append(body)
        elif low < -slack or high <= slack:
            raise NotYet(f"{body.name}: a body that meets the aperture screen is not handled yet; move it away")
        elif any(
            _may_hide(body.geometry, hole, source, normal)
            for hole, source in itertools.product(scene.screen, scene.sources)
        ):
            raise NotYet(f"{body.name}: a body between source and aperture is not handled yet; move it aside")
        else:
            near.append(body)
    _check_receivers(far, scene.sources)
    if len(near) > 1:  # one alone has nothing to shade
        _check_receivers(near, scene.sources)


def check_aperture(scene: Scene, source: Source) -> None:
    """Checks that the wave out of a source's own aperture meets nothing on its way but flat receivers.

    Raises NotYet for holes and masks, and for bodies that stand in the aperture's plane or shade others.
    """
    if scene.screen:
        raise NotYet(f"{source.name}: a coherent_area beside apertures or masks is not handled yet; leave one out")
    alone = replace(scene.before(source), sources=(source,))
    origin, normal = alone.screen[0].origin, -_away(source, alone.screen[0].origin)
    points = np.concatenate(alone.screen[0].world_loops())
    slack = FLAT * (np.ptp(points, axis=0).max() + np.abs(points).max())
    # what does not reach beyond the plane meets no wave
    ahead = tuple(body for body in alone.bodies if _heights(body.geometry, origin, normal)[1] > slack)
    check_screen(replace(alone, bodies=ahead))


def _check_overlap(holes: tuple[PlanarOutline, ...]) -> None:
    import shapely

    frame = np.linalg.qr(holes[0].to_world[:3, :2])[0]
    regions = [
        functools.reduce(shapely.symmetric_difference, [shapely.Polygon(x @ frame) for x in hole.world_loops()])
        for hole in holes
    ]
    first, second = shapely.STRtree(regions).query(regions, predicate="intersects")
    for i, j in zip(first[first < second], second[first < second], strict=True):
        if regions[i].intersection(regions[j]).area > FLAT * min(regions[i].area, regions[j].area):
            raise InputError(f"aperture: holes {i + 1} and {j + 1} overlap; unite them into one")


def _side(sources: tuple[Source, ...], origin: Reals, normal: Reals, slack: float) -> float:
    """+1 where the sources are on the side that `normal` points to, else -1."""
    sides: set[float] = set()
    for source in sources:
        height = _away(source, origin) @ normal
        if abs(height) <= (FLAT if source.is_plane else slack):
            raise InputError(f"{source.name}: the source lies in the aperture screen's plane; move it off")
        sides.add(float(np.sign(height)))
    if len(sides) > 1:
        raise NotYet("aperture: sources on both sides of the screen are not handled yet; keep to one side")
    return sides.pop()


def _away(source: Source, point: Reals) -> Reals:
    """From the point (3,) towards the source; a unit vector for a plane wave."""
    return -source.direction if source.direction is not None else np.asarray(source.position) - point


def _heights(geometry: Geometry, origin: Reals, normal: Reals) -> tuple[float, float]:
    """The least and the greatest height of the body over the plane."""
    if isinstance(geometry, Sphere):
        height = float((geometry.centre - origin) @ normal)
        return height - geometry.radius, height + geometry.radius
    heights = (vertices(geometry) - origin) @ normal
    return float(heights.min()), float(heights.max())


def _may_hide(geometry: Geometry, hole: PlanarOutline, source: Source, normal: Reals) -> bool:
    """Whether the body may reach into the light cone from the source to the hole's convex hull.

    Each face of the body is compared with the cone by separating planes: the cone's sides, the plane
    through the source, the face's own. It errs towards True.
    """
    rim = _convex_hull(hole, normal)
    towards = np.stack([_away(source, corner) for corner in rim])
    sides = np.cross(np.roll(rim, -1, axis=0) - rim, towards)  # outwards: the rim runs round `normal`
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    offsets = np.einsum("ij,ij->i", sides, rim)
    faces = vertices(geometry)[None]
    if isinstance(geometry, Mesh):
        faces = geometry.vertices[geometry.faces]
    slack = FLAT * (np.abs(rim).max() + np.abs(faces).max())

    clear = ((faces @ sides.T - offsets) >= -slack).all(axis=1).any(axis=1)
    if source.position is not None:
        clear |= ((faces - source.position) @ normal >= -slack).all(axis=1)
        cone = np.concatenate([rim, source.position[None]])
    else:
        far = ((faces - rim[0]) @ normal).max() / (towards[0] @ normal)
        cone = np.concatenate([rim, rim + far * towards])
    if isinstance(geometry, (Mesh, Disk)):
        across = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
        heights = across @ cone.T - np.einsum("ij,ij->i", across, faces[:, 0])[:, None]
        clear |= (heights >= -slack).all(axis=1) | (heights <= slack).all(axis=1)
    return not bool(clear.all())


def _convex_hull(hole: PlanarOutline, normal: Reals) -> Reals:
    """Corners (n, 3) of the hole's convex hull, counterclockwise seen from where `normal` points to."""
    import shapely

    frame = np.linalg.qr(hole.to_world[:3, :2])[0]
    points = np.concatenate(hole.world_loops())
    hull = shapely.get_coordinates(shapely.MultiPoint((points - hole.origin) @ frame).convex_hull)[:-1]
    rim = hull @ frame.T + hole.origin
    turns = np.cross(rim[1] - rim[0], rim[2] - rim[0]) @ normal > 0
    return rim if turns else rim[::-1]


def _check_receivers(bodies: list[Body], sources: tuple[Source, ...]) -> None:
    """Flat bodies each on the sources' side of every other one's plane hide nothing of each other."""
    points = [vertices(body.geometry) for body in bodies]
    for body, own in zip(bodies, points, strict=True):
        if not is_flat(own):
            raise NotYet(f"{body.name}: {_BESIDE}; only flat ones that receive the light are")
        centre, normal, _ = plane(own)
        for (other, theirs), source in itertools.product(zip(bodies, points, strict=True), sources):
            side = np.sign(_away(source, centre) @ normal)
            slack = FLAT * (np.abs(own).max() + np.abs(theirs).max())
            if ((theirs - centre) @ normal * side).min() < -slack:
                raise NotYet(f"{body.name}: {_BESIDE} where it may hide {other.name!r}; move it")
