"""Pictures of outlines: the shadow mask's shape, and files that other programs can read."""

import xml.etree.ElementTree as ET
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import shapely
import trimesh
from matplotlib.image import imread

import grimaldi
from grimaldi.errors import InputError
from grimaldi.outlines.mask import shadow_mask
from grimaldi.outlines.write import write

WHITE = {"type": "diffuse"}


def loaded(light: dict[str, Any], **shapes: Any) -> tuple[Any, Any]:
    scene = grimaldi.load({"type": "scene", "light": light, **shapes})
    return scene, scene.sources[0]


def lamp(*position: float) -> dict[str, Any]:
    return {"type": "coherent_point", "position": list(position)}


SUN = {"type": "coherent_directional", "direction": [0, 0, -1]}


def transform() -> Any:
    return mi.scalar_rgb.ScalarTransform4f()  # pyright: ignore[reportAttributeAccessIssue]


def square(size: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict[str, Any]:
    to_world = transform().translate([x, y, z]).scale([size / 2, size / 2, 1])
    return {"type": "rectangle", "to_world": to_world, "bsdf": WHITE}


def sphere(radius: float, *centre: float) -> dict[str, Any]:
    return {"type": "sphere", "radius": radius, "center": list(centre), "bsdf": WHITE}


def test_a_spheres_mask_is_its_tangent_circle():
    mask = shadow_mask(*loaded(lamp(0, 0, 10), ball=sphere(3, 0, 0, 0)))
    assert mask.projection.kind == "gnomonic"
    tangent = 3 / np.sqrt(10**2 - 3**2)
    assert mask.region.area == pytest.approx(np.pi * tangent**2, rel=1e-3)


def test_overlapping_bodies_are_one_region_and_apart_two():
    wide = shadow_mask(*loaded(SUN, a=square(2, z=1), b=square(2, x=1, z=2), floor=square(50)))
    assert wide.projection.kind == "parallel"
    assert wide.region.area == pytest.approx(6)
    assert wide.region.geom_type == "Polygon"
    apart = shadow_mask(*loaded(SUN, a=square(2, z=1), b=square(2, x=5, z=2), floor=square(50)))
    assert len(shapely.get_parts(apart.region)) == 2
    assert apart.region.area == pytest.approx(8)


def test_a_plane_waves_picture_shows_x_to_the_right_of_y_up():
    mask = shadow_mask(*loaded(SUN, a=square(2, x=3, y=1, z=1), floor=square(50)))
    x, y = mask.region.centroid.coords[0]
    # seen from above, looking down
    assert (x, y) == pytest.approx((3, 1))


def test_floor_and_crossing_wall_do_not_hide_what_stands_before_them():
    wall = {
        "type": "rectangle",
        "to_world": transform().translate([-20, 0, 0]).rotate([0, 1, 0], 90).scale([30, 30, 1]),
        "bsdf": WHITE,
    }
    scene, source = loaded(lamp(40, 0, 20), ball=sphere(3, 0, 0, 4), floor=square(80), wall=wall)
    mask = shadow_mask(scene, source)
    distance = np.linalg.norm([40, 0, 16])
    assert mask.region.area == pytest.approx(np.pi * 3**2 / (distance**2 - 3**2), rel=1e-3)


def test_a_lamp_in_a_room_sees_all_around_it():
    balls = {f"ball{i}": sphere(1, *c) for i, c in enumerate([(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, -4, 1)])}
    room = {"type": "cube", "to_world": transform().scale(10), "flip_normals": True, "bsdf": WHITE}
    mask = shadow_mask(*loaded(lamp(0, 0, 0.3), room=room, **balls))
    assert mask.projection.kind == "azimuthal equidistant"
    assert 3 <= len(shapely.get_parts(mask.region)) <= 4
    assert mask.region.area < 1.2 * np.pi**2 / 4


def test_equidistant_keeps_angles_from_the_axis():
    balls = {"a": sphere(0.5, 5, 0, 0), "b": sphere(0.5, -3, 4, 0), "c": sphere(0.5, -3, -4, 0)}
    projection = shadow_mask(*loaded(lamp(0, 0, 0), **balls)).projection
    assert projection.kind == "azimuthal equidistant"
    directions = np.random.default_rng(2).normal(size=(100, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    angle = np.arccos(directions @ projection.axis)
    np.testing.assert_allclose(np.linalg.norm(projection(7 * directions), axis=1), angle, atol=1e-9)


def test_an_island_in_a_hole_is_opaque():
    ring = grimaldi.PlanarOutline(
        [np.array([[-2, -2], [2, -2], [2, 2], [-2, 2]]), np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])],
        transform().translate([0, 0, 1]),
    )
    scene = grimaldi.load({"type": "scene", "light": SUN, "floor": square(50)}, outlines=[ring])
    mask = shadow_mask(scene, scene.sources[0])
    assert mask.hole
    assert mask.region.area == pytest.approx(12)
    assert not mask.region.contains(shapely.Point(0, 0))


def test_ply_holds_the_outline_as_edges_between_shared_vertices(tmp_path):
    scene, source = loaded(SUN, a=square(2, z=1), floor=square(50))
    outline = grimaldi.outline(scene, source)
    write(outline, scene, source, tmp_path / "a.ply")
    head, _, body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    counts = [int(line.split()[-1]) for line in head.decode().splitlines() if line.startswith("element")]
    assert counts[1] == len(outline)
    vertices = np.frombuffer(body, "<f8", 3 * counts[0]).reshape(-1, 3)
    edges = np.frombuffer(body, "<i4", 2 * counts[1], offset=vertices.nbytes).reshape(-1, 2)
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    np.testing.assert_array_equal(vertices[edges[:, 0]], outline.start)
    np.testing.assert_array_equal(vertices[edges[:, 1]], outline.end)
    assert len(body) == vertices.nbytes + edges.nbytes
    read: Any = trimesh.load(tmp_path / "a.ply", process=False)
    assert len(read.vertices) == counts[0]


def test_png_shows_the_mask_grey_on_white_within_red_lines(tmp_path):
    scene, source = loaded(SUN, ball=sphere(3, 0, 0, 5), floor=square(50))
    write(grimaldi.outline(scene, source), scene, source, tmp_path / "a.png")
    picture = imread(tmp_path / "a.png")[:1190, :, :3]  # above the caption
    grey = np.isclose(picture, 0.72, atol=0.01).all(axis=-1)
    red = (picture[..., 0] > 0.5) & (picture[..., 1] < 0.3)
    rows, columns = np.nonzero(grey)
    size = np.ptp(columns)
    assert np.ptp(rows) == pytest.approx(size, rel=0.02)
    assert grey.sum() == pytest.approx(np.pi / 4 * size**2, rel=0.03)
    assert np.any(red, axis=1)[rows.min() : rows.max()].all()


def test_svg_is_well_formed_and_always_the_same(tmp_path):
    scene, source = loaded(lamp(0, 0, 20), ball=sphere(3, 0, 0, 5), floor=square(50))
    outline = grimaldi.outline(scene, source)
    for name in ("a.svg", "b.svg"):
        write(outline, scene, source, tmp_path / name)
    assert ET.parse(tmp_path / "a.svg").getroot().tag.endswith("svg")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_wrong_names_leave_nothing(tmp_path):
    scene, source = loaded(SUN, a=square(2, z=1), floor=square(50))
    outline = grimaldi.outline(scene, source)
    with pytest.raises(InputError, match=r"\.svg, \.png or \.ply"):
        write(outline, scene, source, tmp_path / "a.pdf")
    with pytest.raises(InputError, match="does not exist"):
        write(outline, scene, source, tmp_path / "no" / "a.svg")
    assert list(tmp_path.iterdir()) == []
