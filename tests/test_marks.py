"""Marks of faint pieces in pictures at strict tolerances, against rays X→P at every receiver."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba
import numpy as np
from floor import Floor

from grimaldi.diffraction import marks as marking
from grimaldi.diffraction.boundary import _Bodies
from grimaldi.diffraction.frame import constant
from grimaldi.diffraction.model import LATTICE, Receivers
from grimaldi.scene.builtin import creature

mi: Any = mitsuba
mi.set_variant("llvm_ad_rgb")

PLACES = np.random.default_rng(1).uniform(0, 64, (2, 4000))


def bodies(floor: Floor) -> _Bodies:
    factor: Any = floor.light.beams[0].factor
    assert isinstance(factor, _Bodies)
    return factor


def test_marks_change_m_by_less_than_the_tolerance():
    tolerance = 1e-3
    floor = Floor(tolerance, "graded")
    assert bodies(floor).items > 0
    fast, whole = floor.both(floor.film, *PLACES)
    off = abs(fast - whole)
    assert abs(whole - 1).max() > 0.5
    assert np.quantile(off, 0.99) < 0.25 * tolerance
    assert 0 < off.max() < 4 * tolerance  # thin shadows


def test_most_is_known_of_faint_pieces_and_nothing_of_others():
    floor = Floor(1e-3, "graded", other=creature.build())
    found = bodies(floor).known(floor.film.blocks)
    assert isinstance(found, marking.Marks)
    x, y = (mi.Float(v[:200].astype(np.float32)) for v in PLACES)
    placed = floor.film.placed(x, y, floor.sight(x, y).receivers)
    items = int(found.items[0])
    index = dr.arange(mi.UInt32, 200 * items)
    marked, item = found.at(placed.some(index // items)), index % items
    blocked, free = (known.numpy() for known in marked.reach(item, mi.Float(0)))
    assert not (blocked & free).any()
    assert free.mean() > 0.2
    assert blocked.mean() > 0.1
    assert not any(known.numpy().any() for known in marked.reach(item, mi.Float(1e-4)))


def test_a_corner_is_marked_by_the_ray_from_it():
    """On flat blocks and curved ones; corners on other surfaces, and strong pieces, are not marked."""
    floor = Floor(1e-3, "graded", other=creature.build())
    factor, blocks = bodies(floor), floor.film.blocks
    found = factor.known(blocks)
    assert isinstance(found, marking.Marks)
    items = int(found.items[0])
    words = found.corners.numpy().reshape(-1, items, 2)
    hidden, reached = words[..., 0], words[..., 1]
    assert not (hidden & reached).any()
    members = np.where(blocks.active.numpy(), blocks.members.numpy(), 0)
    assert not ((hidden | reached) & ~members[:, None]).any()
    block, item = np.nonzero(hidden | reached)
    some = np.random.default_rng(0).choice(len(block), 3000)
    block, item = block[some], item[some]
    corner = np.array([(v & -v).bit_length() - 1 for v in (hidden | reached)[block, item].tolist()])
    at = mi.UInt32(block * LATTICE**2 + corner)
    lattice = Receivers(blocks.lattice, blocks.normals, mi.Bool(True)).some(at)
    whole = factor.tab.types.phases
    assert whole is not None
    piece = factor.problem.packed.on(whole).piece(mi.UInt32(item))
    x = mi.Point3f(piece.middle + constant(whole.Vector, factor.tab.centre))
    p = mi.Point3f(lattice.p)
    free = factor.rays.reaches(x, piece, p + factor.rays.epsilon(p) * lattice.n, mi.Bool(True)).numpy()
    assert 0.05 < free.mean() < 0.95
    assert (free == ((reached[block, item] >> corner) & 1)).mean() > 0.999
