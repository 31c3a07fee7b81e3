"""What `grimaldi.load` makes of scenes: bodies, holes, sources and units, whatever form they come in."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import mitsuba as mi
import numpy as np
import pytest

import grimaldi
from grimaldi import PlanarOutline
from grimaldi.errors import GrimaldiWarning, InputError, NotYet
from grimaldi.scene import require_sensor, require_sources, sources
from grimaldi.scene.model import Disk, Mesh, Sphere

XML = """
<scene version="3.0.0">
    <string name="scene_unit" value="1 um"/>
    <emitter type="coherent_point" id="lamp"><point name="position" x="0.1" y="-7" z="0.25"/></emitter>
    <shape type="ply" id="sheet"><string name="filename" value="sheet.ply"/></shape>
    <include filename="parts/ball.xml"/>
</scene>
"""
SHEET = "\n".join(
    [
        "ply\nformat ascii 1.0",
        "element vertex 4\nproperty float x\nproperty float y\nproperty float z",
        "element face 2\nproperty list uchar int vertex_indices\nend_header",
        "0 0 5\n1 0 5\n1 1 5\n0 1 5\n3 0 1 2\n3 0 2 3\n",
    ]
)


@pytest.fixture(autouse=True, params=["llvm_ad_mono"])
def variant(request: pytest.FixtureRequest) -> Iterator[str]:
    before = mi.variant()
    mi.set_variant(request.param)
    yield request.param
    mi.set_variant(before or "llvm_ad_mono")


def transform() -> Any:
    scalar: Any = mi.scalar_rgb
    return scalar.ScalarTransform4f()


def shapes(**parts: Any) -> dict[str, Any]:
    return {"type": "scene", **parts}


APERTURE = {"type": "aperture"}
LAMP = {"type": "coherent_point", "position": [0.0, 0.0, -10.0]}


def hole(**parameters: Any) -> dict[str, Any]:
    return {"type": "rectangle", "bsdf": APERTURE, **parameters}


def at(kind: str, *position: float, scale: Any = 1.0, **parameters: Any) -> dict[str, Any]:
    return {"type": kind, "to_world": transform().translate(list(position)).scale(scale), **parameters}


# ------------------------------------------------------------------------------------------ forms


def test_xml_with_unit_includes_and_files_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "scene.xml").write_text(XML)
    (tmp_path / "sheet.ply").write_text(SHEET)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "ball.xml").write_text(
        '<scene version="3.0.0"><shape type="sphere" id="ball"><point name="center" x="9" y="0" z="0"/></shape></scene>'
    )
    monkeypatch.chdir("/")
    scene = grimaldi.load(tmp_path / "scene.xml")
    assert scene.unit == "1 um"
    assert {body.name for body in scene.bodies} == {"sheet", "ball"}
    assert [source.name for source in scene.sources] == ["lamp"]
    np.testing.assert_array_equal(scene.sources[0].position, [0.1, -7, 0.25])
    resolver: Any = mi.file_resolver  # pyright: ignore[reportAttributeAccessIssue]
    assert str(tmp_path) not in str(resolver())
    assert grimaldi.load(str(tmp_path / "scene.xml"), scene_unit="1 mm").unit == "1 mm"


def test_a_dict_a_mitsuba_scene_and_a_loaded_scene_are_the_same():
    description = shapes(scene_unit="1 mm", lamp=LAMP, ball={"type": "sphere"})
    scene = grimaldi.load(description)
    assert (scene.unit, len(scene.bodies), len(scene.sources)) == ("1 mm", 1, 1)
    assert description["scene_unit"] == "1 mm"
    assert grimaldi.load(scene) is scene
    ready = grimaldi.load(scene.mitsuba)
    assert ready.mitsuba is scene.mitsuba
    assert (ready.unit, len(ready.bodies), len(ready.sources)) == (None, 1, 1)


def test_outlines_are_added():
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    scene = grimaldi.load(shapes(lamp=LAMP))
    assert len(grimaldi.load(scene, outlines=[PlanarOutline(square)]).holes) == 1
    masks = [PlanarOutline(np.add(square, [x, 0]), hole=False) for x in (0, 2)]
    assert len(grimaldi.load(scene, outlines=masks).masks) == 2
    with pytest.raises(InputError, match="1 and 2 overlap"):
        grimaldi.load(scene, outlines=masks[:1] * 2)
    assert scene.holes == scene.masks == ()
    with pytest.raises(InputError, match="outlines: list is no PlanarOutline"):
        grimaldi.load(scene, outlines=[square])  # pyright: ignore[reportArgumentType]


def test_equal_parts_are_not_merged(tmp_path: Path):
    slit = '<shape type="ply"><string name="filename" value="sheet.ply"/></shape>'
    (tmp_path / "two.xml").write_text(f'<scene version="3.0.0">{slit}{slit}</scene>')
    (tmp_path / "sheet.ply").write_text(SHEET)
    assert len(grimaldi.load(tmp_path / "two.xml").bodies) == 2


# ----------------------------------------------------------------------------------------- bodies


def only(scene: dict[str, Any]) -> Any:
    (body,) = grimaldi.load(scene).bodies
    return body.geometry


def test_a_mesh_is_in_world_space():
    mesh = only(shapes(box=at("cube", 1, 2, 3, scale=[2, -1, 1])))
    assert isinstance(mesh, Mesh)
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float64, np.int64)
    np.testing.assert_allclose([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], [[-1, 1, 2], [3, 3, 4]])
    assert mesh.faces.shape == (12, 3)
    assert isinstance(only(shapes(plate={"type": "rectangle"})), Mesh)


@pytest.mark.parametrize("scale", [2.0, -2.0, [-2.0, 2.0, 2.0], [2.0, 3.0, 4.0]])
def test_a_sphere_is_what_mitsuba_renders(scale):
    ball = at("sphere", 1, 2, 3, scale=scale, radius=0.5)
    ball["to_world"] = ball["to_world"] @ transform().rotate([1, 2, 3], 40)
    scene = grimaldi.load(shapes(ball=ball))
    geometry = scene.bodies[0].geometry
    assert isinstance(geometry, Sphere)
    box = scene.mitsuba.shapes()[0].bbox()
    np.testing.assert_allclose(geometry.centre, np.array(box.center()), atol=1e-6)
    np.testing.assert_allclose(2 * geometry.radius, np.array(box.extents()), rtol=1e-6)


def test_a_disk_keeps_its_ellipse():
    disk = only(shapes(disk=at("disk", 1, 2, 3, scale=[2, 3, 1])))
    assert isinstance(disk, Disk)
    expected = np.diag([2.0, 3, 1, 1])
    expected[:3, 3] = 1, 2, 3
    np.testing.assert_array_equal(disk.to_world, expected)


def test_what_does_not_diffract_yet_is_named_in_one_warning():
    glass = {"type": "dielectric"}
    description = shapes(
        lens={"type": "sphere", "bsdf": glass},
        tube=at("cylinder", 5, 0, 0),
        veil=at("rectangle", 9, 0, 0, bsdf={"type": "mask", "opacity": 0.5, "nested": {"type": "diffuse"}}),
        fog=at("cube", 15, 0, 0, interior={"type": "homogeneous"}),
        ball=at("sphere", 20, 0, 0),
        cloth=at("disk", 25, 0, 0, bsdf={"type": "twosided", "bsdf": {"type": "diffuse"}}),
    )
    with pytest.warns(GrimaldiWarning, match="does not diffract yet") as warned:
        scene = grimaldi.load(description)
    assert {body.name for body in scene.bodies} == {"ball", "cloth", "tube"}
    (warning,) = warned
    assert all(name in str(warning.message) for name in ("lens", "veil", "fog"))
    assert "ball" not in str(warning.message)


def test_blockers_hold_the_bodies_only():
    scene = grimaldi.load(shapes(lamp=LAMP, slit=hole(), wall=at("rectangle", 0, 0, 4)))
    ray = mi.Ray3f(mi.Point3f(0.1, 0.1, -1), mi.Vector3f(0, 0, 1))
    hit = scene.blockers.ray_intersect(ray)
    np.testing.assert_allclose(np.array(hit.t), 5)
    assert [shape.id() for shape in scene.blockers.shapes()] == ["wall"]
    for body in scene.bodies:
        assert scene.mitsuba.shapes()[body.shape].id() == body.name
    assert grimaldi.load(shapes(lamp=LAMP)).blockers is None


# ---------------------------------------------------------------------------------------- sources


@pytest.mark.parametrize(
    ("variant", "tint"),
    [("llvm_ad_mono", (1.0,)), ("llvm_ad_rgb", (0.5, 1.0, 1.5))],
    indirect=["variant"],
)
def test_sources(variant, tint):
    rgb = {"type": "rgb", "value": [2.0, 4.0, 6.0]}
    scene = grimaldi.load(
        shapes(
            a={"type": "point", "position": [1e6, 2, 3], "intensity": rgb},
            b={"type": "directional", "direction": [0, 3, 4], "irradiance": {"type": "uniform", "value": 9.0}},
            c={"type": "coherent_point", "position": [1e6 + 1e-6, 2, 3], "amplitude": 5.0, "phase": 0.5},
            d={"type": "coherent_directional", "direction": [0, 3, 4], "group": "blue"},
        )
    )
    a, b, c, d = cast(Any, sorted(scene.sources, key=lambda source: source.name))
    white = (1.0,) * len(tint)
    assert [source.group for source in (a, b, c, d)] == ["a", "b", "0", "blue"]
    assert [source.is_plane for source in (a, b, c, d)] == [False, True, False, True]
    np.testing.assert_allclose(a.tint, tint, rtol=1e-6)
    if len(tint) == 3:
        np.testing.assert_allclose(a.amplitude, 2, rtol=1e-6)
    np.testing.assert_array_equal(a.position, [1e6, 2, 3])
    np.testing.assert_allclose(b.amplitude, 3, rtol=1e-6)
    np.testing.assert_allclose(b.direction, [0, 0.6, 0.8], atol=1e-7)
    assert (b.tint, c.tint, d.tint) == (white, white, white)
    assert (c.amplitude, c.phase, d.amplitude, d.phase) == (5.0, 0.5, 1.0, 0.0)
    np.testing.assert_array_equal(c.position, [1e6 + 1e-6, 2, 3])
    np.testing.assert_allclose(d.direction, [0, 0.6, 0.8], rtol=1e-15)
    np.testing.assert_array_equal(d.origin, 0)


def test_listed_sources_join_the_coherent_group():
    scene = grimaldi.load(shapes(a={"type": "point"}, b={"type": "point", "position": [1, 0, 0]}))
    groups = {source.name: source.group for source in sources(scene.mitsuba, coherent=["b"])}
    assert groups == {"a": "a", "b": "0"}
    with pytest.raises(InputError, match="coherent: no source has the id 'bb'; did you mean 'b'"):
        sources(scene.mitsuba, coherent=["bb"])


def test_nameless_sources_get_a_group_each():
    points = '<emitter type="point"/><emitter type="point"><point name="position" x="1" y="0" z="0"/></emitter>'
    scene = grimaldi.load(mi.load_string(f'<scene version="3.0.0">{points}</scene>'))
    assert len({source.group for source in scene.sources} - {"0"}) == 2


def test_other_lights_are_named_in_one_warning():
    description = shapes(
        lamp=LAMP,
        sky={"type": "constant"},
        torch={"type": "spot", "texture": {"type": "checkerboard"}},
        panel={"type": "rectangle", "emitter": {"type": "area", "id": "glow"}},
    )
    with pytest.warns(GrimaldiWarning, match="stays ordinary light") as warned:
        scene = grimaldi.load(description)
    assert [source.name for source in scene.sources] == ["lamp"]
    assert [body.name for body in scene.bodies] == ["panel"]
    (warning,) = warned
    assert "sky" in str(warning.message)
    assert "torch" in str(warning.message)
    assert "AreaLight" in str(warning.message)


@pytest.mark.parametrize("variant", ["llvm_ad_spectral", "llvm_ad_mono_polarized"], indirect=True)
def test_spectral_and_polarized_variants_are_refused(variant):
    with pytest.raises(InputError, match=f"variant {variant}"):
        grimaldi.load(shapes(lamp=LAMP))


def test_what_a_field_and_a_picture_need():
    empty = grimaldi.load(shapes())
    with pytest.raises(InputError, match="has no source of waves; add"):
        require_sources(empty)
    with pytest.raises(InputError, match="has no sensor; add"):
        require_sensor(empty)
    full = grimaldi.load(shapes(lamp=LAMP, camera={"type": "perspective"}))
    require_sources(full)
    require_sensor(full)


# ------------------------------------------------------------------------------ apertures, screen


def test_apertures_become_holes(tmp_path: Path):
    scene = grimaldi.load(
        shapes(
            lamp=LAMP,
            slit=hole(to_world=transform().translate([5, 0, 0]).scale([2, 3, 1])),
            pupil={"type": "disk", "bsdf": APERTURE},
        )
    )
    pupil, slit = sorted(scene.holes, key=lambda outline: not outline.is_ellipse)
    assert (pupil.is_ellipse, slit.is_ellipse) == (True, False)
    assert scene.bodies == ()
    (loop,) = slit.world_loops()
    np.testing.assert_array_equal(loop, [[3, -3, 0], [7, -3, 0], [7, 3, 0], [3, 3, 0]])


def test_a_planar_mesh_is_the_hole_that_its_border_bounds(tmp_path: Path):
    # A square ring of eight triangles, tilted.
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    flat = np.concatenate([2.0 * corners, corners])
    vertices = np.stack([flat[:, 0], 0.6 * flat[:, 1], 0.8 * flat[:, 1] + 7], axis=1)
    faces = [f for i in range(4) for f in ([i, (i + 1) % 4, 4 + i], [(i + 1) % 4, 4 + (i + 1) % 4, 4 + i])]
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (tmp_path / "ring.obj").write_text("\n".join(lines))
    ring = {"type": "obj", "filename": str(tmp_path / "ring.obj"), "bsdf": APERTURE}
    (outline,) = grimaldi.load(shapes(ring=ring)).holes
    outer, inner = sorted(outline.world_loops(), key=lambda loop: -np.ptp(loop[:, 0]))
    for loop, expected in ((outer, vertices[:4]), (inner, vertices[4:])):
        for corner in expected:
            assert np.linalg.norm(loop - corner, axis=1).min() < 1e-6
        assert len(loop) == 4


@pytest.mark.parametrize("kind", ["sphere", "cube"])
def test_an_aperture_must_be_planar(kind):
    with pytest.raises(InputError, match="ball: an aperture must be planar"):
        grimaldi.load(shapes(ball={"type": kind, "bsdf": APERTURE}))


BEFORE, BEHIND = -5.0, 5.0  # the source is at z = -10, the screen at z = 0


@pytest.mark.parametrize(
    "parts",
    [
        {"wall": at("rectangle", 0, 0, BEHIND, scale=9)},
        {"wall": at("disk", 0, 0, BEHIND, scale=9)},
        {"left": at("rectangle", -1, 0, BEHIND), "right": at("rectangle", 1, 0, BEHIND)},
        {
            "wall": at("rectangle", 0, 0, 9, scale=9),
            "floor": {
                "type": "rectangle",
                "to_world": transform().translate([0, -9, 5]).rotate([1, 0, 0], -90).scale([9, 4, 1]),
            },
        },
        {"ball": at("sphere", 4, 0, BEFORE)},
        {"box": at("cube", 0, 4, BEFORE)},
        {"behind": at("sphere", 0, 0, -13)},
        {  # passes below the cone and above the source's back
            "awning": {
                "type": "rectangle",
                "to_world": transform().translate([0, 0.9, -15.5]).rotate([1, 0, 0], 101.3).scale([9, 14.7, 1]),
            }
        },
        {"beside": at("rectangle", 0, -2, -20, scale=[9, 1, 1]), "wall": at("disk", 0, 0, BEHIND)},
        {"second": hole(to_world=transform().translate([3, 0, 0]))},
    ],
)
def test_bodies_beside_the_light_and_flat_receivers_are_fine(parts):
    assert grimaldi.load(shapes(lamp=LAMP, slit=hole(), **parts)).holes


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({"ball": at("sphere", 0, 0, BEHIND)}, "ball: a body beside an aperture screen"),
        ({"box": at("cube", 9, 0, BEHIND)}, "box: a body beside an aperture screen"),
        (
            {"near": at("rectangle", 0, 0, BEHIND), "far": at("rectangle", 0, 0, 9)},
            "near: a body beside an aperture screen .* hide 'far'",
        ),
        ({"ball": at("sphere", 0.8, 0, BEFORE)}, "ball: a body between source and aperture"),
        ({"box": at("cube", 0, 0, BEFORE, scale=0.1)}, "box: a body between source and aperture"),
        ({"card": at("disk", 0, 0, BEFORE, scale=0.1)}, "card: a body between source and aperture"),
        ({"ball": at("sphere", 4, 0, 0)}, "ball: a body that meets the aperture screen"),
        ({"plate": at("rectangle", 4, 0, 0)}, "plate: a body that meets the aperture screen"),
        ({"other": hole(to_world=transform().translate([0, 0, 1]))}, "holes in different planes"),
        (
            {"other": hole(to_world=transform().translate([5, 0, 0]).rotate([1, 0, 0], 1))},
            "holes in different planes",
        ),
        ({"light": {"type": "point", "position": [0, 0, 10]}}, "sources on both sides"),
        ({"light": {"type": "directional", "direction": [0, 0, -1]}}, "sources on both sides"),
    ],
)
def test_what_a_screen_cannot_be_combined_with_yet(parts, says):
    with pytest.raises(NotYet, match=says):
        grimaldi.load(shapes(lamp=LAMP, slit=hole(), **parts))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_plane_wave_is_hidden_along_its_direction(side):
    light = {"type": "coherent_directional", "direction": [1, 0, -side]}
    aside, in_front = at("sphere", 0, 0, 5 * side), at("sphere", -5, 0, 5 * side)
    assert grimaldi.load(shapes(light=light, slit=hole(), ball=aside)).holes
    with pytest.raises(NotYet, match="ball: a body between source and aperture"):
        grimaldi.load(shapes(light=light, slit=hole(), ball=in_front))


@pytest.mark.parametrize(
    ("light", "parts", "says"),
    [
        (LAMP, {"other": hole(to_world=transform().translate([1, 0, 0]))}, "holes 1 and 2 overlap"),
        ({"type": "coherent_point", "position": [3.0, 0, 0]}, {}, "light: the source lies in the aperture"),
        ({"type": "coherent_directional", "direction": [1, 0, 0]}, {}, "light: the source lies in the aperture"),
    ],
)
def test_screens_that_make_no_sense(light, parts, says):
    with pytest.raises(InputError, match=says):
        grimaldi.load(shapes(light=light, slit=hole(), **parts))


def test_a_mask_beside_an_aperture_is_not_handled_yet():
    mask = PlanarOutline([[0, 0], [1, 0], [1, 1]], hole=False)
    with pytest.raises(NotYet, match="mask beside an aperture"):
        grimaldi.load(shapes(lamp=LAMP, slit=hole()), outlines=[mask])
