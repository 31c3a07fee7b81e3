"""pbrt's shapes as Mitsuba's, in world space."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.scene.pbrt import lights
from grimaldi.scene.pbrt.loop import subdivide
from grimaldi.scene.pbrt.parameters import Parameters
from grimaldi.scene.pbrt.transforms import Reals, as_mitsubas, mirrors, point, similar
from grimaldi.scene.triangles import as_mesh, check_triangles

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Shape:
    """A Shape directive and the graphics state it stands in. `radiance` (3,) is that of an area light, or None."""

    kind: str
    parameters: Parameters
    folder: Path
    to_world: Reals
    reversed: bool
    bsdf: dict[str, Any]
    radiance: Reals | None = None

    def built(self) -> Any:
        """What Mitsuba takes for it: a dictionary, or a mesh; None where there is none like it.

        Raises InputError, naming the place, for a mesh that is wrong, a file that is not there and a transform that
        makes another shape of it.
        """
        p, emitter = self.parameters, self._emitter()
        match self.kind:
            case "sphere":
                centre = point(self.to_world, np.zeros(3))
                radius = p.one("radius", 1.0) * self._scale()
                if self.radiance is not None:
                    return lights.of_sphere(self.radiance, radius, centre)
                return {"type": "sphere", "center": centre.tolist(), "radius": radius, **self._surface(), **emitter}
            case "cylinder":
                radius = p.one("radius", 1.0)
                p0, p1 = (
                    point(self.to_world, np.array([0, 0, p.one(name, default)])).tolist()
                    for name, default in (("zmin", -1.0), ("zmax", 1.0))
                )
                return {
                    "type": "cylinder", "p0": p0, "p1": p1, "radius": radius * self._scale(),
                    **self._surface(), **emitter,
                }  # fmt: skip
            case "disk":
                radius, height = p.one("radius", 1.0), p.one("height", 0.0)
                own = np.diag([radius, radius, 1.0, 1.0])
                own[2, 3] = height
                to_world = as_mitsubas(self.to_world @ own)
                return {"type": "disk", "to_world": to_world, **self._surface(), **emitter}
            case "trianglemesh":
                return self._mesh(*self._triangles())
            case "loopsubdiv":
                points, faces = self._triangles()
                levels = p.one("levels", p.one("nlevels", 3))
                if not 0 <= levels <= 8:
                    raise p.place.error(f"levels is {levels}; give 0 to 8, each of which makes four faces of one")
                try:
                    return self._mesh(*subdivide(points, faces, levels), smooth=True)
                except InputError as error:
                    raise p.place.error(f"loopsubdiv: {error}") from None
            case "plymesh":
                return self._ply() | self._surface(flipped=mirrors(self.to_world) != self.reversed) | emitter
            case _:
                return None

    def _scale(self) -> float:
        scale = similar(self.to_world)
        if scale is None:
            raise self.parameters.place.error(
                f"the transform makes no {self.kind} of a {self.kind}; scale all axes alike, or use a mesh"
            )
        return scale

    def _surface(self, flipped: bool | None = None) -> dict[str, Any]:
        return {"bsdf": self.bsdf, "flip_normals": self.reversed if flipped is None else flipped}

    def _emitter(self) -> dict[str, Any]:
        return {} if self.radiance is None else {"emitter": lights.of_surface(self.radiance)}

    def _triangles(self) -> tuple[Reals, Integers]:
        p = self.parameters
        points, corners = p.array("P", 3), p.array("indices", 3)
        if points is None:
            raise p.place.error(f"{self.kind}: P is missing; give its vertices")
        if corners is None and len(points) != 3:
            raise p.place.error(f"{self.kind}: indices are missing; give three for each triangle")
        faces = np.array([[0, 1, 2]]) if corners is None else corners.astype(np.int64)
        if corners is not None and (faces != corners).any():
            raise p.place.error(f"{self.kind}: indices are not whole numbers; give three for each triangle")
        check_triangles(points, faces, f"{p.place.path}, line {p.place.line}")
        return points, faces

    def _mesh(self, points: Reals, faces: Integers, smooth: bool = False) -> Any:
        """A Mitsuba mesh, its faces turned so that their normals point as pbrt's do."""
        import mitsuba as mi

        p = self.parameters
        normals = p.array("N", 3)
        uv = p.array("uv" if p.has("uv") else "st", 2)
        for name, values in (("N", normals), ("uv", uv)):
            if values is not None and len(values) != len(points):
                raise p.place.error(f"{self.kind}: {len(values)} {name} for {len(points)} vertices; give one for each")
        linear = self.to_world[:3, :3]
        if abs(np.linalg.det(linear)) < 1e-30 * np.linalg.norm(linear) ** 3:
            raise p.place.error("the transform flattens it; give a scale that is nowhere 0")
        if normals is not None:
            normals = normals @ np.linalg.inv(linear)
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        turned = faces[:, ::-1] if mirrors(self.to_world) != self.reversed else faces
        props = mi.Properties()
        for name, part in ({"bsdf": self.bsdf} | self._emitter()).items():
            props[name] = mi.load_dict(part)
        world = points @ linear.T + self.to_world[:3, 3]
        return as_mesh(mi, self.kind, world, turned, props, smooth=smooth, normals=normals, uv=uv)

    def _ply(self) -> dict[str, Any]:
        p = self.parameters
        path = self.folder / p.one("filename", "")
        if not path.is_file():
            raise p.place.error(f"file {p.one('filename', '')!r} not found; name it relative to the scene's folder")
        if path.suffix == ".gz":
            raise p.place.error(f"{path.name} is compressed; unpack it, and name the .ply file")
        flat = b" nx" not in path.read_bytes()[:4096].partition(b"end_header")[0]  # as pbrt shades it
        to_world = as_mitsubas(self.to_world)
        return {"type": "ply", "filename": str(path), "face_normals": flat, "to_world": to_world}
