"""Cylinders, cones, instances, and meshes from STL, glTF, and PLY and OBJ files with polygons."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import mitsuba
import numpy as np
import oracle
import pytest
import trimesh
from optics import GREY, affine, emitter, factor, line, mesh, shape
from trimesh.exchange.gltf import export_gltf
from trimesh.exchange.stl import export_stl_ascii

import grimaldi
from grimaldi.errors import InputError
from grimaldi.outlines.cylinder import strip
from grimaldi.outlines.offset_test import offset_outline
from grimaldi.reference import fresnel_edge
from grimaldi.scene.model import Cylinder, Source
from grimaldi.scene.polygons import triangles

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for
mi.set_variant("llvm_ad_mono")
T = mi.scalar_rgb.ScalarTransform4f

LAMP = oracle.Spherical((3, -2, -40))
PLANE = oracle.Plane((0, 0, 1))
ACROSS = line((-25, 3, 60), (25, 5, 60), 21)
FINE: dict[str, Any] = {"tolerance": 1e-5}


def cylinder(**parameters: Any) -> dict[str, Any]:
    return {"type": "cylinder", "p0": [-2, -9, 1], "p1": [3, 8, -2], "radius": 4.0, "bsdf": GREY, **parameters}


def as_mesh(path: Path, tube: Cylinder, n: int) -> dict[str, Any]:
    """The same open tube with n faces round, through an OBJ file."""
    angle = 2 * np.pi * (np.arange(n) + 0.3) / n
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * np.sqrt(2 * np.pi / n / np.sin(2 * np.pi / n))
    ring[:, 2] = 0
    local = np.concatenate([ring, ring + [0, 0, 1]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([np.stack([i, j, n + j], axis=1), np.stack([i, n + j, n + i], axis=1)])
    return mesh(path, local @ tube.to_world[:3, :3].T + tube.to_world[:3, 3], faces)


@pytest.mark.parametrize("light", [LAMP, PLANE], ids=["point", "plane"])
def test_a_cylinder_is_its_own_fine_mesh(tmp_path, light):
    (body,) = grimaldi.load({"type": "scene", "tube": cylinder(), "light": {"type": "point"}}).bodies
    assert isinstance(body.geometry, Cylinder)
    fine = factor(light, ACROSS, as_mesh(tmp_path / "tube.obj", body.geometry, 400), **FINE)
    np.testing.assert_allclose(factor(light, ACROSS, cylinder(), **FINE), fine, atol=2e-3)


def test_from_the_side_it_is_a_strip():
    """A plane wave upon a long tube: two straight edges, by Fresnel's integral at each (paraxial)."""
    tube = cylinder(p0=[0, -5e4, 0], p1=[0, 5e4, 0], radius=40.0)
    x = np.array([[100.0, 0, 2000], [42, 0, 2000], [40, 0, 2000], [30, 0, 2000], [0, 0, 2000]])
    right, left = (fresnel_edge.parameter(40 - side * x[:, 0], 2000.0, 1.0) for side in (1, -1))
    expected = fresnel_edge.factor(right) + fresnel_edge.factor(left)
    computed = factor(PLANE, x, tube, tolerance=1e-4)
    np.testing.assert_allclose(computed, expected, atol=1e-2)


def test_end_on_it_is_its_rim():
    """Light along the axis meets no surface; of a lamp's on the axis the wall covers the ring between its rims."""
    tube = cylinder(p0=[0, 0, -6], p1=[0, 0, 6], radius=7.0)
    np.testing.assert_allclose(factor(PLANE, ACROSS, tube, **FINE), 1, atol=1e-12)
    low, high = 7 * 100 / 46, 7 * 100 / 34  # the rims' shadows at z = 60 of the lamp at z = -40
    points = [[0, 0, 60], [low - 0.1, 0, 60], [low + 0.1, 0, 60], [0, high - 0.1, 60], [0, high + 0.1, 60]]
    lamp = oracle.Spherical((0, 0, -40))
    np.testing.assert_allclose(factor(lamp, points, tube, diffraction="none"), [1, 1, 0, 0, 1], atol=1e-12)
    rims = grimaldi.outline({"type": "scene", "light": emitter(lamp), "tube": tube})
    length = np.linalg.norm(rims.end - rims.start, axis=1).sum()
    assert length == pytest.approx(2 * 2 * np.pi * 7, rel=1e-3)


@pytest.mark.parametrize("to_world", [affine((1, 1, 1), at=(3, 1, -2)), affine((1.5, 0.5, 2))])
def test_to_world_is_honoured(tmp_path, to_world):
    tube = {**cylinder(), "to_world": T(to_world)}
    (body,) = grimaldi.load({"type": "scene", "tube": tube, "light": {"type": "point"}}).bodies
    assert isinstance(body.geometry, Cylinder)
    fine = factor(LAMP, ACROSS, as_mesh(tmp_path / "tube.obj", body.geometry, 400), **FINE)
    np.testing.assert_allclose(factor(LAMP, ACROSS, tube, **FINE), fine, atol=2e-3)


def test_the_tangent_lines_are_exact():
    """Rays from the source touch the tube there: (X - S)·n = 0 for the tube's normal n."""
    source = Source("lamp", "0", 1.0, 0.0, position=np.array([3.0, -2, -40]))
    tube = Cylinder(affine((4, 4, 20), turn=[[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]))
    assert source.position is not None
    x = strip(tube, source, 1e-2).vertices
    local = (x - tube.to_world[:3, 3]) @ np.linalg.inv(tube.to_world[:3, :3]).T
    normal = (local * [1, 1, 0]) @ np.linalg.inv(tube.to_world[:3, :3])
    grazing = np.abs(((x - source.position) * normal).sum(axis=1)) < 1e-9
    assert grazing.sum() == 4


@pytest.mark.parametrize("model", ["area", "huygens"])
def test_other_models_take_cylinders(model):
    computed = factor(
        LAMP, ACROSS, cylinder(), diffraction=model, n=20 if model == "huygens" else None, weights="kernel"
    )
    exact = factor(LAMP, ACROSS, cylinder(), occlusion=model != "area", **FINE)
    assert np.abs(computed - exact).max() < 0.03


def test_the_report_takes_a_cylinder_as_its_faces():
    """Two lines and the rims that the light meets, within the ε test's reach of the exact length."""
    scene = grimaldi.load({"type": "scene", "l": {"type": "point", "position": [3, -2, -400]}, "t": cylinder()})
    length = [
        np.linalg.norm(found.end - found.start, axis=1).sum()
        for found in (offset_outline(scene, scene.sources[0]), grimaldi.outline(scene))
    ]
    assert length[0] == pytest.approx(length[1], rel=0.05)


# ------------------------------------------------------------------------------------------- cone


def test_a_cone_is_the_cone_of_trimesh(tmp_path):
    cone = trimesh.creation.cone(radius=5, height=9, sections=800)
    by_file = factor(LAMP, ACROSS, mesh(tmp_path / "cone.obj", cone.vertices, cone.faces), **FINE)
    ours = {"type": "cone", "p0": [0, 0, 0], "p1": [0, 0, 9], "radius": 5.0, "bsdf": GREY}
    np.testing.assert_allclose(factor(LAMP, ACROSS, ours, **FINE), by_file, atol=2e-3)


def test_a_cone_in_mitsuba_itself(tmp_path):
    """From XML and with Mitsuba's own integrator; its normals point outward."""
    (tmp_path / "x.xml").write_text(
        '<scene version="3.0.0"><shape type="cone"><point name="p0" x="0" y="0" z="0"/>'
        '<point name="p1" x="0" y="0" z="2"/><float name="radius" value="1"/>'
        '<transform name="to_world"><scale value="3"/></transform></shape></scene>'
    )
    scene = mi.load_file(str(tmp_path / "x.xml"))
    np.testing.assert_allclose(np.array(scene.bbox().max).ravel(), [3, 3, 6], rtol=1e-3)
    hit = scene.ray_intersect(mi.Ray3f([0.5, 0.2, 20.0], [0, 0, -1]))
    assert np.array(hit.n)[2, 0] > 0
    assert np.array(scene.ray_intersect(mi.Ray3f([0.5, 0.2, -20.0], [0, 0, 1])).n)[2, 0] < 0


# -------------------------------------------------------------------------------------- instances

TREE: dict[str, Any] = {
    "type": "shapegroup",
    "trunk": {"type": "cube", "to_world": T().scale([0.5, 4, 0.5]), "bsdf": GREY},
    "crown": {"type": "sphere", "center": [0, 4, 0], "radius": 2.0, "bsdf": GREY},
}
PLACES = {"one": T().translate([-6, 0, 1]), "two": T().translate([4, -1, -2]).rotate([0, 0, 1], 30).scale(1.5)}


def test_instances_are_what_they_repeat():
    light = {"type": "coherent_point", "position": [3, -2, -40]}
    scene = {"type": "scene", "light": light, "tree": TREE}
    scene |= {
        name: {"type": "instance", "to_world": at, "group": {"type": "ref", "id": "tree"}}
        for name, at in PLACES.items()
    }
    written = {"type": "scene", "light": light}
    for name, at in PLACES.items():
        written[f"{name}_trunk"] = {**TREE["trunk"], "to_world": at @ TREE["trunk"]["to_world"]}
        written[f"{name}_crown"] = {**TREE["crown"], "to_world": at}
    loaded = grimaldi.load(scene)
    assert {body.name.replace(".", "_") for body in loaded.bodies} == set(written) - {"type", "light"}
    ours = grimaldi.field(loaded, ACROSS, wavelength=1)
    plain = grimaldi.field(written, ACROSS, wavelength=1)
    np.testing.assert_allclose(ours.U, plain.U, atol=1e-12)
    assert np.abs(ours.U / plain.U).values.min() > 0


def test_any_number_of_instances():
    """As many nodes more as move the others in memory, whatever room there was."""
    for count in (1, 2, 3, 5, 9, 40):
        places = {f"at{i}": T().translate([4.0 * i, 0, 0]) for i in range(count)}
        scene = {"type": "scene", "light": {"type": "coherent_point", "position": [3, -2, -40]}}
        scene |= {
            name: {"type": "instance", "to_world": at, "group": {"type": "ref", "id": "tree"}}
            for name, at in places.items()
        }
        names = [body.name for body in grimaldi.load(scene | {"tree": TREE}).bodies]
        assert sorted(names) == sorted(f"{name}.{part}" for name in places for part in ("trunk", "crown"))


def test_instances_from_xml(tmp_path):
    (tmp_path / "x.xml").write_text(
        '<scene version="3.0.0"><emitter type="point"/>'
        '<shape type="shapegroup" id="g"><shape type="cube" id="c"/></shape>'
        '<shape type="instance" id="i"><ref id="g"/><transform name="to_world"><translate x="9"/></transform></shape>'
        '<shape type="instance"><ref id="g"/><transform name="to_world"><translate x="-9"/></transform></shape></scene>'
    )
    bodies = grimaldi.load(tmp_path / "x.xml").bodies
    assert len(bodies) == 2
    assert bodies[0].name == "i.c"
    centres = sorted(round(float(body.geometry.vertices[:, 0].mean())) for body in bodies)  # pyright: ignore
    assert centres == [-9, 9]


# ------------------------------------------------------------------------------------------ files

HOUSE = np.array([[-4, -3], [4, -3], [4, 3], [0, 0.5], [-4, 3]], float)  # concave
CORNERS = np.c_[HOUSE, np.zeros(5)]


def ply(path: Path, faces: list[list[int]], form: str = "ascii") -> dict[str, Any]:
    header = (
        f"ply\nformat {form} 1.0\nelement vertex {len(CORNERS)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    if form == "ascii":
        rows = [" ".join(map(str, row)) for row in CORNERS.tolist()]
        rows += [" ".join(map(str, [len(face), *face])) for face in faces]
        path.write_text(header + "\n".join(rows) + "\n")
    else:
        order = "<" if "little" in form else ">"
        data = CORNERS.astype(order + "f8").tobytes()
        data += b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)
        path.write_bytes(header.encode() + data)
    return {"type": "ply", "filename": str(path), "bsdf": GREY}


def obj(path: Path, lines: str) -> dict[str, Any]:
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in CORNERS)
    path.write_text(f"# a house\n{vertices}\nvn 0 0 1\nvt 0 0\n{lines}\n")
    return {"type": "obj", "filename": str(path), "bsdf": GREY}


def masked(points: Any = ACROSS) -> Any:
    return factor(LAMP, points, outlines=[grimaldi.PlanarOutline(HOUSE, hole=False)], **FINE)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("faces", [[[0, 1, 2, 3, 4]], [[0, 1, 2, 3], [0, 3, 4]], [[4, 3, 2, 1, 0]]])
def test_polygons_in_ply(tmp_path, form, faces):
    np.testing.assert_allclose(factor(LAMP, ACROSS, ply(tmp_path / "x.ply", faces, form), **FINE), masked(), atol=1e-6)


TRIANGLES_FROM_THE_END = "f  -5 -4 -3\nf 1 -3 -2\nf 1 4 -1"


@pytest.mark.parametrize(
    "lines",
    [
        "f 1 2 3 4 5",
        "f 1/1/1 2/1/1 3/1/1 4/1/1\nf 1//1 4//1 5//1",
        "f -5 -4 -3 -2 -1",
        TRIANGLES_FROM_THE_END,
        "o a\nf 1 2 3 4\no b\nf 1 4 5",
    ],
)
def test_polygons_in_obj(tmp_path, lines):
    np.testing.assert_allclose(factor(LAMP, ACROSS, obj(tmp_path / "x.obj", lines), **FINE), masked(), atol=1e-6)


def test_polygons_become_as_many_triangles_without_overlap():
    """Areas add up, and no triangle turns the other way."""
    rng = np.random.default_rng(1)
    for n in (4, 5, 9, 30):
        angle = np.sort(rng.uniform(0, 2 * np.pi, n))
        radius = rng.uniform(0.3, 1, n)
        flat = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        points = flat @ turn[:2]
        faces = triangles(points, [list(range(n))], "x")
        assert len(faces) == n - 2
        a, b, c = np.moveaxis(flat[faces], 1, 0)
        areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        following = np.roll(flat, -1, axis=0)
        whole = 0.5 * (flat[:, 0] * following[:, 1] - flat[:, 1] * following[:, 0]).sum()
        assert areas.sum() == pytest.approx(whole)
        assert (areas * np.sign(whole) > -1e-12).all()


BOX = trimesh.creation.box((5, 3, 2))


@pytest.mark.parametrize("name", ["x.stl", "x.glb", "x.gltf", "ascii.stl"])
def test_files_of_other_programs(tmp_path, name):
    path = tmp_path / name
    if name == "ascii.stl":
        path.write_text(export_stl_ascii(BOX))
    elif name == "x.gltf":
        for file, data in export_gltf(trimesh.Scene(BOX)).items():
            (tmp_path / ("x.gltf" if file.endswith(".gltf") else file)).write_bytes(data)
    else:
        BOX.export(path)
    kind = "stl" if name.endswith(".stl") else "gltf"
    ours = {"type": kind, "filename": str(path), "to_world": T().translate([1, 2, 3]).scale(2), "bsdf": GREY}
    plain = mesh(tmp_path / "plain.obj", 2 * BOX.vertices + [1, 2, 3], BOX.faces)
    np.testing.assert_allclose(factor(LAMP, ACROSS, ours, **FINE), factor(LAMP, ACROSS, plain, **FINE), atol=1e-6)


def test_the_parts_of_a_gltf_file_stand_in_their_places(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(BOX, transform=trimesh.transformations.translation_matrix([-4, 0, 0]))
    scene.add_geometry(BOX, transform=trimesh.transformations.translation_matrix([4, 1, 0]))
    scene.export(tmp_path / "x.glb")
    both = [shape("cube", affine((2.5, 1.5, 1), at=at)) for at in ((-4, 0, 0), (4, 1, 0))]
    ours = {"type": "gltf", "filename": str(tmp_path / "x.glb"), "bsdf": GREY}
    alike: dict[str, Any] = {**FINE, "occlusion": "binary"}  # the edges of two bodies graze each other, of one mesh not
    np.testing.assert_allclose(factor(LAMP, ACROSS, ours, **alike), factor(LAMP, ACROSS, *both, **alike), atol=1e-5)


# ------------------------------------------------------------------------------------ wrong input


def gltf(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("kind", "name", "data", "says"),
    [
        ("stl", "x.stl", b"", "x.stl: "),
        ("stl", "x.stl", b"solid x\nfacet normal 0 0\n", "x.stl: "),
        ("stl", "x.stl", b"\0" * 84, "x.stl: the mesh is empty"),
        ("stl", "x.ply", b"ply", "x.ply: is no .stl file"),
        ("gltf", "x.gltf", b"{", "x.gltf: cannot be read"),
        ("gltf", "x.gltf", b'{"asset": {"version": "2.0"}}', "x.gltf: "),
        ("gltf", "x.glb", b"glTF\2\0\0\0", "x.glb: "),
        ("gltf", "x.obj", b"v 0 0 0", "x.obj: is no .gltf or .glb file"),
        ("obj", "x.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "x.obj, line 4: the face names a vertex that is not"),
        ("obj", "x.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "x.obj: face 0 joins vertices 0, 1, 8"),
        ("obj", "x.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", "x.obj, line 4: the face names"),
        ("obj", "x.obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n", "x.obj, line 3: the face has 2 corners"),
        ("obj", "x.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 x\n", "x.obj, line 3: 'f 1 2 x' is no OBJ line"),
        ("obj", "x.obj", b"v 0 nan 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "x.obj: vertex 0 is at (0, nan, 0)"),
        ("obj", "x.obj", b"", "x.obj: the mesh is empty"),
    ],
)
def test_broken_files_are_named(tmp_path, kind, name, data, says):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError) as error:
        grimaldi.load({"type": "scene", "part": {"type": kind, "filename": str(tmp_path / name)}})
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_gltf_file_without_its_buffer_is_named(tmp_path):
    for file, data in export_gltf(trimesh.Scene(BOX)).items():
        if file.endswith(".gltf"):
            (tmp_path / "x.gltf").write_bytes(data)
    with pytest.raises(InputError, match=r"x\.gltf: cannot be read"):
        grimaldi.load({"type": "scene", "part": {"type": "gltf", "filename": str(tmp_path / "x.gltf")}})


@pytest.mark.parametrize(
    ("faces", "says"),
    [([[0, 1], [0, 1, 2]], "face 0 has 2 corners"), ([[0, 1, 2, 9]], "face 0 joins vertices 0, 1, 2, 9")],
)
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_wrong_polygons_are_named(tmp_path, faces, says, form):
    with pytest.raises(InputError, match=says):
        grimaldi.load({"type": "scene", "part": ply(tmp_path / "x.ply", faces, form)})


@pytest.mark.parametrize(
    ("part", "says"),
    [
        (cylinder(radius=0.0), "radius is 0; give a positive number"),
        (cylinder(radius=-1.0), "radius is -1; give a positive number"),
        (cylinder(radius=float("nan")), "radius is nan; give a positive number"),
        (cylinder(p1=[-2, -9, 1]), "part: "),
        ({"type": "cone", "p0": [0, 0, 0], "p1": [0, 0, 0]}, "cone: p0 and p1 are the same"),
        (
            {"type": "cone", "p0": [0, 0, 0], "p1": [0, 0, 1], "radius": 0.0},
            "cone: radius is 0; give a positive number",
        ),
        ({"type": "cone", "p0": [0, 0, 0]}, "cone: p1 is missing"),
        ({"type": "cone", "p0": [0, 0, 0], "p1": [0, 0, 1], "radios": 1.0}, "unknown parameter 'radios'"),
        ({"type": "stl"}, "stl: filename is missing"),
        ({"type": "stl", "filename": "none.stl"}, "none.stl: no such file"),
        ({"type": "instance"}, "an instance without a shapegroup"),
        ({"type": "instance", "group": {"type": "cube"}}, "an instance without a shapegroup"),
    ],
)
def test_wrong_shapes_are_named(part, says):
    with pytest.raises(InputError) as error:
        grimaldi.load({"type": "scene", "part": part})
    assert says in str(error.value)
    assert "\n" not in str(error.value)
