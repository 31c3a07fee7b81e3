"""Meshes with vertex normals, divided into the curved surfaces that they stand for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba
import numpy as np
import oracle
import pytest
import trimesh
from numpy.typing import NDArray
from optics import GREY, emitter, line, mesh, shape

import grimaldi
from grimaldi.errors import InputError
from grimaldi.scene.bodies import Surface
from grimaldi.scene.model import Mesh, Scene
from grimaldi.scene.smooth import subdivided

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for
mi.set_variant("llvm_ad_mono")

Reals = NDArray[np.float64]

LAMP = oracle.Spherical((0.3, -0.2, -40))


def surface(
    vertices: Any, faces: Any, normals: Any, uv: Any = None, attributes: dict[str, Reals] | None = None
) -> Surface:
    return Surface(np.array(vertices), np.array(faces), np.array(normals), uv, attributes or {})


def icosphere(level: int) -> Surface:
    ball = trimesh.creation.icosphere(level)
    return surface(ball.vertices, ball.faces, ball.vertices)


def grid_sphere(n: int) -> Surface:
    """Longitudes and latitudes, with a seam of vertices that lie twice in one place, and poles of many."""
    theta, phi = np.meshgrid(np.pi * np.arange(n + 1) / n, 2 * np.pi * np.arange(2 * n + 1) / (2 * n), indexing="ij")
    theta[-1], phi[:, -1] = np.pi, 0
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=2)
    points[0], points[-1] = (0, 0, 1), (0, 0, -1)
    a = np.arange((n + 1) * (2 * n + 1)).reshape(n + 1, 2 * n + 1)
    corners = [x.ravel() for x in (a[:-1, :-1], a[1:, :-1], a[1:, 1:], a[:-1, 1:])]
    faces = np.concatenate([np.stack([corners[i] for i in t], axis=1) for t in ((0, 1, 2), (0, 2, 3))])
    flat = points.reshape(-1, 3)
    return surface(flat, faces, flat)


def can(n: int) -> Surface:
    """A closed cylinder of radius 1 between z = ±1; at the rims side and lids have normals of their own."""
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    z = np.array([0.0, 0, 1])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    bottom, top = np.full(n, 4 * n), np.full(n, 4 * n + 1)
    faces = [(i, j, n + j), (i, n + j, n + i), (bottom, 2 * n + j, 2 * n + i), (top, 3 * n + i, 3 * n + j)]
    return surface(
        np.concatenate([ring - z, ring + z, ring - z, ring + z, [-z, z]]),
        np.concatenate([np.stack(f, axis=1) for f in faces]),
        np.concatenate([ring, ring, np.tile(-z, (n, 1)), np.tile(z, (n, 1)), [-z, z]]),
    )


def obj(path: Path, s: Surface, scale: float = 1.0, **parameters: Any) -> dict[str, Any]:
    """A Mitsuba shape with vertex normals, through an OBJ file."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in scale * s.vertices]
    lines += [f"vn {x:.9g} {y:.9g} {z:.9g}" for x, y, z in s.normals]
    lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in s.faces + 1]
    path.write_text("\n".join(lines) + "\n")
    return {"type": "obj", "filename": str(path), "bsdf": GREY, **parameters}


def slope(sizes: Any, errors: Any) -> float:
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


# ---------------------------------------------------------------------------------------- patches


def test_a_face_is_the_patch_of_the_paper():
    """b(u, v, w) of Vlachos et al. 2001, section 3.1, written out as there."""
    rng = np.random.default_rng(1)
    p, n = rng.normal(size=(2, 3, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)

    def w(i: int, j: int) -> float:
        return float((p[j] - p[i]) @ n[i])

    def b(i: int, j: int) -> Reals:
        return (2 * p[i] + p[j] - w(i, j) * n[i]) / 3

    e = (b(0, 1) + b(1, 0) + b(1, 2) + b(2, 1) + b(2, 0) + b(0, 2)) / 6
    centre = e + (e - p.sum(axis=0) / 3) / 2
    fine = subdivided(surface(p, [[0, 1, 2]], n), 2)
    assert len(fine.vertices) == 15
    expected = []
    for i, j in np.argwhere(np.tri(5)[::-1]):
        u, v, t = i / 4, j / 4, 1 - (i + j) / 4
        point = u**3 * p[0] + v**3 * p[1] + t**3 * p[2] + 6 * u * v * t * centre
        point += 3 * (u * u * v * b(0, 1) + u * v * v * b(1, 0) + v * v * t * b(1, 2))
        point += 3 * (v * t * t * b(2, 1) + t * t * u * b(2, 0) + t * u * u * b(0, 2))
        expected.append(point)
    apart = np.linalg.norm(fine.vertices[:, None] - expected, axis=2)
    assert sorted(apart.argmin(axis=1)) == list(range(15))
    assert apart.min(axis=1).max() < 1e-14
    assert len(np.unique(np.sort(fine.faces, axis=1), axis=0)) == 16


@pytest.mark.parametrize(("make", "sizes"), [(icosphere, (1, 2, 3)), (grid_sphere, (6, 12, 24))])
def test_distance_from_a_sphere_falls_with_the_fourth_power_of_the_edges(make, sizes):
    lengths, flat, curved = [], [], []
    for size in sizes:
        ball = make(size)
        corners = ball.vertices[ball.faces]
        lengths.append(np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1).max())
        flat.append(1 - np.linalg.norm(corners.mean(axis=1), axis=1).min())
        curved.append(np.abs(np.linalg.norm(subdivided(ball, 3).vertices, axis=1) - 1).max())
    assert slope(lengths, flat) == pytest.approx(2, abs=0.1)
    assert slope(lengths, curved) == pytest.approx(4, abs=0.15)
    assert curved[-1] < 0.02 * flat[-1]


@pytest.mark.parametrize(
    ("level", "faces", "patch"),
    [(2, (1.8e-2, 4.8e-3, 1.6e-3, 7.4e-4), 4.7e-4), (3, (4.5e-3, 1.2e-3, 3.1e-4, 1.0e-4), 3.1e-5)],
)
def test_distances_are_those_of_the_documentation(level, faces, patch):
    """docs/limits.md: how far inside the sphere the faces of 320 and 1280 lie, and their patches."""
    ball = icosphere(level)
    divided = [ball, *(subdivided(ball, smooth) for smooth in (1, 2, 3))]
    inside = [1 - np.linalg.norm(s.vertices[s.faces].mean(axis=1), axis=1).min() for s in divided]
    assert inside == pytest.approx(faces, rel=0.05)
    assert 1 - np.linalg.norm(subdivided(ball, 5).vertices, axis=1).min() == pytest.approx(patch, rel=0.05)


def test_a_crease_is_the_line_where_its_faces_planes_meet():
    """The rim of a can becomes a circle in the plane of its lid, to the fourth power of the edges."""
    counts, errors = (8, 16, 32), []
    for n in counts:
        fine = subdivided(can(n), 3)
        side = np.abs(fine.normals[:, 2]) < 0.5
        errors.append(np.abs(np.linalg.norm(fine.vertices[side, :2], axis=1) - 1).max())
        np.testing.assert_array_equal(np.abs(fine.vertices[~side, 2]), 1)
    assert slope([1 / n for n in counts], errors) == pytest.approx(4, abs=0.15)


def test_a_crease_without_a_direction_stays_straight():
    """Two faces whose normals' planes meet far from the direction of their common edge."""
    points = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0, 0, 0], [1, 0, 0], [0.5, -1, 0]]
    across = np.array([np.sin(1.2), -np.cos(1.2), 0])  # perpendicular to where they meet, 1.2 rad from the edge
    normals = np.repeat([0.6 * across + [0, 0, 0.8], -0.6 * across + [0, 0, 0.8]], 3, axis=0)
    fine = subdivided(surface(points, [[0, 1, 2], [4, 3, 5]], normals), 2)
    edge = fine.vertices[np.abs(fine.vertices[:, 1]) < 1e-12]
    assert len(edge) == 10
    np.testing.assert_allclose(edge[:, 2], 0, atol=1e-15)
    assert np.abs(fine.vertices[:, 2]).max() > 0.02  # while the other edges bend


@pytest.mark.parametrize("make", [lambda: icosphere(1), lambda: grid_sphere(6), lambda: can(8)])
def test_nothing_cracks(make):
    """In single precision every edge is passed once each way, welded by its ends' exact places."""
    fine = subdivided(make(), 2)
    _, place = np.unique(fine.vertices.astype(np.float32) + np.float32(0), axis=0, return_inverse=True)
    faces = place.reshape(-1)[fine.faces]
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, count = np.unique(sides, axis=0, return_counts=True)
    forth, back = (np.unique(s, axis=0) for s in (sides, sides[:, ::-1]))
    assert (count == 1).all()
    np.testing.assert_array_equal(forth, back)


def test_values_are_linear_on_each_face():
    ball = icosphere(0)
    position = {"vertex_place": ball.vertices, "face_number": np.arange(20.0)[:, None]}
    fine = subdivided(surface(ball.vertices, ball.faces, ball.normals, uv=ball.vertices[:, :2], attributes=position), 2)
    place = fine.attributes["vertex_place"]
    assert fine.uv is not None
    np.testing.assert_array_equal(fine.uv, place[:, :2])
    np.testing.assert_allclose(fine.normals, place / np.linalg.norm(place, axis=1, keepdims=True), atol=1e-15)
    number = fine.attributes["face_number"][:, 0].astype(int)
    plane = ball.vertices[ball.faces].mean(axis=1)[number]  # from the centre, perpendicular to the face
    height = np.einsum("fij,fj->fi", place[fine.faces], plane)
    np.testing.assert_allclose(height, (plane**2).sum(axis=1)[:, None] * np.ones(3), rtol=1e-12)


# ----------------------------------------------------------------------------------------- scenes


def loaded(smooth: int, **parts: Any) -> Scene:
    return grimaldi.load({"type": "scene", "light": emitter(LAMP), **parts}, smooth=smooth)


@pytest.mark.parametrize("faces", [320, 1280])
def test_the_field_behind_a_coarse_ball_is_nearly_that_of_a_sphere(tmp_path, faces):
    points = line((-8, 0.3, 60), (8, 0.5, 60), 41)
    sphere = shape("sphere", np.diag([4.0, 4, 4, 1]))
    ball = obj(tmp_path / "ball.obj", icosphere({320: 2, 1280: 3}[faces]), 4.0)

    def M(part: dict[str, Any], smooth: int) -> NDArray[np.complex128]:
        scene = {"type": "scene", "light": emitter(LAMP), "ball": part}
        field = grimaldi.field(scene, points, wavelength=0.5, tolerance=1e-4, smooth=smooth)
        assert field.attrs["smooth"] == (smooth if part is ball else 0)
        return field.U.values[0, 0] / LAMP.wave(points, 2 * np.pi / 0.5)[0]

    exact = M(sphere, 2)
    coarse, fine = (float(np.abs(M(ball, smooth) - exact).max()) for smooth in (0, 2))
    assert fine < coarse / 7
    assert fine < {320: 0.01, 1280: 0.003}[faces]


def test_flat_meshes_and_meshes_without_normals_are_as_they_were(tmp_path):
    box = trimesh.creation.box((2, 3, 4))
    corners = box.vertices[box.faces].reshape(-1, 3)
    turned = corners @ trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3].T + [10, 0, 0]
    normals = np.repeat(np.cross(turned[1::3] - turned[::3], turned[2::3] - turned[::3]), 3, axis=0)
    parts = {
        "cube": shape("cube", np.eye(4)),
        "wall": shape("rectangle", np.diag([9.0, 9, 9, 1])),
        "box": obj(tmp_path / "box.obj", surface(turned, np.arange(36).reshape(-1, 3), normals)),
        "flat": mesh(tmp_path / "flat.obj", icosphere(1).vertices + [0, 20, 0], icosphere(1).faces),
    }
    before, after = (loaded(smooth, **parts) for smooth in (0, 3))
    assert after.smooth == 0
    for old, new in zip(before.bodies, after.bodies, strict=True):
        assert isinstance(old.geometry, Mesh)
        assert isinstance(new.geometry, Mesh)
        np.testing.assert_array_equal(old.geometry.vertices, new.geometry.vertices)
        np.testing.assert_array_equal(old.geometry.faces, new.geometry.faces)


def test_camera_rays_and_outlines_have_one_geometry(tmp_path):
    glass = obj(tmp_path / "glass.obj", icosphere(1), bsdf={"type": "dielectric"})
    parts = {
        "ball": obj(tmp_path / "ball.obj", icosphere(1)),
        "glass": {**glass, "to_world": mi.scalar_rgb.ScalarTransform4f().translate([5, 0, 0])},
        "camera": {"type": "perspective"},
        "path": {"type": "wave", "wavelength": 0.5},
        "sky": {"type": "constant"},
    }
    with pytest.warns(match="does not diffract yet"):
        coarse = loaded(0, **parts)
    with pytest.warns(match="does not diffract yet"):
        scene = loaded(2, **parts)
    assert scene.smooth == 2
    (body,) = scene.bodies
    assert isinstance(body.geometry, Mesh)
    assert len(body.geometry.faces) == 80 * 16
    assert [s.id() for s in scene.mitsuba.shapes()] == [s.id() for s in coarse.mitsuba.shapes()]
    assert {s.face_count() for s in (*scene.mitsuba.shapes(), *scene.blockers.shapes())} == {80 * 16}
    assert {len(surface.faces) for surface in scene.surfaces if isinstance(surface, Mesh)} == {80 * 16}
    seen = scene.mitsuba.shapes()[body.shape]
    np.testing.assert_array_equal(np.array(seen.vertex_positions_buffer()).reshape(-1, 3), body.geometry.vertices)
    assert seen.bsdf().class_name() == "TwoSidedBRDF"
    assert [s.name for s in scene.sources] == ["light"]
    assert sorted(e.id() for e in scene.mitsuba.emitters()) == ["light", "sky"]
    assert [s.id() for s in scene.mitsuba.sensors()] == ["camera"]
    assert scene.mitsuba.integrator().id() == "path"
    assert grimaldi.load(scene) is scene
    again = grimaldi.load(grimaldi.load(coarse), smooth=2)
    np.testing.assert_array_equal(again.bodies[0].geometry.vertices, body.geometry.vertices)  # pyright: ignore


def test_no_ray_finds_a_gap(tmp_path):
    """From the middle of a closed mesh every ray meets it, also those to its vertices and along its edges."""
    scene = loaded(2, can=obj(tmp_path / "can.obj", can(12)))
    (body,) = scene.bodies
    assert isinstance(body.geometry, Mesh)
    corners = body.geometry.vertices[body.geometry.faces]
    along = np.concatenate([corners, 0.5 * (corners + np.roll(corners, 1, axis=1))]).reshape(-1, 3)
    ray = mi.Ray3f(mi.Point3f(0), mi.Vector3f(along.T.astype(np.float32)))
    assert np.array(scene.blockers.ray_test(ray)).all()


def test_a_diffuse_ball_is_as_bright_as_before(tmp_path):
    ball = obj(tmp_path / "ball.obj", icosphere(3), bsdf={"type": "diffuse"})
    camera = {
        "type": "orthographic",
        "to_world": mi.scalar_rgb.ScalarTransform4f().look_at([0, 0, -5], [0, 0, 0], [0, 1, 0]).scale(0.6),
        "film": {"type": "hdrfilm", "width": 24, "height": 24},
    }
    scene = {"type": "scene", "light": emitter(LAMP), "ball": ball, "camera": camera}
    options: dict[str, Any] = {"wavelength": 0.1, "diffraction": "none", "spp": 64}
    coarse, fine = (grimaldi.render(scene, smooth=smooth, **options).picture.values for smooth in (0, 2))
    assert coarse.min() > 0
    np.testing.assert_allclose(fine, coarse, rtol=0.03)


@pytest.mark.parametrize("flipped", [False, True])
def test_shading_normals_are_those_of_the_sphere(tmp_path, flipped):
    ball = obj(tmp_path / "ball.obj", icosphere(3), flip_normals=flipped)
    x, y = np.random.default_rng(2).uniform(-0.6, 0.6, (2, 500))
    ray = mi.Ray3f(mi.Point3f(np.stack([x, y, -5 + 0 * x]).astype(np.float32)), mi.Vector3f(0, 0, 1))
    before, after = (np.array(loaded(smooth, ball=ball).mitsuba.ray_intersect(ray).sh_frame.n) for smooth in (0, 2))
    exact = np.stack([x, y, -np.sqrt(1 - x * x - y * y)]) * (-1 if flipped else 1)
    np.testing.assert_allclose(after, before, atol=0.01)
    np.testing.assert_allclose(after, exact, atol=0.001)


# ------------------------------------------------------------------------------------- wrong input


@pytest.mark.parametrize("levels", [-1, 7, 1.5, "2", True, None])
def test_wrong_levels_are_named(levels):
    with pytest.raises(InputError, match=r"^smooth: .* is no number of levels; give an integer from 0 to 6$"):
        grimaldi.load("arago", smooth=levels)


def test_too_many_faces_are_named(tmp_path):
    ball = obj(tmp_path / "ball.obj", icosphere(3))
    with pytest.raises(
        InputError, match=r"^scene: ball: smooth=6 makes 5242880 faces of it, more than 4000000; give less$"
    ):
        loaded(6, ball=ball)
