"""Many meshes as one: what is seen, what diffracts and what names it stay as they were."""

from __future__ import annotations

from typing import Any

import mitsuba
import numpy as np
import pytest
from optics import shape

import grimaldi
from grimaldi.bench import scenes
from grimaldi.engine.hits import hits
from grimaldi.scene import bodies, joined
from grimaldi.scene.model import Joined

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for
mi.set_variant("llvm_ad_rgb")

DARK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.1}}


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """So few that a test has as many."""
    mi.set_variant("llvm_ad_rgb")
    for module in (bodies, joined):
        monkeypatch.setattr(module, "MANY", 3)


def several(**more: Any) -> dict[str, Any]:
    """Six bodies of one material in a layer over a floor, and more."""
    return scenes.bodies(6, seed=3, size=24, spp=4) | more


def test_meshes_of_one_material_become_one_and_bodies_stay():
    one, apart = grimaldi.load(several()), grimaldi.load(mi.load_dict(several()))
    assert len(apart.mitsuba.shapes()) == 7
    assert sorted(shape.id() for shape in one.mitsuba.shapes()) == ["floor", "joined"]
    assert len(one.blockers.shapes()) == len(apart.blockers.shapes()) == 1
    assert [b.name for b in one.bodies] == [b.name for b in apart.bodies]
    for a, b in zip(one.bodies, apart.bodies, strict=True):
        np.testing.assert_array_equal(bodies.vertices(a.geometry), bodies.vertices(b.geometry))
        assert one.mitsuba.shapes()[a.shape].id() == ("floor" if b.name == "floor" else "joined")
    for a, b in zip(*(vars(grimaldi.outline(scene)).values() for scene in (one, apart)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_pictures_are_what_they_were():
    """Those of a Mitsuba scene are not joined: its shapes are in use by others."""

    def picture(scene: Any) -> Any:
        return grimaldi.render(scene, wavelength=0.05, tolerance=0.01, spp=4).picture.values

    one, apart = (picture(scene) for scene in (several(), mi.load_dict(several())))
    assert apart.std() > 0.02
    np.testing.assert_allclose(one, apart, atol=1e-5)


def test_parts_of_a_joined_mesh_are_surfaces_of_their_own():
    """Told by the layer's centres: a ray down through each meets another surface, and beside them the floor."""
    scene = grimaldi.load(several())
    centres = np.concatenate([scenes.layer(6, 3), [[7.0, 7.0, 0.0]]])
    x, y, _ = (mi.Float(v) for v in centres.T)
    si = scene.mitsuba.ray_intersect(mi.Ray3f(mi.Point3f(x, y, 20), mi.Vector3f(0, 0, -1)))
    found = hits(scene)
    numbers = np.array(found.surface(si, si.is_valid()))
    assert len(set(numbers)) == 7
    assert (numbers > 0).all()
    assert (np.array(found.surface(si, mi.Bool(False))) == 0).all()
    z = np.array(found.point(ray=mi.Ray3f(mi.Point3f(x, y, 20), mi.Vector3f(0, 0, -1)), si=si, active=True).z)
    assert z[-1] == scenes.FLOOR
    assert np.abs(z[:-1] - centres[:-1, 2]).max() < scenes.RADIUS


def test_meshes_with_texture_coordinates_are_left_alone():
    at = np.eye(4)
    at[0, 3] = 30
    scene = grimaldi.load(several(**{f"cube-{i}": shape("cube", at, DARK) for i in range(5)}))
    assert sorted({s.id() for s in scene.mitsuba.shapes()}) == [*(f"cube-{i}" for i in range(5)), "floor", "joined"]
    (joint,) = [s for s in scene.surfaces if isinstance(s, Joined)]
    assert len(joint.begin) == 7
    assert joint.begin[-1] == len(joint.faces)


def test_materials_are_told_by_their_reflectance():
    """Bodies of two greys make two meshes, and look like that."""
    given = several()
    for i in range(4):
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(DARK)
        body = given[f"body-{i}"]
        vertices, faces = (np.array(v).reshape(-1, 3) for v in (body.vertex_positions_buffer(), body.faces_buffer()))
        given[f"dark-{i}"] = joined.as_mesh(
            mi, f"dark-{i}", vertices + np.array([30, 0, 0], np.float32), faces, properties
        )
    scene = grimaldi.load(given)
    greys = [np.array(mi.traverse(s.bsdf())["reflectance.value"]).ravel()[0] for s in scene.mitsuba.shapes()]
    assert len(greys) == 3
    assert sorted(np.round(greys, 3)) == [0.1, 0.5, 0.5]
    assert {f"dark-{i}" for i in range(4)} < {body.name for body in scene.bodies}
