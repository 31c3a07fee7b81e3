"""What the physics tests share: scenes in few words, and M = U/U0 as Grimaldi computes it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import oracle
from numpy.typing import ArrayLike, NDArray

import grimaldi

APERTURE = {"type": "aperture"}
GREY = {"type": "twosided", "bsdf": {"type": "diffuse"}}


def affine(scale: ArrayLike = 1.0, at: ArrayLike = (0, 0, 0), turn: ArrayLike | None = None) -> Any:
    """The (4, 4) matrix that scales, then turns (3, 3), then moves."""
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if turn is None else np.asarray(turn, float)) * np.broadcast_to(scale, 3)
    matrix[:3, 3] = at
    return matrix


def shape(kind: str, to_world: ArrayLike, bsdf: dict[str, Any] = GREY, **parameters: Any) -> dict[str, Any]:
    """A Mitsuba shape; `to_world` is kept in Float32."""
    scalar: Any = mi.scalar_rgb
    transform = scalar.ScalarTransform4f(np.asarray(to_world, float))
    return {"type": kind, "to_world": transform, "bsdf": bsdf, **parameters}


def mesh(path: Path, vertices: ArrayLike, faces: ArrayLike) -> dict[str, Any]:
    """A Mitsuba shape of triangles, through an OBJ file written to `path`."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in np.asarray(vertices)]
    lines += [f"f {a} {b} {c}" for a, b, c in np.asarray(faces) + 1]
    path.write_text("\n".join(lines) + "\n")
    return {"type": "obj", "filename": str(path), "face_normals": True, "bsdf": GREY}


def emitter(light: oracle.Source) -> dict[str, Any]:
    """The coherent emitter of unit amplitude for a source of the oracle's."""
    if isinstance(light, oracle.Plane):
        return {"type": "coherent_directional", "direction": [float(x) for x in np.asarray(light.direction)]}
    return {"type": "coherent_point", "position": [float(x) for x in np.asarray(light.position)]}


def factor(
    light: oracle.Source,
    points: ArrayLike,
    *shapes: dict[str, Any],
    outlines: Sequence[grimaldi.PlanarOutline] = (),
    wavelength: float = 1.0,
    **options: Any,
) -> NDArray[np.complex128]:
    """M (m,) at `points` (m, 3): the computed field of one light over eq. 1-2."""
    scene = {"type": "scene", "light": emitter(light)}
    scene |= {f"shape{i}": part for i, part in enumerate(shapes)}
    points = np.atleast_2d(np.asarray(points, float))
    loaded = grimaldi.load(scene, outlines=list(outlines))
    result = grimaldi.field(loaded, points, wavelength=wavelength, **options)
    assert result.U.dims == ("wavelength", "group", "point")
    assert result.U.shape == (1, 1, len(points))
    return result.U.values[0, 0] / light.wave(points, 2 * np.pi / wavelength)[0]


def line(start: ArrayLike, end: ArrayLike, n: int) -> NDArray[np.float64]:
    """n points (n, 3) from `start` to `end`."""
    return np.linspace(np.asarray(start, float), np.asarray(end, float), n)
