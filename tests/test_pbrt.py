"""pbrt scenes: the same as Mitsuba scenes that mean the same, Loop's surface as its theory has it, wrong input told."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import mitsuba
import numpy as np
import pytest
from optics import GREY

import grimaldi
from grimaldi.errors import GrimaldiWarning, InputError
from grimaldi.scene import pbrt
from grimaldi.scene.model import Cylinder, Disk, Mesh, Sphere
from grimaldi.scene.pbrt.loop import subdivide

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for
T = mi.scalar_rgb.ScalarTransform4f

CAMERA = """
LookAt 0 -30 12  0 0 2  0 0 1
Camera "perspective" "float fov" [40]
Film "rgb" "integer xresolution" [48] "integer yresolution" [32]
"""
LIGHT = 'LightSource "point" "point3 from" [20 -30 60] "rgb I" [3000 2000 1000]\n'
FLOOR = """
Shape "trianglemesh" "integer indices" [0 1 2 2 3 0] "point3 P" [-50 -50 0  50 -50 0  50 50 0  -50 50 0]
"""
TETRAHEDRON = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]], float)
SIDES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


@pytest.fixture(autouse=True)
def _variant() -> None:
    mi.set_variant("llvm_ad_rgb")


@pytest.fixture
def write(tmp_path):
    def write(text: str, name: str = "scene.pbrt") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def bodies(path: Path) -> list[Any]:
    return [body.geometry for body in grimaldi.load(path).bodies]


def picture(scene: Any, **options: Any) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GrimaldiWarning)
        return grimaldi.render(scene, wavelength=1.0, **{"spp": 4, **options}).picture.values


# ------------------------------------------------------------------------------------------ scenes


def test_it_is_the_mitsuba_scene_that_means_the_same(write):
    """Camera, film, point light, diffuse surfaces, a sphere moved and scaled: the same picture, ray by ray."""
    text = f"""{CAMERA}
    WorldBegin {LIGHT}
    Material "diffuse" "rgb reflectance" [.5 .5 .5]
    {FLOOR}
    AttributeBegin
      Translate 5 0 3  Scale 2 2 2
      Shape "sphere" "float radius" 1.5
    AttributeEnd
    """
    scene = {
        "type": "scene",
        "light": {
            "type": "point",
            "position": [20, -30, 60],
            "intensity": {"type": "rgb", "value": [3000, 2000, 1000]},
        },
        "floor": {"type": "rectangle", "to_world": T().scale([50, 50, 1]), "bsdf": GREY},
        "ball": {"type": "sphere", "center": [5, 0, 3], "radius": 3.0, "bsdf": GREY},
        "sensor": {
            "type": "perspective",
            "fov": 40,
            "fov_axis": "smaller",
            # pbrt's x points right where Mitsuba's points left: the same camera, looking the same way
            "to_world": T().look_at([0, -30, 12], [0, 0, 2], [0, 0, 1]) @ T().scale([-1, 1, 1]),
            "film": {"type": "hdrfilm", "width": 48, "height": 32, "rfilter": {"type": "box"}},
        },
    }
    expected = picture(scene, diffraction="none")
    got = picture(write(text), diffraction="none")
    assert expected.max() > 0.1
    np.testing.assert_allclose(got, expected, rtol=1e-4, atol=1e-5 * expected.max())
    np.testing.assert_allclose(picture(write(text)), picture(scene), rtol=0.02, atol=2e-3 * expected.max())


def test_right_is_where_pbrt_has_it(write):
    """In pbrt's left-handed space a camera at -z that looks along +z with y up has +x on its right."""
    text = """
    LookAt 0 0 -10  0 0 0  0 1 0
    Camera "perspective" "float fov" 60
    Film "image" "integer xresolution" 16 "integer yresolution" 16
    WorldBegin
    LightSource "point" "point from" [0 0 -10] "color I" [100 100 100]
    Translate 3 1 0
    Shape "sphere" "float radius" 1
    WorldEnd
    """
    y, x = np.unravel_index(picture(write(text), diffraction="none")[..., 0].argmax(), (16, 16))
    assert x > 8
    assert y < 8


def test_both_spellings_are_one_scene(write):
    old = f"""{CAMERA.replace('"rgb"', '"image"')} WorldBegin {LIGHT.replace("point3", "point").replace("rgb", "color")}
    Texture "grey" "spectrum" "constant" "color value" [.3 .3 .3]
    MakeNamedMaterial "m" "string type" "matte" "texture Kd" "grey"  NamedMaterial "m"
    {FLOOR.replace("point3", "point")}
    Shape "loopsubdiv" "integer nlevels" [1] "integer indices" [0 2 1 0 1 3 0 3 2 1 2 3]
      "point P" [1 1 1 -1 -1 1 -1 1 -1 1 -1 -1]
    WorldEnd"""
    new = f"""{CAMERA} WorldBegin {LIGHT}
    Material "diffuse" "rgb reflectance" [.3 .3 .3]  # a comment "with a text" [and brackets
    {FLOOR}
    Shape "loopsubdiv" "integer levels" 1 "integer indices" [0 2 1 0 1 3 0 3 2 1 2 3]
      "point3 P" [1 1 1 -1 -1 1 -1 1 -1 1 -1 -1]"""
    np.testing.assert_array_equal(picture(write(old, "old.pbrt")), picture(write(new, "new.pbrt")))


def test_shapes_in_world_space(write):
    sphere, cylinder, disk, mesh = bodies(
        write(
            """
            Translate 1 2 3  Rotate 90 0 1 0  Scale 2 2 2
            CoordinateSystem "here"
            TransformBegin Identity Shape "sphere" "float radius" [4] TransformEnd
            Shape "cylinder" "float radius" 3 "float zmin" 0 "float zmax" 5
            Shape "disk" "float radius" 1.5 "float height" 2
            Identity  Transform [1 0 0 0  0 1 0 0  0 0 1 0  7 8 9 1]
            Shape "trianglemesh" "point P" [0 0 0 1 0 0 0 1 0]
            CoordSysTransform "here"
            LightSource "point" "point from" [0 0 10] "rgb I" [1 1 1]
            """
        )
    )
    assert isinstance(sphere, Sphere)
    assert (sphere.radius, *sphere.centre) == pytest.approx((4, 0, 0, 0))
    # z becomes x under a turn by 90° about y
    assert isinstance(cylinder, Cylinder)
    ends = cylinder.to_world @ np.array([[0, 0, 0, 1], [0, 0, 1, 1.0]]).T
    np.testing.assert_allclose(ends[:3].T, [[1, 2, 3], [11, 2, 3]], atol=1e-5)
    assert np.linalg.norm(cylinder.to_world[:3, 0]) == pytest.approx(6)
    assert isinstance(disk, Disk)
    np.testing.assert_allclose(disk.to_world[:3, 3], [5, 2, 3], atol=1e-5)
    assert np.linalg.norm(disk.to_world[:3, 0]) == pytest.approx(3)
    assert isinstance(mesh, Mesh)
    np.testing.assert_allclose(mesh.vertices, [[7, 8, 9], [8, 8, 9], [7, 9, 9]])
    moved = 'Translate 1 2 3  Rotate 90 0 1 0  Scale 2 2 2\nLightSource "point" "point from" [0 0 10]'
    (light,) = grimaldi.load(write(moved)).sources
    assert light.position is not None
    np.testing.assert_allclose(light.position, [21, 2, 3], atol=1e-5)


def test_instances_includes_and_ply_are_written_out(write, tmp_path):
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ply += "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "leaf.ply").write_text(ply)
    write('Shape "plymesh" "string filename" "parts/leaf.ply"', "leaf.pbrt")
    found = bodies(
        write(
            f"""WorldBegin {LIGHT}
            ObjectBegin "leaf"  Translate 0 0 1  Include "leaf.pbrt"  ObjectEnd
            AttributeBegin Translate 10 0 0 ObjectInstance "leaf" AttributeEnd
            AttributeBegin Scale -1 1 1 ObjectInstance "leaf" AttributeEnd"""
        )
    )
    np.testing.assert_allclose(found[0].vertices, [[10, 0, 1], [11, 0, 1], [10, 1, 1]])
    np.testing.assert_allclose(found[1].vertices, [[0, 0, 1], [-1, 0, 1], [0, 1, 1]])


def test_a_closed_mirrored_mesh_is_no_room(write):
    """Normals point outward after a mirror as before: a light inside is refused, in a reversed one it is not."""
    inside = (
        'Shape "trianglemesh" "integer indices" [0 2 1 0 1 3 0 3 2 1 2 3] "point P" [1 1 1 -1 -1 1 -1 1 -1 1 -1 -1]'
    )
    light = 'LightSource "point" "rgb I" [1 1 1]'
    with pytest.raises(InputError, match="lies inside"):
        grimaldi.load(write(f"{light} Scale -1 1 1 {inside}"))
    with pytest.raises(InputError, match="lies inside"):
        grimaldi.load(write(f"{light} {inside}"))
    grimaldi.load(write(f"{light} ReverseOrientation {inside}"))


def test_a_spot_may_be_narrower_than_its_falloff(write):
    light = 'LightSource "spot" "point from" [0 0 9] "point to" [0 0 0] "float coneangle" 4'
    (spot,) = grimaldi.load(write(f"\ufeff{light}")).sources
    assert spot.spot is not None
    assert np.degrees([spot.spot.beam_width, spot.spot.cutoff]) == pytest.approx([0, 4])


def test_lights(write):
    spot, sun = grimaldi.load(
        write(
            """LightSource "spot" "point3 from" [0 0 9] "point3 to" [0 0 0] "float coneangle" 20
               "float conedeltaangle" 5 "rgb I" [4 4 4] "float scale" 4
               LightSource "distant" "point3 from" [0 3 4] "point3 to" [0 0 0] "rgb L" [9 9 9]"""
        )
    ).sources
    assert spot.spot is not None
    assert np.degrees([spot.spot.beam_width, spot.spot.cutoff]) == pytest.approx([15, 20])
    np.testing.assert_allclose(spot.spot.axis, [0, 0, -1], atol=1e-6)
    assert spot.amplitude == pytest.approx(4)
    assert sun.amplitude == pytest.approx(3)
    assert sun.direction is not None
    np.testing.assert_allclose(sun.direction, [0, -0.6, -0.8], atol=1e-6)


def test_a_shining_sphere_is_a_point_of_its_irradiance(write):
    """E = L π r²/d² cos θ for a sphere wholly above the receiver's horizon, whatever its size: so of a point L π r²."""
    text = f"""{CAMERA} WorldBegin {FLOOR}
    AttributeBegin Translate 0 0 20 AreaLightSource "area" "color L" [50 50 50] Shape "sphere" "float radius" 3
    AttributeEnd WorldEnd"""
    with pytest.warns(GrimaldiWarning, match="the size of a shining sphere"):
        (source,) = grimaldi.load(write(text)).sources
    assert source.amplitude**2 == pytest.approx(50 * np.pi * 9)
    scene = {
        "type": "scene",
        "floor": {"type": "rectangle", "to_world": T().scale([50, 50, 1]), "bsdf": {"type": "diffuse"}},
        "ball": {
            "type": "sphere",
            "center": [0, 0, 20],
            "radius": 3.0,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [50, 50, 50]}},
        },
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, 10], [0, 0, 0], [0, 1, 0]).scale([20, 20, 1]),
            "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
        },
    }
    mitsubas = np.array(mi.render(mi.load_dict(scene), spp=2048, integrator=mi.load_dict({"type": "direct"})))
    scene["ball"] = {
        "type": "point",
        "position": [0, 0, 20],
        "intensity": {"type": "rgb", "value": [50 * np.pi * 9] * 3},
    }
    np.testing.assert_allclose(picture(scene, diffraction="none", spp=2048), mitsubas, rtol=0.01)


def test_what_is_left_out_is_told_once_with_its_line(write):
    text = f"""{CAMERA}
    Sampler "halton" "integer pixelsamples" 4
    WorldBegin {LIGHT}
    MakeNamedMedium "fog" "string type" "homogeneous"
    Shape "curve" "point3 P" [0 0 0 1 0 0 2 0 0 3 0 0]
    Shape "sphere" "float phimax" 180
    Shape "sphere" "float phimax" 90
    Material "subsurface"
    """
    with pytest.warns(GrimaldiWarning) as told:
        scene = grimaldi.load(write(text))
    (message,) = {str(warning.message) for warning in told}
    assert message == (
        "scene.pbrt: left out: the pattern of Sampler halton (line 6), MakeNamedMedium fog (line 9), "
        "Shape curve (line 10), phimax of Shape sphere (line 11), Material subsurface (grey instead) (line 13)"
    )
    assert len(scene.bodies) == 2


@pytest.mark.parametrize(
    "material",
    [
        'Material "matte" "rgb Kd" [.5 .4 .3]',
        'Material "plastic" "rgb Kd" [.2 .2 .2] "rgb Ks" [.5 .5 .5] "float roughness" .025',
        'Material "coateddiffuse" "rgb reflectance" [.2 .2 .2] "float roughness" .1',
        'Material "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k" "float roughness" .1',
        'Material "metal" "float roughness" .1',
        'Texture "c" "spectrum" "checkerboard" "float uscale" 4 "float vscale" 4 Material "diffuse" '
        '"texture reflectance" "c"',
    ],
)
def test_materials_render_and_leave_nothing_out(write, material):
    uv = FLOOR.rstrip() + ' "point2 uv" [0 0 1 0 1 1 0 1]\n'
    path = write(f"{CAMERA} WorldBegin {LIGHT} {material} {uv}")
    _, left_out = pbrt.read(path)
    assert not left_out
    shot = picture(path, diffraction="none")
    assert np.isfinite(shot).all()
    assert shot.max() > 0


def test_glass_and_mirrors_are_read(write):
    path = write(f'{CAMERA} WorldBegin {LIGHT} Material "dielectric" Shape "sphere" Material "mirror" {FLOOR}')
    with pytest.warns(GrimaldiWarning, match="sphere-1: does not diffract yet"):
        scene = grimaldi.load(path)
    assert [body.name for body in scene.bodies] == ["trianglemesh-1"]


def test_the_command_renders_one(tmp_path):
    example = Path(__file__).parent.parent / "examples" / "simple.pbrt"
    out = tmp_path / "x.png"
    options = ["--wavelength", "4", "--size", "24x18", "--spp", "1", "-o", out]
    done = subprocess.run(
        [sys.executable, "-m", "grimaldi", "render", example, *options], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "left out: the pattern of Sampler halton (line 6)" in done.stderr
    assert out.is_file()


# ------------------------------------------------------------------------------------- subdivision


def test_the_limit_is_the_same_from_every_level():
    """A vertex ends where its limit mask says, however many steps are taken first: inside and on the border."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0))
    points = np.stack([x.ravel(), y.ravel(), rng.normal(size=20)], axis=1)
    corner = (np.arange(4) + 5 * np.arange(3)[:, None]).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 5], 1), np.stack([corner + 1, corner + 6, corner + 5], 1)]
    )
    for mesh in ((points, faces), (TETRAHEDRON, SIDES)):
        limits = [subdivide(*mesh, levels)[0][: len(mesh[0])] for levels in (0, 1, 3)]
        np.testing.assert_allclose(limits[1], limits[0], atol=1e-12)
        np.testing.assert_allclose(limits[2], limits[0], atol=1e-12)


def test_a_border_is_a_cubic_b_spline():
    """A fan about a middle vertex: its border after three steps lies on the B-spline of its corners."""
    rng = np.random.default_rng(5)
    n = 7
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle), rng.normal(size=n)], axis=1)
    faces = np.array([[n, i, (i + 1) % n] for i in range(n)])
    fine, _ = subdivide(np.vstack([ring, np.zeros(3)]), faces, 3)
    t = np.arange(8)[:, None] / 8
    weights = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
    for i in range(n):
        spline = sum(w * ring[(i + j - 1) % n] for j, w in enumerate(weights)) / 6
        for point in np.asarray(spline):
            assert np.linalg.norm(fine - point, axis=1).min() < 1e-12


def test_flat_stays_flat_and_closed_stays_closed():
    points, faces = subdivide(TETRAHEDRON, SIDES, 2)
    assert len(faces) == 4 * 16
    assert len(points) - 3 * len(faces) // 2 + len(faces) == 2  # Euler
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    flat, _ = subdivide(square, np.array([[0, 1, 2], [2, 3, 0]]), 3)
    assert np.abs(flat[:, 2]).max() == 0


# ------------------------------------------------------------------------------------- wrong input


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Shap3 \"sphere\"", "line 1: 'Shap3' is no directive; did you mean 'Shape'?"),
        ("\n\n]", "line 3: ']' is no directive"),
        ('Shape "sphere', "line 1: a text is not closed"),
        ('Shape "sphere" "float radius" [1', "a [ is not closed"),
        ('Shape "sphere" "float radius"', "'float radius' has no value"),
        ('Shape "sphere" "radius" 1', "'radius' declares no parameter"),
        ('Shape "sphere" "flaot radius" 1', "unknown parameter type 'flaot'"),
        ('Shape "sphere" "float radius" "one"', "radius: 'one' is no number"),
        ('Shape "sphere" "float radius" nan', "'nan' is not finite"),
        ('Shape "sphere" "float radius" [0]', "the sphere's radius is 0"),
        ('Scale 1 2 3 Shape "sphere"', "makes no sphere of a sphere"),
        ("Translate 1 2", "Translate has 2 numbers; give 3"),
        ("Rotate 30 0 0 0", "the axis is zero"),
        ("Scale 1e17 1 1 Scale 1e17 1 1", "the transform runs over"),
        ("LookAt 0 0 0  0 0 0  0 0 1", "eye and target are one point"),
        ("LookAt 0 0 0  0 0 1  0 0 1", "or up points along them"),
        ("AttributeEnd", "AttributeEnd without AttributeBegin"),
        ("AttributeBegin", "AttributeBegin is never ended"),
        ("AttributeBegin TransformEnd", "TransformEnd without TransformBegin"),
        ('ObjectInstance "x"', "no object 'x'"),
        ('ObjectBegin "a" ObjectBegin "b"', "object 'b' begins inside 'a'"),
        ('ObjectBegin "a" ObjectInstance "a" ObjectEnd', "an instance inside object 'a'"),
        ('NamedMaterial "x"', "no material 'x'"),
        ('Material "matte" "texture Kd" "x"', "there is no texture 'x'"),
        ('CoordSysTransform "x"', "no coordinate system 'x'"),
        ('Include "missing.pbrt"', "file 'missing.pbrt' not found"),
        ('Include "scene.pbrt"', "included in each other more than 64 deep"),
        ('Shape "plymesh" "string filename" "missing.ply"', "file 'missing.ply' not found"),
        ('Shape "trianglemesh" "point P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 3]', "face 0 joins vertices 0, 1"),
        ('Shape "trianglemesh" "point P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1]', "indices has 2 values"),
        ('Shape "trianglemesh" "point P" [0 0 0 1 0]', "P has 5 values; give 3 for each point"),
        ('Shape "trianglemesh" "integer indices" [0 1.9 2] "point P" [0 0 0 1 0 0 0 1 0]', "not whole numbers"),
        ('Shape "trianglemesh" "integer indices" [0 1 2]', "P is missing"),
        ('Shape "trianglemesh" "point P" [0 0 0 1 0 0 0 1 0] "normal N" [0 0 1]', "1 N for 3 vertices"),
        ('Scale 1 1 0 Shape "trianglemesh" "point P" [0 0 0 1 0 0 0 1 0]', "the transform flattens it"),
        (
            'Shape "loopsubdiv" "point P" [0 0 0 1 0 0 0 1 0 0 0 1 1 1 1] "integer indices" [0 1 2 0 1 3 0 1 4]',
            "is shared by 3 faces",
        ),
        ('Shape "loopsubdiv" "integer levels" 99 "point P" [0 0 0 1 0 0 0 1 0]', "levels is 99"),
        ('LightSource "distant" "point from" [1 1 1] "point to" [1 1 1]', "from and to are the same point"),
        ('Scale 1 0 1 Camera "perspective"', "flattens everything"),
        ('Camera "realistic"', "camera 'realistic' is none of Mitsuba's"),
        ('Film "image" "integer xresolution" [0]', "a film of 0 × 480 pixels"),
    ],
)  # fmt: skip
def test_wrong_input_names_the_line(write, text, says):
    if "Film" in text:
        text = 'Camera "perspective" ' + text
    with pytest.raises(InputError) as error:
        grimaldi.load(write(text))
    message = str(error.value)
    assert says in message
    assert "scene.pbrt" in message or "dictionary node" in message
    assert "\n" not in message
    assert ";" in message or "did you mean" in message


def test_what_is_no_pbrt_at_all(tmp_path):
    path = tmp_path / "x.pbrt"
    path.write_bytes(bytes(range(256)) * 10)
    with pytest.raises(InputError, match=r"x\.pbrt, line"):
        grimaldi.load(path)
