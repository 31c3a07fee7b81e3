"""`coherent_area`, a plane wave out of an aperture, and Mitsuba's `spot` with its profile."""

from __future__ import annotations

from typing import Any

import mitsuba
import numpy as np
import oracle
import pytest
from optics import APERTURE, GREY, affine, line, shape

import grimaldi
from grimaldi.diffraction.frame import profile
from grimaldi.errors import GrimaldiWarning, InputError, NotYet

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for
mi.set_variant("llvm_ad_rgb")
T = mi.ScalarTransform4f
PLANE = oracle.Plane((0, 0, 1))
ACROSS = line((-20, 0.7, 60), (20, 3, 50), 13)


def glowing(kind: str, to_world: Any, **parameters: Any) -> dict[str, Any]:
    return shape(kind, to_world, emitter={"type": "coherent_area", **parameters})


def field(points: Any, **parts: Any) -> np.ndarray:
    scene = grimaldi.load({"type": "scene", **parts})
    return grimaldi.field(scene, points, wavelength=1, tolerance=1e-8).U.values[0]


@pytest.mark.parametrize(("a", "z"), [(12, 5), (12, 60), (7000 / 6, 10000 / 6)])
def test_on_the_axis_of_a_disc(a, z):
    """U = e^{ikz} - C e^{ik√(z²+a²)}, C = (1 + z/√(z²+a²))/2 (THEORY 5; the last is the report's figure 2)."""
    a = float(np.float32(a))  # as to_world keeps it
    s, k = np.hypot(z, a), 2 * np.pi
    expected = 3 * np.exp(1j * (k * z + 0.5)) - 3 * 0.5 * (1 + z / s) * np.exp(1j * (k * s + 0.5))
    (u,) = field([[0, 0, z]], lamp=glowing("disk", affine(a), amplitude=3.0, phase=0.5))
    np.testing.assert_allclose(u, expected, atol=2e-5)
    if a > 1000:
        assert abs(u[0] / 3) ** 2 == pytest.approx(1.7215, abs=5e-4)  # of a radius in Float32


@pytest.mark.parametrize("kind", ["disk", "rectangle"])
def test_it_is_a_plane_wave_through_a_hole_of_the_same_shape(kind):
    to_world = affine((9, 5, 1))
    lamp = field(ACROSS, lamp=glowing(kind, to_world))
    hole = shape(kind, to_world, APERTURE)
    wave = field(ACROSS, light={"type": "coherent_directional", "direction": [0, 0, 1]}, hole=hole)
    np.testing.assert_allclose(lamp, wave, atol=1e-12)


def test_off_axis_it_is_the_area_integral():
    to_world = affine((9, 5, 1))
    expected = oracle.area_factor(PLANE, ACROSS, oracle.square_area(to_world), 1) * PLANE.wave(ACROSS, 2 * np.pi)[0]
    (u,) = field(ACROSS, lamp=glowing("rectangle", to_world))
    np.testing.assert_allclose(u, expected, atol=1e-7)


def test_it_moves_with_its_shape():
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    at = np.array([3.0, -2, 5])
    u = field(ACROSS, lamp=glowing("disk", affine((9, 5, 1))))
    moved = field(ACROSS @ turn.T + at, lamp=glowing("disk", affine((9, 5, 1), at=at, turn=turn)))
    np.testing.assert_allclose(moved, u, atol=2e-5)  # to_world is Float32


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("mirror", [1, -1])
def test_it_shines_where_mitsubas_normal_points(flip, mirror):
    lamp = {**glowing("rectangle", affine((9 * mirror, 5, 1))), "flip_normals": flip}
    normal = mi.load_dict(lamp).sample_position(0.0, mi.Point2f(0.5)).n
    front = np.sign(np.array(normal).reshape(3)[2])
    assert np.abs(field([[0, 0, 30 * front]], lamp=lamp)).min() > 0.1
    np.testing.assert_array_equal(field([[0, 0, -30 * front], [5, 5, -1 * front]], lamp=lamp), 0)


def test_groups():
    """Two discs beside each other: one group adds as fields, two as intensities; each knows only its own border."""
    one, two = affine(5, at=(-8, 0, 0)), affine(5, at=(8, 0, -3))
    alone = [field(ACROSS, lamp=glowing("disk", to_world))[0] for to_world in (one, two)]
    both = field(ACROSS, a=glowing("disk", one), b=glowing("disk", two))
    np.testing.assert_allclose(both, [alone[0] + alone[1]], atol=1e-12)
    apart = field(ACROSS, a=glowing("disk", one, group="a"), b=glowing("disk", two, group="b"))
    np.testing.assert_allclose(apart, alone, atol=1e-12)


def test_for_other_lights_the_shape_is_a_body():
    lamp = {"type": "coherent_point", "position": [0, 0, -40], "group": "point"}
    u = field(ACROSS, lamp=lamp, a=glowing("disk", affine(9)))
    dark = field(ACROSS, lamp=lamp, a=shape("disk", affine(9)))
    np.testing.assert_allclose(u[1 if len(u) > 1 else 0], field(ACROSS, a=glowing("disk", affine(9)))[0], atol=1e-12)
    np.testing.assert_allclose(u[0], dark[0], atol=1e-12)


def test_pictures_by_wave_and_by_mitsubas_own():
    screen = {"type": "rectangle", "to_world": T().translate([0, 0, 60]).scale(40).rotate([1, 0, 0], 180)}
    scene = {
        "type": "scene",
        "lamp": glowing("disk", affine(9)),
        "screen": screen,
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, 30], [0, 0, 60], [0, 1, 0]).scale(15),
            "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
        },
    }
    ours = grimaldi.render(scene, wavelength=1.0, spp=4)
    hole = {k: v for k, v in scene.items() if k != "lamp"}
    hole |= {
        "light": {"type": "coherent_directional", "direction": [0, 0, 1]},
        "hole": shape("disk", affine(9), APERTURE),
    }
    np.testing.assert_allclose(ours.picture, grimaldi.render(hole, wavelength=1.0, spp=4).picture, rtol=1e-5)
    loaded = mi.load_dict(scene)
    wave = mi.load_dict({"type": "wave", "wavelength": 1.0})
    assert np.array(mi.render(loaded, integrator=wave, spp=4)).max() > 0
    for name in ("direct", "path"):
        assert not np.array(mi.render(loaded, integrator=mi.load_dict({"type": name}), spp=4)).any()


def test_an_xml_scene(tmp_path):
    (tmp_path / "x.xml").write_text(
        '<scene version="3.0.0"><shape type="disk"><transform name="to_world"><scale value="9"/></transform>'
        '<emitter type="coherent_area"><float name="amplitude" value="2"/></emitter></shape></scene>'
    )
    u = grimaldi.field(tmp_path / "x.xml", ACROSS, wavelength=1, tolerance=1e-8).U.values[0]
    np.testing.assert_allclose(u, 2 * field(ACROSS, lamp=glowing("disk", affine(9))), atol=1e-12)


BALL: dict[str, Any] = {"type": "sphere", "center": [0, 0, 30], "radius": 2.0, "bsdf": GREY}


@pytest.mark.parametrize(
    ("kind", "parts", "says"),
    [
        (InputError, {"lamp": {**BALL, "emitter": {"type": "coherent_area"}}}, "lamp: an aperture must be planar"),
        (InputError, {"lamp": glowing("cube", affine(1))}, "lamp: an aperture must be planar"),
        (InputError, {"lamp": {"type": "coherent_area"}}, "a coherent_area is part of a shape"),
        (InputError, {"lamp": glowing("disk", affine(1), amplitude=-1.0)}, "coherent_area: amplitude is -1"),
        (InputError, {"lamp": glowing("disk", affine(1), phase=float("nan"))}, "coherent_area: phase is nan"),
        (InputError, {"lamp": glowing("disk", affine(1), amplitud=1.0)}, "unknown parameter 'amplitud'"),
        (NotYet, {"lamp": glowing("disk", affine(1)), "hole": shape("disk", affine(1), APERTURE)}, "leave one out"),
        (NotYet, {"lamp": glowing("disk", affine(1)), "ball": BALL}, "ball: a body beside an aperture"),
    ],
)
def test_what_cannot_glow_is_refused(kind, parts, says):
    with pytest.raises(kind, match=says):
        grimaldi.load({"type": "scene", **parts})


# -------------------------------------------------------------------------------------------- spot


def spot(**parameters: Any) -> dict[str, Any]:
    to_world = T().look_at([3, -2, -40], [1, 0, 5], [0, 1, 0])
    return {"type": "spot", "to_world": to_world, "intensity": 4.0, **parameters}


def test_its_profile_is_mitsubas():
    emitter = mi.load_dict(spot(cutoff_angle=25.0, beam_width=12.0))
    (source,) = grimaldi.load({"type": "scene", "lamp": spot(cutoff_angle=25.0, beam_width=12.0)}).sources
    assert source.position is not None
    assert source.spot is not None
    points = np.random.default_rng(1).uniform(-30, 30, (2000, 3))
    it = mi.SurfaceInteraction3f()
    it.p = mi.Point3f(points.T)
    _, weight = emitter.sample_direction(it, mi.Point2f(0))
    theirs = np.array(weight)[0]
    d = points - source.position
    r = np.linalg.norm(d, axis=1)
    ours = source.amplitude**2 / r**2 * np.array(profile(source.spot, mi.Vector3d((d / r[:, None]).T)))
    assert (theirs > 0).mean() > 0.2
    assert (theirs == 0).mean() > 0.2
    np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=1e-6 * theirs.max())
    field = grimaldi.field({"type": "scene", "lamp": spot(cutoff_angle=25.0, beam_width=12.0)}, points, wavelength=1)
    np.testing.assert_allclose(field.intensity, ours, rtol=1e-9, atol=1e-15)


def test_within_its_beam_it_is_a_point():
    edge = shape("rectangle", affine((9, 5, 1)))
    point = {"type": "point", "position": [3, -2, -40], "intensity": 4.0}
    by_point = field(ACROSS, lamp=point, edge=edge)
    np.testing.assert_allclose(field(ACROSS, lamp=spot(beam_width=50.0, cutoff_angle=60.0), edge=edge), by_point)
    beside = np.array([[60.0, 0, 0]])
    assert field(beside, lamp=spot(beam_width=5.0, cutoff_angle=10.0)) == 0


def test_without_waves_it_is_direct():
    scene = mi.load_dict(
        {
            "type": "scene",
            "lamp": {**spot(cutoff_angle=20.0, beam_width=5.0), "intensity": {"type": "rgb", "value": [30, 20, 9]}},
            "floor": {"type": "rectangle", "to_world": T().translate([0, 0, 5]).scale(30), "bsdf": GREY},
            "cube": {"type": "cube", "to_world": T().translate([2, 1, -3]), "bsdf": GREY},
            "sensor": {
                "type": "perspective",
                "to_world": T().look_at([0, -20, -40], [0, 0, 5], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 48, "height": 40, "rfilter": {"type": "box"}},
            },
        }
    )
    wave = mi.load_dict({"type": "wave", "wavelength": 1.0, "diffraction": "none", "interference": False})
    direct = mi.load_dict({"type": "direct", "bsdf_samples": 0})
    rays, waves = (np.array(mi.render(scene, integrator=i, spp=16, seed=3)) for i in (direct, wave))
    np.testing.assert_allclose(waves, rays, rtol=1e-4, atol=1e-5 * rays.max())


def test_a_spot_with_a_texture_stays_ordinary_light():
    with pytest.warns(GrimaldiWarning, match=r"lamp \(SpotLight\): stays ordinary light"):
        assert not grimaldi.load({"type": "scene", "lamp": spot(texture={"type": "checkerboard"})}).sources
