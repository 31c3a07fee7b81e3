"""Wrong scenes: one line that names file, place and remedy; never a crash, and never silently wrong."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import grimaldi
from grimaldi.errors import GrimaldiWarning, InputError

HEADER = (
    "ply\nformat {} 1.0\ncomment made by hand\nelement vertex {}\nproperty float x\nproperty float y\n"
    "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n"
)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="<f4")


@pytest.fixture(autouse=True)
def _variant() -> None:
    mi.set_variant("llvm_ad_mono")


def refused(scene: Any) -> str:
    with pytest.raises(InputError) as error:
        grimaldi.load(scene)
    message = str(error.value)
    assert "\n" not in message
    assert ";" in message or "did you mean" in message, f"no remedy: {message}"
    assert ".cpp" not in message
    return message


def binary(vertices: Any, faces: Sequence[Sequence[int]]) -> bytes:
    rows = b"".join(struct.pack(f"<B{len(face)}i", len(face), *face) for face in faces)
    header = HEADER.format("binary_little_endian", len(vertices), len(faces)).encode()
    return header + np.asarray(vertices, "<f4").tobytes() + rows


def text(rows: str, vertices: int = 3, faces: int = 1) -> bytes:
    return (HEADER.format("ascii", vertices, faces) + rows).encode()


def moved(value: float) -> np.ndarray:
    vertices = CORNERS.copy()
    vertices[2, 1] = value
    return vertices


def serialized(face: Sequence[int]) -> bytes:
    """One mesh in Mitsuba's format 4, of three corners in single precision."""
    mesh = struct.pack("<I2sQQ", 0x1000, b"m\0", 3, 1) + CORNERS[:3].tobytes() + struct.pack("<3I", *face)
    return struct.pack("<HH", 0x041C, 4) + zlib.compress(mesh) + struct.pack("<QI", 0, 1)


# ----------------------------------------------------------------------------------------- meshes


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b"\x89PNG\r\n", "has no whole PLY header"),
        (binary(CORNERS, [[0, 1, 2]])[:70], "has no whole PLY header"),
        (
            binary(CORNERS, [[0, 1, 2], [0, 1, 3]])[:-5],
            "is cut off: the header says 2 face rows, the file holds 1",
        ),
        (binary(CORNERS, [[0, 1, 2]])[:-30], "is cut off: the header says 4 vertex rows, the file holds 2"),
        (HEADER.format("binary_little_endian", 3, 10**15).encode(), "is cut off"),
        (binary(CORNERS, [[0, 1, 2], [0, 1, 4]]), "face 1 joins vertices 0, 1, 4, but there are 4"),
        (binary(CORNERS, [[0, 1, 2**31 - 1]]), "face 0 joins vertices 0, 1, 2147483647"),
        (binary(CORNERS, [[0, 1, -1]]), "face 0 joins vertices 0, 1, -1"),
        (binary(CORNERS, [[0, 1], [0, 1, 2]]), "face 0 has 2 corners; give three or more"),
        (binary(moved(np.nan), [[0, 1, 2]]), r"vertex 2 is at \(0, nan, 0\)"),
        (binary(moved(-np.inf), [[0, 1, 2]]), r"vertex 2 is at \(0, -inf, 0\)"),
        (binary(moved(1e30), [[0, 1, 2]]), r"vertex 2 is at \(0, 1e\+30, 0\)"),
        (binary(moved(1e20), [[0, 1, 2]]), r"vertex 2 is at \(0, 1e\+20, 0\); give finite coordinates below 1e\+18"),
        (binary(CORNERS[:0], []), "the mesh is empty"),
        (binary(CORNERS, []), "the mesh is empty"),
        (text("0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"), "face 0 joins vertices 0, 1, 9"),
        (text("0 0 0\n1 0 0\n0 1 0\n"), "is cut off"),
        (text("0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n"), "vertex holds something that is no number"),
        (
            text("0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").replace(b"float z", b"floot z"),
            "line 7: 'property floot z'",
        ),
    ],
)
def test_ply_files(tmp_path: Path, content, says):
    path = tmp_path / "mesh.ply"
    path.write_bytes(content)
    message = refused({"type": "scene", "mesh": {"type": "ply", "filename": str(path)}})
    assert message.startswith(str(path))
    with pytest.raises(InputError, match=says):
        raise InputError(message)


@pytest.mark.parametrize("order", ["<", ">"])
def test_whole_ply_files_pass(tmp_path: Path, order):
    content = binary(CORNERS, [[0, 1, 2], [0, 1, 3]])
    if order == ">":
        rows = b"".join(struct.pack(">B3i", 3, *face) for face in ([0, 1, 2], [0, 1, 3]))
        content = HEADER.format("binary_big_endian", 4, 2).encode() + CORNERS.astype(">f4").tobytes() + rows
    (tmp_path / "mesh.ply").write_bytes(content)
    (body,) = grimaldi.load({"type": "scene", "mesh": {"type": "ply", "filename": str(tmp_path / "mesh.ply")}}).bodies
    np.testing.assert_array_equal(body.geometry.vertices, CORNERS)  # pyright: ignore


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (serialized([0, 1, 10**8]), "face 0 joins vertices 0, 1, 100000000, but there are 3"),
        (serialized([0, 1, 2])[:-9], "is no whole .serialized file"),
        (b"", "is no whole .serialized file"),
    ],
)
def test_serialized_files(tmp_path: Path, content, says):
    path = tmp_path / "mesh.serialized"
    path.write_bytes(content)
    message = refused({"type": "scene", "mesh": {"type": "serialized", "filename": str(path)}})
    assert says in message


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "face 0 joins vertices 0, 1, 8, but there are 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "vertex 2 is at (0, nan, 0)"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "the mesh is empty"),
    ],
)
def test_obj_files(tmp_path: Path, content, says):
    (tmp_path / "mesh.obj").write_text(content)
    assert says in refused({"type": "scene", "mesh": {"type": "obj", "filename": str(tmp_path / "mesh.obj")}})


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_vertices_set_from_python(value):
    scene = mi.load_dict({"type": "scene", "box": {"type": "cube"}})
    parameters = mi.traverse(scene)
    positions = np.array(parameters["box.vertex_positions"])
    positions[4] = value
    parameters["box.vertex_positions"] = positions
    parameters.update()
    assert "scene: box: vertex 1 is at" in refused(scene)


def test_an_edge_of_three_faces_is_named_and_loaded(tmp_path: Path):
    (tmp_path / "fin.ply").write_bytes(binary(CORNERS, [[0, 1, 2], [1, 0, 3], [0, 1, 3]]))
    scene = {"type": "scene", "fin": {"type": "ply", "filename": str(tmp_path / "fin.ply")}}
    with pytest.warns(GrimaldiWarning, match=r"fin: the edge from \(0, 0, 0\) to \(1, 0, 0\) is shared by 3"):
        assert len(grimaldi.load(scene).bodies) == 1


# ------------------------------------------------------------------------------------ scene files

BOX = '<shape type="cube" id="box">{}</shape>\n<emitter type="point" id="lamp">{}</emitter>'
INSIDE = '<point name="position" x="0.5" y="0" z="0"/>'
FAR = '<emitter type="{}" id="lamp"><point name="position" x="1e20" y="0" z="0"/></emitter>'
FLAT = '<shape type="{}" id="plate"><transform name="to_world"><scale x="0"/></transform></shape>'
FLIPPED = '<boolean name="flip_normals" value="true"/>'
MIRRORED = '<transform name="to_world"><scale x="-1"/></transform>'


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('<shape type="sphere">\n<shap', "scene.xml, line 4: malformed XML"),
        ('<shape type="sphere"/></shape>', "scene.xml, line 2: malformed XML"),
        ('<shape type="spher"/>', "scene.xml, line 2: unknown plugin 'spher'; did you mean 'sphere'?"),
        ('<shape type="gltff"/>', "line 2: unknown plugin 'gltff'; did you mean 'gltf'"),
        (
            '\n<emitter type="coherent_pint"/>',
            "line 3: unknown plugin 'coherent_pint'; did you mean 'coherent_point'",
        ),
        (
            '<shape type="sphere">\n<float name="radiu" value="1"/></shape>',
            "line 2: unknown parameter 'radiu' of 'sphere'",
        ),
        ('<float name="scene_units" value="1"/>', "unknown parameter 'scene_units' of 'scene'"),
        (
            '<shape type="sphere"><float name="radius" value="one"/></shape>',
            'line 2: could not parse floating point value "one"',
        ),
        (
            '<shape type="sphere"><float name="radius" value="nan"/></shape>',
            "line 2: the sphere's radius is nan",
        ),
        (
            '<shape type="sphere"><float name="radius" value="-1"/></shape>',
            "line 2: the sphere's radius is -1",
        ),
        ('<shape type="ply"/>', "line 2: parameter 'filename' of 'ply' is missing"),
        (
            '<shape type="ply"><string name="filename" value="no.ply"/></shape>',
            "line 2: file 'no.ply' not found",
        ),
        (
            '<shape type="obj"><string name="filename" value="no.obj"/></shape>',
            "line 2: file 'no.obj' not found",
        ),
        (
            '<texture type="bitmap"><string name="filename" value="no.png"/></texture>',
            "line 2: file 'no.png' not found",
        ),
        ('<include filename="no.xml"/>', "line 2: file 'no.xml' not found"),
        ('<include filename="scene.xml"/>', "scene.xml"),
        ('<ref id="nobody"/>', 'unresolved reference to "nobody"'),
        ('<emitter type="coherent_point"/>', "line 2: coherent_point: position is missing"),
        ("<shape>" * 12000 + "</shape>" * 12000, "line 2: nested deeper than 200 elements"),
        (
            '<film type="hdrfilm"><integer name="width" value="2147483647"/></film>',
            "line 2: a film of 2147483647 × 576 pixels",
        ),
        (
            '<film type="hdrfilm"><string name="width" value="wide"/></film>',
            "scene.xml, line 2: width is 'wide'; give a whole number",
        ),
        (
            '<film type="hdrfilm"><integer name="height" value="0"/></film>',
            "scene.xml, line 2: a film of 768 × 0 pixels; give at least 1 × 1",
        ),
        (
            '<film type="hdrfilm"><integer name="width" value="-4"/><integer name="height" value="-4"/></film>',
            "scene.xml, line 2: a film of -4 × -4 pixels; give at least 1 × 1",
        ),
        (
            '<shape type="serialized"><string name="filename" value="scene.xml"/>\n'
            '<string name="shape_index" value="first"/></shape>',
            "scene.xml, line 2: shape_index is 'first'; give a whole number",
        ),
        (
            '<emitter type="directional"><vector name="direction" x="0" y="0" z="0"/></emitter>',
            "scene.xml, line 2: directional: direction is zero",
        ),
        (
            '<emitter type="directional" id="sun"><transform name="to_world"><scale value="0"/></transform></emitter>',
            "sun: direction is zero",
        ),
        (
            '<emitter type="directional" id="sun"><vector name="direction" x="nan" y="0" z="0"/></emitter>',
            "sun: direction is not finite",
        ),
        (FAR.format("point"), "lamp: position is too large, (1e+20, 0, 0); give coordinates below 1e+18"),
        (FAR.format("coherent_point"), "lamp: position is too large"),
        (FLAT.format("disk"), "plate: to_world flattens it; give a scale, and a radius, that is nowhere 0"),
        (FLAT.format("rectangle"), "plate: all faces have zero area"),
        (BOX.format("", INSIDE), "lamp: the source lies inside 'box'; move it out"),
        (
            '<shape type="sphere" id="ball"/><emitter type="point" id="lamp"/>',
            "lamp: the source lies inside 'ball'",
        ),
        (
            '<emitter type="point" id="lamp"><point name="position" x="nan" y="0" z="0"/></emitter>',
            "lamp: position is not finite",
        ),
        ('<emitter type="point"><float name="intensity" value="-1"/></emitter>', "the light's power is"),
    ],
)
def test_xml(tmp_path: Path, body, says):
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">\n{body}\n</scene>')
    message = refused(tmp_path / "scene.xml")
    assert says in message
    assert "scene.xml" in message


@pytest.mark.parametrize("part", [FLIPPED, MIRRORED])
def test_a_lamp_in_a_room_is_no_source_inside_a_body(tmp_path: Path, part):
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{BOX.format(part, INSIDE)}</scene>')
    assert len(grimaldi.load(tmp_path / "scene.xml").sources) == 1


def test_a_box_that_holds_something_else_too_is_a_room():
    box = {"type": "cube", "to_world": mi.ScalarTransform4f().scale(5.0)}
    lamp = {"type": "point", "position": [0, 0, 4]}
    with pytest.raises(InputError, match="inside 'box'"):
        grimaldi.load({"type": "scene", "box": box, "lamp": lamp})
    ball = {"type": "sphere", "radius": 0.5}
    assert len(grimaldi.load({"type": "scene", "box": box, "lamp": lamp, "ball": ball}).sources) == 1


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "scene.xml, line 1: malformed XML"),
        ("ply", "scene.xml, line 1: malformed XML"),
        ("<scene/>", "missing version attribute"),
        ('<scen version="3.0.0"/>', "line 1: encountered an unsupported XML element: <scen>"),
        ('<shape version="3.0.0" type="sphere"/>', "is a Shape, no scene"),
    ],
)
def test_files_that_hold_no_scene(tmp_path: Path, content, says):
    (tmp_path / "scene.xml").write_text(content)
    assert says in refused(tmp_path / "scene.xml")


@pytest.mark.parametrize(
    ("include", "deep"),
    [
        ('<include filename="deep.xml"/>', "deep.xml"),
        (
            '<default name="f" value="x"/><default name="fs" value="deep"/><include filename="$fs.xml"/>',
            "deep.xml",
        ),
        ('<path value="there"/><include filename="deeper.xml"/>', "deeper.xml"),
    ],
)
def test_deep_includes(tmp_path: Path, include: str, deep: str):
    (tmp_path / "there").mkdir()
    for name in ("deep.xml", "there/deeper.xml"):
        (tmp_path / name).write_text("<q>" * 12000 + "</q>" * 12000)
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{include}</scene>')
    assert f"{deep}, line 1: nested deeper" in refused(tmp_path / "scene.xml")


def nested(depth: int) -> dict[str, Any]:
    scene: dict[str, Any] = {"type": "diffuse"}
    for _ in range(depth):
        scene = {"type": "twosided", "bsdf": scene}
    return scene


@pytest.mark.parametrize(
    ("scene", "says"),
    [
        ("yung", "yung: no such file or built-in scene; did you mean 'young'?"),
        ("absent/scene.xml", "absent/scene.xml: no such file or built-in scene; built-in scenes are"),
        ("/", "/: is a folder"),
        (3, "is a int, no scene"),
        ({"type": "diffuse"}, "is a BSDF, no scene"),
        ({"type": "scen"}, "unknown plugin 'scen'"),
        (
            {"type": "scene", "ball": {"type": "sphere", "radiu": 1.0}},
            "dictionary node \"ball\": unknown parameter 'radiu'",
        ),
        ({"type": "scene", "ball": {"type": "sphere", "radius": "one"}}, 'dictionary node "ball"'),
        (
            {"type": "scene", "ball": {"type": "sphere", "radius": float("nan")}},
            'dictionary node "ball": the sphere\'s radius is nan',
        ),
        ({"type": "scene", "scene_unit": 3.0}, "scene_unit: 3.0 has no unit"),
        (nested(3000), "nested deeper than 200"),
    ],
)
def test_what_is_no_scene(scene, says):
    assert says in refused(scene)


# ---------------------------------------------------------------------------- options and variants


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"diffraction": "boundry"}, "diffraction: 'boundry' is no model; did you mean 'boundary'?"),
        ({"diffraction": "rainbow"}, "diffraction: 'rainbow' is no model; known are area, boundary, huygens, none"),
        ({"occlusion": "binray"}, "occlusion: 'binray' is unknown; did you mean 'binary'?"),
        ({"rim": "smoth"}, "rim: 'smoth' is unknown; did you mean 'smooth'?"),
        ({"precision": "duoble"}, "precision: 'duoble' is unknown; did you mean 'double'?"),
        ({"tolerence": 1e-3}, "tolerence: no such option; did you mean 'tolerance'?"),
        ({"weights": "lenght"}, "weights: 'lenght' is unknown; did you mean 'length'?"),
        ({"n": 0}, "n: 0 is no number of sources; give an integer from 1 to 16777216, or 'nyquist'"),
        ({"n": 2.5}, "n: 2.5 is no number of sources; give an integer from 1 to 16777216, or 'nyquist'"),
        ({"n": "many"}, "n: 'many' is no number of sources; give an integer from 1 to 16777216, or 'nyquist'"),
        ({"epsilon": -1}, "epsilon: -1 is no length; give a positive number of scene units"),
        ({"epsilon": float("nan")}, "epsilon: nan is no length; give a positive number of scene units"),
    ],
)
def test_wrong_options_are_refused(options, says):
    with pytest.raises(InputError) as error:
        grimaldi.field("young", [[0.0, 0.0, 1.0]], wavelength=0.5, **options)
    assert str(error.value) == says


@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral", "llvm_ad_spectral", "llvm_ad_mono_polarized"])
def test_variants_without_waves_are_refused(variant):
    mi.set_variant(variant)
    with pytest.raises(InputError, match=f"^variant {variant}: waves need an llvm or cuda variant"):
        grimaldi.render("young", spp=1, size=(8, 8))


@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([[1j, 0, 0]], "points: not real numbers"),
        ([[True, False, True]], "points: not real numbers"),
        (np.array([["1", "2", "3"]]), "points: not real numbers"),
        ([[10**400, 0, 0]], "points: not real numbers"),
        (np.ma.masked_array(np.eye(1, 3), np.eye(1, 3, dtype=bool)), "points: not real numbers, or not all"),
        ([[0, 0, 1], [1e300, 0, 0]], "points: row 1 is further than 1e\\+18 away"),
        ([[np.nan, 0, 0]], "points: row 0 is not finite"),
    ],
)
def test_points_are_real_numbers_within_reach(points: Any, says: str):
    with pytest.raises(InputError, match=says):
        grimaldi.field("young", points, wavelength=0.5)


# ------------------------------------------------------------------------------------- the command


@pytest.mark.parametrize("broken", ["mesh", "xml"])
def test_the_command_says_one_line_and_exits_with_2(tmp_path: Path, broken):
    (tmp_path / "mesh.ply").write_bytes(binary(CORNERS, [[0, 1, 10**8]]))
    part = '<shape type="ply"><string name="filename" value="mesh.ply"/></shape>' if broken == "mesh" else "<q"
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">\n{part}\n</scene>')
    done = subprocess.run(
        [sys.executable, "-m", "grimaldi", "field", "scene.xml", "--plane", "0,0,0; 1,0,0; 0,1,0; 2x2"]
        + ["--wavelength", "1", "-o", "x.nc"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert ("mesh.ply: face 0" if broken == "mesh" else "scene.xml, line 3: malformed XML") in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mesh.ply", "scene.xml"]


def test_field_takes_the_scenes_own_wavelength_or_says_that_there_is_none():
    lamp = {"type": "coherent_point", "position": [0, 0, 1]}
    own = {"type": "scene", "lamp": lamp, "waves": {"type": "wave", "wavelength": 0.25}}
    assert grimaldi.field(own, [0, 0, 0]).wavelength.values == [0.25]
    with pytest.raises(InputError, match="wavelength: there is none"):
        grimaldi.field({"type": "scene", "lamp": lamp}, [0, 0, 0])
