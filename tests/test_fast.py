"""Fast ways against the slow literal ones: hierarchies and lists for sums, cells for samples."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np
import pytest
from numpy.typing import NDArray

import grimaldi
from grimaldi.bench import scenes
from grimaldi.diffraction import listing
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import boundary
from grimaldi.diffraction.frame import Frame
from grimaldi.diffraction.hierarchy import layout, least_detour
from grimaldi.diffraction.model import OUTSIDE, Evaluate, Factor, Options, Receivers
from grimaldi.diffraction.reach import reach
from grimaldi.engine.asking import ask
from grimaldi.engine.blocks import Sight, Squares, squares
from grimaldi.engine.cells import cells
from grimaldi.engine.frozen import frozen
from grimaldi.engine.judging import Shares
from grimaldi.engine.nodes import LARGEST, ROWS, Nodes
from grimaldi.engine.tiles import Samples, Shot, sight
from grimaldi.light import Settings, prepare

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


@dataclass
class Floor:
    """A floor under twelve bodies as a camera sees it, M there by all pieces and by lists of blocks."""

    tolerance: float
    occlusion: str

    def __post_init__(self) -> None:
        self.scene = grimaldi.load(scenes.bodies(12, seed=2, size=64, spp=1))
        settings = Settings(wavelength=scenes.WAVELENGTH, tolerance=self.tolerance, occlusion=self.occlusion)
        self.light = prepare(self.scene, settings)
        self.film = squares(self.sight, 64, 0, 64)

    def sight(self, x: Any, y: Any) -> Sight:
        return sight(self.light, self.scene.mitsuba.sensors()[0], Shot(64, 64, 1, 0, 2, 5, False), x, y)[0]

    def both(self, film: Squares, x: Reals, y: Reals) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """M by the blocks of `film`, and by all pieces, at places of it."""
        x, y = (mi.Float(v.astype(np.float32)) for v in (x, y))
        receivers = self.sight(x, y).receivers
        factor = self.light.beams[0].factor
        assert receivers.active.numpy().all()
        return tuple(
            m.real.numpy() + 1j * m.imag.numpy() for m in (ask(film, factor)(x, y, receivers), factor(receivers))
        )


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


def test_chords_tell_what_the_segments_of_their_pieces_do(monkeypatch):
    """Bodies so finely meshed that a piece has several segments: by chords where they serve, and by segments alone."""
    tolerance = 5e-2
    monkeypatch.setattr(scenes, "SPLIT", 40)
    monkeypatch.setattr(scenes, "WAVELENGTH", 2.0)  # fringes wider than blocks
    floor = Floor(tolerance, "none")
    factor: Any = floor.light.beams[0].factor
    places = np.random.default_rng(1).uniform(0, 64, (2, 2000))
    by_chords, _ = floor.both(floor.film, *places)
    assert factor.single.lists(floor.film.blocks).chords.first.begin.numpy()[-1] > 1000
    monkeypatch.setattr(listing, "STRAIGHT", 0.0)
    by_segments, _ = floor.both(floor.film, *places)
    assert factor.single.lists(floor.film.blocks).chords.first.begin.numpy()[-1] == 0
    assert 0 < abs(by_chords - by_segments).max() < 0.01 * tolerance


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


# ---------------------------------------------------------------- models traced and recorded once


def test_a_field_is_summed_once(crowd):
    """One kernel for all that is told of the points."""
    scene, points = crowd
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        grimaldi.field(scene, points[:333], wavelength=scenes.WAVELENGTH, tolerance=2e-2)
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert sum(kernel["size"] == 333 for kernel in kernels) == 1


def test_a_recorded_model_tells_what_the_model_tells_wherever_it_is_asked():
    """For any number of receivers, and of another light with other arrays."""
    for tolerance in (2e-2, 1e-3):
        floor = Floor(tolerance, "graded")
        model = floor.light.beams[0].factor
        recorded = frozen(model)
        for n in (300, 7, 1, 2000):
            x, y = (mi.Float(v.astype(np.float32)) for v in np.random.default_rng(n).uniform(0, 64, (2, n)))
            receivers = floor.sight(x, y).receivers
            for own, plain in zip(recorded(receivers), model(receivers), strict=True):
                np.testing.assert_allclose(own.numpy(), mi.Float64(plain).numpy(), rtol=0, atol=1e-6)


class Parts(NamedTuple):
    """A model of two precisions."""

    single: Evaluate
    double: Evaluate
    tolerance: float

    def __call__(self, receivers: Receivers) -> Factor:
        raise AssertionError("each of its parts is asked by itself")


@pytest.mark.parametrize("above", [0, 1, 5, 800])
def test_the_finer_part_of_a_model_is_asked_where_the_other_errs(above):
    """Of a few receivers, which are filled up, and of many."""

    def tells(real: float, error: float) -> Evaluate:
        return lambda at: Factor(real + 0 * at.p.x, 0 * at.p.x, error * at.p.x, 1 * at.p.y)

    x = dr.arange(mi.Float64, 1000)
    tolerance = 999.5 - above
    point = Receivers(mi.Point3d(x, 2 * x, 0), mi.Vector3f(0, 0, 1), x >= 0)
    told = ask(None, Parts(tells(1, 1), tells(2, 0.5), tolerance))(None, None, point)  # pyright: ignore
    errs = x.numpy() > tolerance
    assert errs.sum() == above
    np.testing.assert_array_equal(told.real.numpy(), np.where(errs, 2, 1))
    np.testing.assert_array_equal(told.error.numpy(), np.where(errs, 0.5, 1) * x.numpy())
    np.testing.assert_array_equal(told.clearance.numpy(), 2 * x.numpy())


def test_a_model_that_hides_an_array_is_refused_not_recorded():
    """What is not found would stay as it was when its kernel was recorded."""
    hidden = {"array": dr.opaque(mi.Float, 2.0)}  # a dict is not among what models are made of

    def model(receivers: Receivers) -> Factor:
        return Factor(hidden["array"] * mi.Float(receivers.p.x), mi.Float(0), mi.Float(0), mi.Float(0))

    point = Receivers(mi.Point3d(1, 2, 3), mi.Vector3f(0, 0, 1), mi.Bool(True))
    with pytest.raises(RuntimeError):
        frozen(model)(point)


GARBAGE = """
import gc
import numpy as np
import grimaldi
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.boundary import _Bodies

listed = _Bodies.listed
def littering(self, *given):
    for _ in range(300):
        ring = [types(double=False).buffer(np.arange(1000.0))]
        ring.append(ring)
    return listed(self, *given)
_Bodies.listed = littering
gc.set_threshold(5)
grimaldi.render("creature", wavelength=4.0, size=(16, 16), spp=8, tolerance=0.1)
"""


def test_what_python_collects_does_not_end_a_recording():
    """Dr.Jit ends the process where NumPy's memory is given back while it records."""
    done = subprocess.run([sys.executable, "-c", GARBAGE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# ---------------------------------------------------------------- cells of the film


def waves(x: Any, y: Any) -> Nodes:
    """A known M: fringes that become finer to the right, seen on two surfaces that meet at x = 70."""
    real, imag = 1 + 0.3 * dr.cos(0.004 * x * x), 0.3 * dr.sin(0.004 * x * x + 0.02 * y)
    shape = dr.select(x < 70, mi.UInt32(1), mi.UInt32(2))
    return Nodes(real, imag, mi.Float(0), 100 + 0 * x, shape, mi.Float(dr.inf))


def on_one(real: Any, imag: Any = 0) -> Nodes:
    """Nodes that lie on one surface, far from all outlines."""
    zero = 0 * real
    return Nodes(real, zero + imag, zero, 100 + zero, mi.UInt32(1) + mi.UInt32(zero), mi.Float(dr.inf))


def only(missed: float) -> Shares:
    """Nothing is left to rays; light beside makes errors count as much in the dark."""
    return Shares(missed, np.inf, 0.0, 1.0)


def test_cells_keep_their_share_and_do_not_reach_over_edges():
    share = 5e-3
    film = cells(waves, 96, 0, 64, 2, only(share))
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
        return on_one(real)

    film = cells(fine_to_the_right, 64, 0, 64, 2, only(1e-5))
    assert asked == [(2 * 64 // LARGEST + 1) ** 2, (64 // LARGEST) ** 2 // 2]  # nodes; once more in cells that serve
    assert ((film.size.numpy().reshape(64, 64) > 0) == (np.arange(64) < 32)).all()


def test_a_part_of_the_film_has_the_cells_of_the_whole():
    whole, part = cells(waves, 96, 0, 3 * ROWS, 2, only(5e-3)), cells(waves, 96, ROWS, ROWS, 2, only(5e-3))
    own = slice(ROWS * 96, 2 * ROWS * 96)
    np.testing.assert_array_equal(part.size.numpy(), whole.size.numpy()[own])
    np.testing.assert_array_equal(part.cubic.numpy(), whole.cubic.numpy()[own])
    assert part.cubic.numpy().any()


def test_cubics_go_through_what_is_cubic_and_say_how_far_quadratics_are_off():
    """A lattice of nodes of M = x³ - y³ + i(x² y): cubics tell it exactly."""

    def exact(x: Any, y: Any) -> tuple[Any, Any]:
        return (x**3 - y**3) * 1e-2, x * x * y * 1e-2

    def nodes(x: Any, y: Any) -> Nodes:
        return on_one(*exact(x, y))

    film = cells(nodes, 16, 0, 16, 1, only(2e-2))
    sizes, by_cubics = film.size.numpy().reshape(16, 16), film.cubic.numpy().reshape(16, 16)
    assert by_cubics.any()
    assert not by_cubics[0].any()  # there is nothing above the first row
    rng = np.random.default_rng(0)
    x, y = mi.Float(rng.uniform(0, 16, 4000)), mi.Float(rng.uniform(0, 16, 4000))
    known = film.at(x, y, 100 + 0 * x, mi.UInt32(1), mi.Bool(True))
    real, imag = exact(x, y)
    off = np.hypot((known.real - real).numpy(), (known.imag - imag).numpy())
    pixel = y.numpy().astype(int), x.numpy().astype(int)
    told = known.holds.numpy() & by_cubics[pixel]
    assert off[told].max() < 1e-4  # of values up to 40, in Float32
    # M's third difference along rows and columns is 6 s³, and a quadratic's largest error 0.064 times that
    s = 0.5 * sizes[by_cubics].astype(float)
    apart = film.error.numpy().reshape(16, 16)[by_cubics]
    np.testing.assert_allclose(apart, 0.064 * np.sqrt(2) * 6e-2 * s**3, rtol=2e-2)


def test_where_waves_are_faint_pictures_show_what_rays_find():
    """Fringes too fine for any cell: of |M - 1| = 0.01 on the left, which is as good as 1, and 0.05 on the right."""

    def faint(x: Any, y: Any) -> Nodes:
        size = dr.select(x < 32, 0.01, 0.05)
        return on_one(1 + size * dr.cos(9 * x + 7 * y), size * dr.sin(9 * x + 7 * y))

    film = cells(faint, 64, 0, 64, 1, Shares(1e-4, np.inf, 0.02))
    sizes = film.size.numpy().reshape(64, 64)
    assert (sizes[:, :16] == LARGEST).all()
    assert (sizes[:, 32:] == 0).all()
    x, y = mi.Float(np.linspace(0, 15.9, 40)), mi.Float(np.linspace(0, 60, 40))
    known = film.at(x, y, 100 + 0 * x, mi.UInt32(1), mi.Bool(True))
    assert known.holds.numpy().all()
    assert (known.real.numpy() == 1).all()
    assert (known.imag.numpy() == 0).all()
    assert (abs(known.error.numpy() - 0.01) < 1e-5).all()


def test_errors_of_interpolation_count_by_the_light_that_they_change():
    """A bend of M in the dark that would be too much in the light, or where other light adds to it."""

    def dark(x: Any, y: Any) -> Nodes:
        u = x / 16 - dr.floor(x / 16)
        return on_one(0.01 * dr.sin(np.pi * u))

    def sizes(most: float, beside: float) -> NDArray[np.uint32]:
        return cells(dark, 64, 0, 64, 1, Shares(1e-3, most, 0.0, beside)).size.numpy()

    assert sizes(np.inf, 0.0).min() == LARGEST > sizes(np.inf, 1.0).max()
    assert sizes(1e-3, 0.0).max() < LARGEST  # whatever the light


def test_fringes_as_wide_as_nodes_are_apart_are_noticed():
    """M is 1 at all nodes of a cell 4 pixels across, and of those around, and 0.8 between."""

    def between_nodes(x: Any, y: Any) -> Nodes:
        return on_one(0.9 + 0.1 * dr.cos(np.pi * y))

    assert cells(between_nodes, 64, 0, 64, 2, only(1e-3)).size.numpy().max() == 0


def test_pixels_where_shapes_meet_take_m_from_nodes_on_the_same():
    """M is 1 on one side of an edge through pixels and 0.5 on the other; on a third shape there is none."""

    def two(x: Any, y: Any) -> Nodes:
        left = x + 0.3 * y < 32.2
        shape = dr.select(left, mi.UInt32(1), mi.UInt32(2))
        return Nodes(dr.select(left, 1.0, 0.5), 0 * x, 0 * x, dr.select(left, 100.0, 200.0), shape, mi.Float(dr.inf))

    film = cells(two, 64, 0, 64, 1, only(1e-3))
    assert film.unknown == 0
    assert 64 < (film.size.numpy() == 0).sum() < 3 * 64
    rng = np.random.default_rng(0)
    x, y = mi.Float(rng.uniform(0, 64, 20_000)), mi.Float(rng.uniform(0, 64, 20_000))
    exact = two(x, y)
    there = ~film.at(x, y, exact.distance, exact.shape, mi.Bool(True)).holds
    known = film.beside(x, y, exact.distance, exact.shape, there)
    holds = known.holds.numpy()
    assert holds.sum() > 200
    assert there.numpy().sum() - holds.sum() < 0.2 * holds.sum()  # a corner without a node of its own
    assert abs(known.real.numpy() - exact.real.numpy())[holds].max() < 1e-6
    assert not film.beside(x, y, exact.distance, mi.UInt32(3), there).holds.numpy().any()


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


def test_samples_that_cells_do_not_tell_are_asked_for(monkeypatch):
    """The model is no part of the kernel that shades; where that lacks M, it is asked after all."""
    given = {"wavelength": 4.0, "size": (32, 32), "spp": 8, "tolerance": 1e-3}
    usual = grimaldi.render("creature", **given)
    at = Samples.at

    def nowhere(*where: Any) -> Any:
        return at(*where)._replace(holds=mi.Bool(False))

    monkeypatch.setattr(Samples, "at", nowhere)
    asked = grimaldi.render("creature", **given)
    assert asked.attrs["non_finite"] == 0
    assert abs(asked.U - usual.U).max() < given["tolerance"]
