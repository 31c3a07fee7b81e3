"""Fast ways against the slow literal ones: hierarchies, and lists of what acts on blocks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba
import numpy as np
import pytest
from floor import Floor
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

import grimaldi
from grimaldi.bench import scenes
from grimaldi.diffraction import bundles, fine, listing, middles, solids, verdicts, waves
from grimaldi.diffraction import lists as listed
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import boundary
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.hierarchy import NONE, layout, least_detour
from grimaldi.diffraction.lists import FINELY, INNER, List, Parts
from grimaldi.diffraction.model import LEFT, OUTSIDE, UP, Options, Receivers
from grimaldi.diffraction.reach import reach
from grimaldi.engine.blocks import Sight, squares
from grimaldi.light import prepare
from grimaldi.options import Settings
from grimaldi.scene.model import Scene

mi: Any = mitsuba
mi.set_variant("llvm_ad_rgb")

Reals = NDArray[np.float64]


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
    F, V, *_ = types(double=True)
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
def crowd() -> tuple[Scene, Reals]:
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


def test_a_field_is_summed_once(crowd):
    """One kernel for all that is told of the points."""
    scene, points = crowd
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        grimaldi.field(scene, points[:333], wavelength=scenes.WAVELENGTH, tolerance=2e-2)
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert sum(kernel["size"] == 333 for kernel in kernels) == 1


# ---------------------------------------------------------------- blocks of receivers


@pytest.mark.parametrize("occlusion", ["none", "graded"])
def test_lists_of_blocks_add_up_to_all_pieces(occlusion):
    """But for fringes finer than a pixel; a few points may lie where a thin shadow goes unseen."""
    tolerance = 2e-2
    floor = Floor(tolerance, occlusion)
    blocks = floor.film.blocks
    point = dr.zeros(mi.Vector3f, dr.width(blocks.p))
    film = replace(floor.film, blocks=blocks._replace(right=point, down=point))  # pixels without extent
    fast, whole = floor.both(film, *np.random.default_rng(1).uniform(0, 64, (2, 4000)))
    off = abs(fast - whole)
    assert abs(whole.real - 1).max() > 0.5
    assert np.quantile(off, 0.9) < 0.1 * tolerance
    assert np.sqrt((off**2).mean()) < 0.25 * tolerance
    assert 0 < off.max() < (tolerance if occlusion == "none" else 0.15)


def test_fringes_that_lists_leave_out_are_too_fine_for_pixels():
    """At points they matter, in means over pixels they do not."""
    tolerance, n = 5e-2, 400
    floor = Floor(tolerance, "none")
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 64, (2, 40, 1)) + rng.uniform(0, 1, (2, 40, n))
    fast, whole = floor.both(floor.film, *pixels.reshape(2, -1))
    off = (fast - whole).reshape(-1, n)
    at_points, of_means = np.sqrt((abs(off) ** 2).mean()), np.sqrt((abs(off.mean(axis=1)) ** 2).mean())
    assert at_points > 0.2 * tolerance
    assert of_means < 0.25 * at_points


def test_places_between_corners_of_flat_blocks_are_where_the_film_sees_them():
    """A quadratic through corners on a slanted plane errs far less than a pixel."""
    floor = Floor(2e-2, "none")
    blocks = floor.film.blocks
    flat = np.flatnonzero((blocks.bend.numpy()[:16] == 0) & blocks.active.numpy()[:16])  # the first of each square
    found = np.array(fine.between(blocks)).T.reshape(-1, fine.FINE, fine.FINE, 3)[flat]
    y, x = (np.add.outer(16.0 * of, np.arange(0, 17, 2)) for of in (flat // 4, flat % 4))
    x, y = np.broadcast_to(x[:, None], found.shape[:3]), np.broadcast_to(y[:, :, None], found.shape[:3])
    seen = floor.sight(*(mi.Float(v.ravel().astype(np.float32)) for v in (x, y))).receivers
    off = np.linalg.norm(np.array(seen.p).T.reshape(found.shape) - found, axis=-1)
    assert len(flat) > 8
    assert np.quantile(off / np.linalg.norm(found[:, :1, 1:2] - found[:, :1, :1], axis=-1), 0.9) < 1e-3


@pytest.mark.parametrize("across", [2, INNER])
def test_what_reaches_a_cell_in_part_grows_evenly_between_places(across):
    """By SciPy's own linear interpolation of the bits."""
    rng = np.random.default_rng(across)
    bits = rng.integers(0, 2, (across, across))
    u, v = rng.uniform(0, 1, (2, 500))
    mark = FINELY if across == INNER else 0
    index = dr.zeros(mi.UInt32, 500)
    parts = Parts(List(index, index), mi.UInt32(int((bits.ravel() << np.arange(across**2)).sum()) | mark))
    receivers = Receivers(mi.Point3d(0), mi.Vector3f(0), mi.Bool(True), None, None, mi.Float(u), mi.Float(v))
    places = np.linspace(0, 1, across)
    expected = RegularGridInterpolator((places, places), bits.astype(float))(np.stack([v, u], axis=1))
    np.testing.assert_allclose(parts.share(index, receivers).numpy(), expected, atol=1e-5)


def with_and_without(
    monkeypatch: Any,
    module: Any,
    name: str,
    value: float,
    tolerance: float,
    occlusion: str = "none",
    radius: float | None = None,
) -> tuple[Any, Any, Reals]:
    """Lists under fringes wider than blocks, those with a number of a module set anew, and how far their M differs."""
    monkeypatch.setattr(scenes, "WAVELENGTH", 2.0)
    floor = Floor(tolerance, occlusion, radius)
    factor: Any = floor.light.beams[0].factor
    places = np.random.default_rng(1).uniform(0, 64, (2, 2000))
    told, lists = [], []
    for _ in range(2):
        told.append(floor.both(floor.film, *places)[0])
        lists.append(factor.single.known(floor.film.blocks))
        monkeypatch.setattr(module, name, value)
    return lists[0], lists[1], abs(told[0] - told[1])


def test_chirps_tell_what_the_segments_of_pieces_do(monkeypatch):
    """Nearly all that reaches blocks as a whole; together they err by 0.08 of the tolerance in the mean, or bundled."""
    tolerance = 5e-2
    chirps, segments, off = with_and_without(monkeypatch, waves, "FITS", 0.0, tolerance)
    assert chirps.everywhere.begin.numpy()[-1] > 10 * chirps.runs.first.begin.numpy()[-1] > 0
    assert segments.everywhere.begin.numpy()[-1] == 0
    assert 0 < off.max() < 0.3 * tolerance
    assert np.sqrt((off**2).mean()) < 0.1 * tolerance


def test_chirps_in_space_tell_the_same_on_a_curved_surface(monkeypatch):
    """Nearly all that reaches its blocks; a receiver outside the box of its block is told by segments."""
    tolerance = 5e-2
    told, segments, off = with_and_without(monkeypatch, solids, "FITS", 0.0, tolerance, "binary", 30.0)
    by_solids = told.partly_solids.numpy() != NONE
    assert by_solids.mean() > 0.8
    assert (segments.partly_solids.numpy() == NONE).all()
    assert 0 < off.max() < 0.3 * tolerance
    assert np.sqrt((off**2).mean()) < 0.1 * tolerance

    monkeypatch.undo()
    monkeypatch.setattr(listed, "BOXED", 0.0)
    outside, _, off = with_and_without(monkeypatch, solids, "FITS", 0.0, tolerance, "binary", 30.0)
    assert (outside.partly_solids.numpy() != NONE).sum() == by_solids.sum()
    assert off.max() < 1e-4 * tolerance


def test_bundles_are_fewer_chirps_that_tell_the_same(monkeypatch):
    tolerance = 5e-2
    fewer, every, off = with_and_without(monkeypatch, bundles, "ROUNDS", 0, tolerance)
    assert fewer.everywhere.begin.numpy()[-1] < 0.8 * every.everywhere.begin.numpy()[-1]
    assert 0 < np.sqrt((off**2).mean()) < 0.05 * tolerance


def test_lists_are_the_same_in_both_precisions():
    floor = Floor(2e-2, "none")
    places = np.random.default_rng(1).uniform(0, 64, (2, 2000))
    single, _ = floor.both(floor.film, *places)
    floor.light = prepare(
        floor.scene, Settings(wavelength=scenes.WAVELENGTH, tolerance=2e-2, occlusion="none", precision="double")
    )
    double, _ = floor.both(floor.film, *places)
    assert 0 < abs(single - double).max() < 0.1 * 2e-2


def test_waves_are_left_out_as_long_as_all_of_them_make_little(monkeypatch):
    tolerance = 5e-2
    monkeypatch.setattr(bundles, "ROUNDS", 0)  # in bundles small waves cost nothing
    many, every, off = with_and_without(monkeypatch, waves, "SMALL", 1e-9, tolerance)
    assert many.everywhere.begin.numpy()[-1] < every.everywhere.begin.numpy()[-1]
    assert 0 < off.max() < 2 * 0.05 * tolerance
    assert 0 < (many.left.numpy() - every.left.numpy()).max() <= 0.05 * tolerance


def test_corners_that_blocks_share_are_asked_for_once(monkeypatch):
    """And lists are the same as if each asked for all of its own."""
    monkeypatch.setattr(scenes, "WAVELENGTH", 2.0)
    rays, lists = [], []

    def counted(*parts: Any) -> Any:
        rays.append(len(parts[-1]))
        return reaches(*parts)

    reaches = verdicts._reaches
    monkeypatch.setattr(verdicts, "_reaches", counted)
    floor = Floor(5e-2, "graded")
    factor: Any = floor.light.beams[0].factor
    for _ in range(2):
        lists.append(factor.single.known(floor.film.blocks).partly)
        rays.append(0)
        monkeypatch.setattr(verdicts, "FIRST_ROW", 0)
        monkeypatch.setattr(verdicts, "FIRST_COLUMN", 0)
    end = rays.index(0)
    assert 0 < sum(rays[:end]) < 0.9 * sum(rays[end:])
    for one, other in zip(*lists, strict=True):
        np.testing.assert_array_equal(one.begin if isinstance(one, List) else one, getattr(other, "begin", other))


def test_blocks_of_a_floor_know_those_beside_them():
    """Its normals are of Float32, a little shorter than 1."""
    blocks = Floor(5e-2, "none").film.blocks
    index = np.arange(16)
    np.testing.assert_array_equal(blocks.beside[LEFT].numpy(), np.where(index % 4 == 0, index, index - 1))
    np.testing.assert_array_equal(blocks.beside[UP].numpy(), np.where(index < 4, index, index - 4))


def test_blocks_between_others_are_told_what_a_ray_tells(monkeypatch):
    """But for few, where a shadow is thinner than a block."""
    monkeypatch.setattr(scenes, "WAVELENGTH", 2.0)
    asked: list[Any] = []

    def kept(*parts: Any) -> Any:
        asked.append(parts)
        return seen(*parts)

    seen = middles.seen_from_middles
    monkeypatch.setattr(listing, "seen_from_middles", kept)
    floor = Floor(5e-2, "graded")
    factor: Any = floor.light.beams[0].factor
    factor.single.known(floor.film.blocks)
    told = seen(*asked[0]).open.numpy()
    tested = middles._unhindered(*asked[0])
    search, blocks, _, pairs, _ = asked[0]
    middles._test(tested[0].open, tested[1], search, blocks, pairs)
    assert (tested[0].open.numpy() & tested[1].numpy()).sum() > 100
    assert (told != tested[0].open.numpy()).mean() < 2e-3


def test_a_square_has_a_block_for_each_of_three_surfaces():
    def see(x: Any, y: Any) -> Sight:
        step = dr.floor(x / 6)  # at three heights
        p = mi.Point3d(mi.Float64(x), mi.Float64(y), mi.Float64(step))
        ray = dr.zeros(mi.RayDifferential3f, dr.width(x))
        ray.o, ray.d = mi.Point3f(x, y, 100), mi.Vector3f(0, 0, -1)
        n = dr.zeros(mi.Vector3f, dr.width(x)) + mi.Vector3f(0, 0, 1)
        return Sight(ray, Receivers(p, n, dr.full(mi.Bool, True, dr.width(x))), mi.UInt32(step) + 1)

    x, y = (mi.Float(v.astype(np.float32)) for v in np.random.default_rng(0).uniform(0, 16, (2, 1000)))
    receivers = see(x, y).receivers
    block = squares(see, 16, 0, 16).placed(x, y, receivers).block.numpy()
    assert OUTSIDE not in block
    height = receivers.p.z.numpy()
    assert [len(np.unique(block[height == z])) for z in (0, 1, 2)] == [1, 1, 1]
    assert len(np.unique(block)) == 3
