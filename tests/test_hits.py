"""Hit points in Float64: on the surface, on the ray, and so phases at 1 m that are right in visible light."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np
import oracle
import pytest
from numpy.typing import NDArray
from optics import GREY, affine, emitter, shape

import grimaldi
from grimaldi.engine.hits import Hits, hits
from grimaldi.engine.tiles import Shot, render_tile
from grimaldi.light import prepare
from grimaldi.options import Settings

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for
mi.set_variant("llvm_ad_rgb")

Reals = NDArray[np.float64]

LAMP = {"type": "coherent_point", "position": [0.0, 0.0, 1000.0]}


@pytest.fixture(autouse=True)
def rgb():
    mi.set_variant("llvm_ad_rgb")


def f64(v: Any) -> Reals:
    """A Dr.Jit 3-vector as rows (n, 3)."""
    return np.array(v, np.float64).T


# ---------------------- On the surface ----------------------

# all exact in Float32: what a shape is follows from its matrix alone
TURN = np.array([[1.0, 0.0, -1.0], [0.0, 1.5, 0.0], [1.0, 0.0, 1.0]])
AT = (0.25, -1.5, 3.0)
TURNED, MIRRORED = affine(turn=TURN, at=AT), affine(turn=TURN * [-0.5, 1, 2], at=AT)
OFF = {  # distance from the surface in the shape's own coordinates
    "sphere": lambda x: np.linalg.norm(x, axis=1) - 1,
    "cylinder": lambda x: np.linalg.norm(x[:, :2], axis=1) - 1,
    "disk": lambda x: x[:, 2],
    "rectangle": lambda x: x[:, 2],
    "cube": lambda x: np.abs(x).max(axis=1) - 1,
}
GLASS = {"type": "roughdielectric"}  # no body, and still a surface that light falls on
SHAPES = {
    "sphere": ("sphere", affine(0.75, AT), GREY),
    "mirrored sphere": ("sphere", affine([-0.75, 0.75, 0.75], AT), GREY),
    "glass sphere": ("sphere", affine(0.75, AT), GLASS),
    "glass mesh": ("cube", TURNED, GLASS),
} | {
    f"{name} {kind}": (kind, matrix, GREY)
    for kind in ("cylinder", "disk", "rectangle", "cube")
    for name, matrix in (("turned", TURNED), ("mirrored", MIRRORED))
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.filterwarnings("ignore:.*does not diffract yet:grimaldi.errors.GrimaldiWarning")
def test_refined_points_lie_on_the_surface_and_on_the_ray(name):
    """To 1e-12 of the coordinates, where Mitsuba's own points are off by Float32's rounding."""
    kind, to_world, bsdf = SHAPES[name]
    before = {"type": "sphere", "center": [50, 0, 0], "bsdf": GREY}  # so that no table begins with the shape
    scene = grimaldi.load({"type": "scene", "a": before, "it": shape(kind, to_world, bsdf), "lamp": LAMP})
    rng = np.random.default_rng(3)
    o = np.array(AT) + 6 * rng.normal(size=(4000, 3))
    d = np.array(AT) + rng.uniform(-1, 1, o.shape) - o
    ray = mi.Ray3f(mi.Point3f(*o.T), dr.normalize(mi.Vector3f(*d.T)))
    si = scene.mitsuba.ray_intersect(ray)
    met = np.array(si.is_valid())
    p, rough = (f64(v)[met] for v in (hits(scene).point(ray, si, si.is_valid()), si.p))
    assert met.sum() > 300

    inverse = np.linalg.inv(to_world)
    off, rough_off = (np.abs(OFF[kind](x @ inverse[:3, :3].T + inverse[:3, 3])) for x in (p, rough))
    assert off.max() < 1e-12 * np.abs(o).max()
    assert rough_off.max() > 1e-8
    aside = np.linalg.norm(np.cross(p - f64(ray.o)[met], f64(ray.d)[met]), axis=1)
    assert aside.max() < 1e-12 * np.abs(o).max()
    assert np.abs(p - rough).max() < 1e-3


@pytest.mark.filterwarnings("ignore:.*does not diffract yet:grimaldi.errors.GrimaldiWarning")
def test_on_other_shapes_mitsubas_point_is_kept(tmp_path):
    """A curve is neither flat nor a quadric; the floor behind it is known."""
    (tmp_path / "curve.txt").write_text("".join(f"{x} {0.1 * x * x} 0 0.5\n" for x in (-6, -3, 0, 3, 6)))
    curve = {"type": "bsplinecurve", "filename": str(tmp_path / "curve.txt"), "bsdf": GREY}
    floor = shape("rectangle", affine(8.0, (0, 0, -1.1)))
    scene = grimaldi.load({"type": "scene", "it": curve, "floor": floor, "lamp": LAMP})
    x, y = dr.meshgrid(*(dr.linspace(mi.Float, -1.7, 1.7, 40) for _ in range(2)))
    ray = mi.Ray3f(mi.Point3f(0.1, 0.2, 9), dr.normalize(mi.Vector3f(x, y, -9)))
    si = scene.mitsuba.ray_intersect(ray)
    p, rough = f64(hits(scene).point(ray, si, True)), f64(si.p)
    on_floor = rough[:, 2] < -1
    assert 0.1 < on_floor.mean() < 0.9
    np.testing.assert_array_equal(p[~on_floor], rough[~on_floor])
    assert (p[on_floor] != rough[on_floor]).any(axis=1).mean() > 0.9


def test_a_surface_elsewhere_is_not_believed():
    """Where Mitsuba sees a shape elsewhere than its parameters say, its point stands."""
    scene = grimaldi.load({"type": "scene", "it": shape("rectangle", affine(2.0)), "lamp": LAMP})
    ray = mi.Ray3f(mi.Point3f(0.1, 0.2, 9), mi.Vector3f(0, 0, -1))
    si = scene.mitsuba.ray_intersect(ray)
    si.t -= 1e-3
    si.p.z += 1e-3
    np.testing.assert_array_equal(f64(hits(scene).point(ray, si, True)), f64(si.p))


# ---------------------- Phases at 1 m, λ = 550 nm ----------------------

LAMBDA = 5.5e-7  # of scene units that are metres
K = 2 * np.pi / LAMBDA
A, B = (oracle.Spherical(position) for position in ((0.125, -0.0625, 1.0), (-0.75, 0.25, 0.5)))
TILTED = np.array([[1.0, 0.0, -0.25], [0.0, 1.0, 0.5], [0.25, -0.5, 1.0]])
PLANES = {"level": affine(0.5, (0, 0, -0.3)), "tilted": affine(0.5, (0.02, 0.01, -0.1), TILTED)}


def picture(plane: str, *lights: oracle.Source) -> dict[str, Any]:
    """A grey plane about 1 m from lights and a camera."""
    T = mi.scalar_rgb.ScalarTransform4f
    sensor = {
        "type": "perspective",
        "fov": 20,
        "to_world": T().look_at([0.6, -0.4, 0.7], [0, 0, -0.2], [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": 40, "height": 30, "rfilter": {"type": "box"}},
    }
    scene = {"type": "scene", "plane": shape("rectangle", PLANES[plane]), "sensor": sensor}
    return scene | {f"lamp{i}": emitter(light) for i, light in enumerate(lights)}


class Recorder(NamedTuple):
    """A sensor that keeps the rays it made."""

    sensor: Any
    rays: list[Any]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.sensor, name)

    def sample_ray_differential(self, *args: Any) -> Any:
        self.rays.append(self.sensor.sample_ray_differential(*args))
        return self.rays[-1]


def exact_points(scene: Any, ray: Any) -> Reals:
    """Where Float32 rays, taken as exact, meet the rectangle through its Float32 corners: NumPy, in Float64."""
    (rectangle,) = scene.shapes()
    a, b, c = np.array(rectangle.vertex_positions_buffer(), np.float64).reshape(-1, 3)[
        np.array(rectangle.faces_buffer()).reshape(-1, 3)[0]
    ]
    n = np.cross(b - a, c - a)
    o, d = f64(ray.o), f64(ray.d)
    return o + (((a - o) @ n) / (d @ n))[:, None] * d


def rough(self: Hits, ray: Any, si: Any, active: Any) -> Any:
    """What Mitsuba says."""
    return mi.Point3d(si.p)


def phase_errors(U: Any, scene: Any, ray: Any, light: oracle.Source) -> Reals:
    return np.abs(np.angle(U / light.wave(exact_points(scene, ray), K)[0]))


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "llvm_ad_mono"])
@pytest.mark.parametrize("plane", PLANES)
def test_the_phase_on_a_picture_is_that_of_the_place_seen(plane, variant, monkeypatch):
    """U of eq. 1 to Float32, which pictures are, in each pixel; at Mitsuba's points its noise exceeds 0.1 rad."""
    mi.set_variant(variant)
    scene = grimaldi.load(picture(plane, A))
    light = prepare(scene, Settings(wavelength=LAMBDA))
    shot = Shot(40, 30, 1, 5, 2, 5, False)

    def errors() -> Reals:
        sensor = Recorder(scene.mitsuba.sensors()[0], [])
        tile = render_tile(light, sensor, shot, 0, 1200)
        return phase_errors(tile.U[0], scene.mitsuba, sensor.rays[0][0], A)

    assert errors().max() < 1e-6
    monkeypatch.setattr(Hits, "point", rough)
    assert errors().max() > 0.1


def test_fringes_of_two_lights_far_apart(monkeypatch):
    """|U|² at single points of Mitsuba's integrator, whose fringes are about a micrometre wide; in two equal scenes."""
    scenes = [mi.load_dict(picture("tilted", A, B)) for _ in range(2)]
    wave = mi.load_dict({"type": "wave", "wavelength": LAMBDA, "groups": "0"})

    def worst(scene: Any) -> float:
        x, y = dr.meshgrid(*(dr.linspace(mi.Float, 0.05, 0.95, 30) for _ in range(2)))
        ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, mi.Point2f(x, y), mi.Point2f(0.5))
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(0, dr.width(x))
        _, _, (re, im) = wave.sample(scene, sampler, ray)
        p = exact_points(scene, ray)
        exact = np.abs(A.wave(p, K)[0] + B.wave(p, K)[0]) ** 2
        return float(np.abs(np.array(re) ** 2 + np.array(im) ** 2 - exact).max() / exact.max())

    for scene in scenes:  # Mitsuba numbers their shapes differently
        assert worst(scene) < 1e-5
    monkeypatch.setattr(Hits, "point", rough)
    assert worst(scenes[0]) > 0.1
