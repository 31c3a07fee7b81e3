"""The built-in scenes load, and the creature is a mesh one can diffract by."""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import trimesh

import grimaldi
from grimaldi.errors import InputError
from grimaldi.scene import builtin
from grimaldi.scene.builtin import creature


@pytest.fixture(scope="module")
def mesh() -> Any:
    return trimesh.load_mesh(creature.MESH, process=False)


def test_names():
    assert set(builtin.names()) == {"young", "slit", "arago", "knife-edge", "creature"}
    with pytest.raises(InputError, match="did you mean 'young'"):
        builtin.build("jung")
    with pytest.raises(InputError, match="did you mean 'separation'"):
        builtin.build("young", seperation=1.0)


@pytest.mark.parametrize("name", ["young", "slit", "arago", "knife-edge", "creature"])
def test_loads_with_its_sources_and_wavelength(name):
    scene = grimaldi.load(name)
    assert scene.unit is not None
    assert scene.sources
    assert len(scene.mitsuba.sensors()) == 1
    assert builtin.build(name)["integrator"]["wavelength"] > 0


@pytest.mark.parametrize("name", ["young", "slit", "arago", "knife-edge"])
def test_the_camera_sees_nothing_but_the_screen_and_all_of_it_at_the_stated_width(name):
    width = 5.0
    scene = grimaldi.load(builtin.build(name, width=width)).mitsuba
    corners = mi.Point2f([0, 1, 0, 1, 0.5], [0, 0, 1, 1, 0.5])
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, corners, mi.Point2f(0.5))
    hit = np.array(scene.ray_intersect(ray).p).T
    np.testing.assert_allclose(hit[:, 2], 0, atol=1e-6)
    np.testing.assert_allclose(np.sort(hit[:4, 0]), np.array([-1, -1, 1, 1]) * width / 2, rtol=1e-4)
    np.testing.assert_allclose(hit[4], 0, atol=1e-5)


def test_lengths_of_a_built_in_can_be_chosen():
    near, far = (grimaldi.load(builtin.build("young", separation=s)).sources for s in (0.25, 1.0))
    for sources, separation in ((near, 0.25), (far, 1.0)):
        a, b = (np.asarray(source.position) for source in sources)
        assert np.linalg.norm(a - b) == pytest.approx(separation)


def test_creature_is_one_closed_outward_body_on_the_floor(mesh):
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert mesh.euler_number == 2
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-5)
    assert 6000 <= len(mesh.faces) <= 13000
    assert creature.MESH.stat().st_size < 400_000


def test_creature_has_no_sliver(mesh):
    assert np.degrees(mesh.face_angles.min()) > 15


def test_creatures_head_is_meshed_four_times_finer_than_its_trunk(mesh):
    middle = mesh.vertices[mesh.edges_unique].mean(axis=1)
    x, _, z = middle.T
    head = np.linalg.norm(middle - [68, 0, 81], axis=1) < 18
    trunk = (x > -45) & (x < 25) & (z > 28) & (z < 56)
    length = mesh.edges_unique_length
    assert np.median(length[trunk]) > 4 * np.median(length[head])
