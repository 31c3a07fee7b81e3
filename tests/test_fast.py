"""Fast ways against the slow literal ones: corners for whole segments, hierarchies for sums, cells for samples."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba
import numpy as np
import pytest
from numpy.typing import NDArray

import grimaldi
from grimaldi.bench import scenes
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import boundary
from grimaldi.diffraction.corners import between, corner
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.hierarchy import layout, least_detour
from grimaldi.diffraction.model import Options, Receivers
from grimaldi.diffraction.reach import reach
from grimaldi.diffraction.segment import Corners, Rule, line, segment_wave
from grimaldi.engine.cells import LARGEST, Nodes, cells
from grimaldi.engine.tiles import Shot, bands, sight
from grimaldi.light import Settings, prepare

mi: Any = mitsuba
mi.set_variant("llvm_ad_rgb")

Reals = NDArray[np.float64]


# ---------------------------------------------------------------- corners


def ways(rng: np.random.Generator, n: int, plane: bool) -> tuple[Any, Any, Any, Any, Any]:
    """Rays along z through the origin at k = 1, and segments from X0 to X1 beside them, in Fresnel widths and more."""
    F, V, _ = types(double=True)
    z1, z2 = 10 ** rng.uniform(0, 6, (2, n))
    width = np.sqrt(z2 if plane else z1 * z2 / (z1 + z2))
    q, angle = width * 10 ** rng.uniform(-2, 2, n), rng.uniform(0, 2 * np.pi, n)
    e = rng.normal(size=(3, n)) * np.array([1, 1, 0.3])[:, None]
    e /= np.linalg.norm(e, axis=0)
    X0 = np.stack([q * np.cos(angle), q * np.sin(angle), 0 * q])
    length = width * 10 ** rng.uniform(-2, 2, n)
    zero = F(np.zeros(n))
    frame = Frame(V(zero, zero, zero + 1), V(zero, zero, zero), F(z1), F(z2), zero, plane)
    return frame, V(*map(F, X0)), V(*map(F, X0 + length * e)), V(*map(F, e)), F(length)


@pytest.mark.parametrize("plane", [False, True])
@pytest.mark.parametrize("tolerance", [5e-2, 1e-3, 1e-6])
def test_corners_tell_what_the_whole_segment_does(tolerance, plane):
    """Each form within a tenth of the tolerance of the integral to 1e-10, wherever it says that it serves."""
    frame, X0, X1, e, length = ways(np.random.default_rng(3), 200_000, plane)
    k = type(length)(1)
    exact = segment_wave(frame, line(frame, X0, e), length, k, Rule.of(1e-10), dr.mask_t(k)(True))
    rule = Corners.of(tolerance)
    a, b = corner(frame, X0, k), corner(frame, X1, k)
    for form in (rule._replace(far=np.inf), rule._replace(bend=0.0)):  # short, far
        ends = between(frame.a, a, b, k, form)
        off = np.hypot((ends.real - exact.real).numpy(), (ends.imag - exact.imag).numpy()) / (2 * np.pi)
        serves = ends.serves.numpy()
        assert serves.sum() > 300
        assert off[serves].max() < 0.1 * tolerance


# ---------------------------------------------------------------- hierarchies


def test_a_node_holds_what_is_inside_and_leads_past_it():
    rng = np.random.default_rng(0)
    centre, radius = rng.normal(size=(37, 3)), rng.uniform(0, 0.1, 37)
    plan = layout(centre, radius, np.repeat(np.arange(13), 3)[:37])
    assert sorted(plan.order) == list(range(37))
    for i in range(len(plan.skip)):
        inside = plan.order[plan.begin[i] : plan.end[i]]
        reach = np.linalg.norm(centre[inside] - plan.spheres[i, :3], axis=1) + radius[inside]
        assert reach.max() <= plan.spheres[i, 3] + 1e-12
        leaves = [j for j in range(i, plan.skip[i]) if plan.skip[j] == j + 1]
        assert [plan.begin[j] for j in leaves] == list(range(plan.begin[i], plan.end[i]))


def test_no_point_of_a_sphere_has_a_smaller_detour_than_its_bound():
    rng = np.random.default_rng(1)
    F, V, _ = types(double=True)
    n = 20_000
    S, P = rng.normal(size=(2, n, 3)) * 10
    R = np.linalg.norm(P - S, axis=1)
    a = (P - S) / R[:, None]
    centre, radius = rng.normal(size=(n, 3)) * 10, 10 ** rng.uniform(-2, 1, n)
    on = rng.normal(size=(n, 3))
    x = centre + (radius * rng.uniform(0, 1, n) ** (1 / 3) / np.linalg.norm(on, axis=1))[:, None] * on

    def vectors(v: Reals) -> Any:
        return V(*(F(np.ascontiguousarray(c)) for c in v.T))

    frame = Frame(vectors(a), vectors(S), F(np.zeros(n)), F(R), F(R), False)
    bound = least_detour(frame, vectors(centre), F(radius)).numpy()
    detour = np.linalg.norm(x - S, axis=1) + np.linalg.norm(x - P, axis=1) - R
    assert (bound <= detour + 1e-12 * R).all()
    assert (bound > 0.5 * detour).mean() > 0.3  # it is a useful one


@pytest.fixture(scope="module")
def crowd() -> tuple[grimaldi.Scene, Reals]:
    """Eight hundred bodies over a floor, and points of it under their middle."""
    return grimaldi.load(scenes.bodies(800, seed=4, joined=True)), scenes.floor_points(400, seed=4)


def factors(scene: Any, points: Reals, outline: Any, options: Options) -> NDArray[np.complex128]:
    double = types(double=True)
    p = double.Vector(*(double.buffer(points[:, i]) for i in range(3)))
    n = mi.Vector3f(0, 0, 1) + dr.zeros(mi.Vector3f, len(points))
    m = boundary(scene, scene.sources[0], outline, 2 * np.pi / scenes.WAVELENGTH, options)(
        Receivers(p, n, dr.mask_t(p.x)(True))
    )
    return m.real.numpy() + 1j * m.imag.numpy()


@pytest.mark.parametrize(("occlusion", "allowed"), [("none", 1e-4), ("graded", 2e-2)])
def test_a_hierarchy_adds_up_to_what_all_pieces_do(crowd, occlusion, allowed):
    """With nothing left out the sums are the same; with rays, but for runs that are heard or not as one."""
    scene, points = crowd
    outline = grimaldi.outline(scene)
    options = Options(tolerance=2e-2, occlusion=occlusion)
    whole = factors(scene, points, outline, options)
    by_tree = factors(scene, points, replace(outline, far=1e25), options)
    assert abs(by_tree - whole).max() < allowed
    assert abs(whole - 1).max() > 0.5


def test_what_lies_far_from_the_rays_is_left_out_within_the_tolerance(crowd):
    scene, points = crowd
    outline = grimaldi.outline(scene)
    options = Options(tolerance=5e-2, occlusion="none")
    k = 2 * np.pi / scenes.WAVELENGTH
    far = reach(scene, scene.sources[0], outline, k, options, points)
    assert np.isfinite(far)
    off = abs(factors(scene, points, replace(outline, far=far), options) - factors(scene, points, outline, options))
    assert 0 < off.max() < options.tolerance


# ---------------------------------------------------------------- blocks of receivers


@pytest.mark.parametrize("occlusion", ["none", "graded"])
def test_lists_of_blocks_add_up_to_all_pieces(occlusion):
    """At what a camera sees of a floor under twelve bodies; a few points may lie where a thin shadow goes unseen."""
    tolerance = 2e-2
    scene = grimaldi.load(scenes.bodies(12, seed=2, size=64, spp=1))
    light = prepare(scene, Settings(wavelength=scenes.WAVELENGTH, tolerance=tolerance, occlusion=occlusion))
    sensor, shot = scene.mitsuba.sensors()[0], Shot(64, 64, 1, 0, 2, 5, False)
    (band,) = bands(light, sensor, shot)
    rng = np.random.default_rng(1)
    x, y = (mi.Float(v) for v in rng.uniform(0, 64, (2, 4000)).astype(np.float32))
    (_, receivers, _), _ = sight(light, sensor, shot, x, y)
    fast, whole = band.asks[0](x, y, receivers), light.beams[0].factor(receivers)
    off = np.hypot((fast.real - whole.real).numpy(), (fast.imag - whole.imag).numpy())[receivers.active.numpy()]
    assert abs(whole.real.numpy() - 1).max() > 0.5
    assert np.quantile(off, 0.9) < 0.1 * tolerance
    assert np.sqrt((off**2).mean()) < 0.25 * tolerance
    assert 0 < off.max() < (tolerance if occlusion == "none" else 0.15)


# ---------------------------------------------------------------- cells of the film


def waves(x: Any, y: Any) -> Nodes:
    """A known M: fringes that become finer to the right, seen on two surfaces that meet at x = 70."""
    real, imag = 1 + 0.3 * dr.cos(0.004 * x * x), 0.3 * dr.sin(0.004 * x * x + 0.02 * y)
    shape = dr.select(x < 70, mi.UInt32(1), mi.UInt32(2))
    return Nodes(real, imag, mi.Float(0), 100 + 0 * x, shape, mi.Float(dr.inf))


def test_cells_keep_their_share_and_do_not_reach_over_edges():
    share = 5e-3
    film = cells(waves, 96, 0, 64, 2, share)
    rng = np.random.default_rng(0)
    x, y = mi.Float(rng.uniform(0, 96, 50_000)), mi.Float(rng.uniform(0, 64, 50_000))
    exact = waves(x, y)
    known = film.at(x, y, exact.distance, exact.shape, mi.Bool(True))
    holds = known.holds.numpy()
    off = np.hypot((known.real - exact.real).numpy(), (known.imag - exact.imag).numpy())
    assert 0.4 < holds.mean() < 1
    assert off[holds].max() < share
    assert (off <= known.error.numpy() + 1e-6)[holds].mean() > 0.99
    assert not holds[(x.numpy() > 68) & (x.numpy() < 70)].any()  # the cells there see both surfaces
    assert not film.at(x, y, exact.distance + 1, exact.shape, mi.Bool(True)).holds.numpy().any()
    sizes = film.size.numpy().reshape(64, -1)
    assert sizes[:, :16].min() > sizes[:, 80:96].max()


def test_cells_far_too_coarse_for_the_fringes_are_not_halved():
    asked = []

    def fine_to_the_right(x: Any, y: Any) -> Nodes:
        asked.append(dr.width(x))
        real = dr.select(x > 32, dr.cos(7 * x + 11 * y), 1)
        return Nodes(real, 0 * x, mi.Float(0), 100 + 0 * x, mi.UInt32(1) + mi.UInt32(0 * x), mi.Float(dr.inf))

    film = cells(fine_to_the_right, 64, 0, 64, 2, 1e-5)
    assert asked == [(2 * 64 // LARGEST + 1) ** 2]
    assert ((film.size.numpy().reshape(64, 64) > 0) == (np.arange(64) < 32)).all()


def test_a_part_of_the_film_has_the_cells_of_the_whole():
    whole, part = cells(waves, 96, 0, 64, 2, 5e-3), cells(waves, 96, LARGEST, 32, 2, 5e-3)
    across = len(whole.size) // 64
    np.testing.assert_array_equal(part.size.numpy(), whole.size.numpy()[LARGEST * across : 48 * across])


@pytest.mark.parametrize("tolerance", [2e-2, 1e-3])
def test_a_picture_by_cells_is_that_by_samples(tolerance):
    """A sphere before a wall: U of each pixel within the tolerance (of |U0|) of M asked at every sample."""
    scene = grimaldi.load(
        {
            "type": "scene",
            "lamp": {"type": "coherent_point", "position": [0, 0, -40], "amplitude": 60.0},
            "ball": {"type": "sphere", "radius": 2.0},
            "wall": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, 20]).rotate([0, 1, 0], 180).scale(8),
            },
            "camera": {
                "type": "perspective",
                "fov": 40.0,
                "to_world": mi.ScalarTransform4f().look_at([9, 4, 1], [0, 0, 20], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 64, "height": 48},
            },
        }
    )
    options = {"wavelength": 0.2, "spp": 8, "tolerance": tolerance}
    fast = grimaldi.render(scene, **options)
    slow = grimaldi.render(scene, fast=False, **options)
    rays = grimaldi.render(scene, diffraction="none", **options)
    size = abs(rays.U.values).max()
    assert abs(slow.U.values - rays.U.values).max() > 0.1 * size
    assert abs(fast.U.values - slow.U.values).max() < tolerance * size
    assert abs(fast.intensity.values - slow.intensity.values).max() < 3 * tolerance * size**2
