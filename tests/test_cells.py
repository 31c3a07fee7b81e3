"""Cells of the film against samples: what is interpolated keeps its share of the tolerance."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba
import numpy as np
import pytest
from numpy.typing import NDArray

import grimaldi
from grimaldi.engine.cells import cells
from grimaldi.engine.judging import IN_PIXEL, Shares
from grimaldi.engine.nodes import LARGEST, ROWS, Nodes
from grimaldi.engine.tiles import Samples

mi: Any = mitsuba
mi.set_variant("llvm_ad_rgb")


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
        share = LARGEST / IN_PIXEL * 1e-3  # of which the largest cells have 1e-3
        return cells(dark, 64, 0, 64, 1, Shares(share, most, 0.0, beside)).size.numpy()

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
