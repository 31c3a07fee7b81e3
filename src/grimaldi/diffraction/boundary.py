"""The boundary diffraction wave: Kirchhoff's integral as a line integral along the outlines (THEORY eq. 4-6).

Maggi 1888, Rubinowicz 1917, Miyamoto & Wolf 1962; non-singular after A. Barnett, JATIS 7(2) 021211. A segment's
wave is `segment.segment_wave`, that of neighbours `chains.chain_wave`; the sums over outlines are in `edges`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction import none
from grimaldi.diffraction.arrays import Types, mixed, types
from grimaldi.diffraction.chains import chain_wave, exact
from grimaldi.diffraction.curves import curve_error
from grimaldi.diffraction.edges import (
    Everywhere,
    Margins,
    Nearest,
    Sum,
    Walk,
    body_sum,
    lit_share,
    planar_sum,
    sounds,
)
from grimaldi.diffraction.frame import Frame, frame
from grimaldi.diffraction.grazing import Near, chords, near
from grimaldi.diffraction.hierarchy import least_detour
from grimaldi.diffraction.listing import lists
from grimaldi.diffraction.lists import Listed, Lists, listed_sum
from grimaldi.diffraction.marks import Marks, marks
from grimaldi.diffraction.model import OUTSIDE, Blocks, Evaluate, Factor, Grouped, Options, Receivers
from grimaldi.diffraction.occlusion import Rays, rays
from grimaldi.diffraction.screen import beyond
from grimaldi.diffraction.search import Search
from grimaldi.diffraction.segment import Rule
from grimaldi.diffraction.table import Packed, Table, may_be_single, needs_double, packed
from grimaldi.outlines.model import Outline
from grimaldi.outlines.silhouettes import silhouettes
from grimaldi.scene.model import Scene, Source
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

AS_ONE = 4.0  # rad at a tolerance of 1: half of what a run of pieces subtends that is tested by one ray X→P
LOOSE = 5e-3  # tolerance from which on blocks have lists: thin shadows that they miss are steps in M of some percent
MARKED = 300  # pieces from which on marks of faint ones pay
BESIDE = 1e-2  # what rounding shifts an edge by over the way to it, up to which a corner there makes no difference
UNASKED = 0.3  # of the tolerance: what all pieces whose X→P goes untested may add to M, each the same


class Problem(NamedTuple):
    """One source's light and how finely it is asked, shared by both precisions."""

    scene: Scene
    source: Source
    outline: Outline
    k: float
    options: Options
    packed: Packed  # the outline
    grazed: Outline | None  # all silhouettes, for occlusion "graded"

    def rule(self) -> Rule:
        """For segments, with what the polygons of curves leave as part of its share."""
        rule = Rule.of(self.options.tolerance)
        return rule._replace(share=rule.share + curve_error(self.scene, self.outline, self.k))

    @property
    def listed(self) -> bool:
        """Whether ends of runs, and what a few rays tell of a block, are enough for lists."""
        return self.options.rim != "smooth" and self.options.tolerance >= LOOSE


def boundary(scene: Scene, source: Source, outline: Outline, k: float, options: Options) -> Evaluate:
    """The `boundary` model for one source: M by eq. 4 behind holes, by eq. 5 past bodies and masks.

    Where Float32 sums may serve, they are done first; receivers whose estimated error is above the tolerance, as
    beside an edge, are done again in Float64. Where Float32 is too coarse for phases alone, these are Float64.

    Raises InputError in variants without vectorised arrays.
    """
    if len(outline) == 0:
        if scene.screen or scene.blockers is None:
            return none.none(scene, source, outline, k, options)
        return _rays_alone(scene, source)
    graded = options.occlusion == "graded" and not scene.screen
    grazed = silhouettes(scene, source) if graded else None
    problem = Problem(scene, source, outline, k, options, packed(outline, source), grazed)
    of_kind = _planar if scene.screen else _bodies
    if not needs_double(outline, k, options):
        single, double = (of_kind(problem, types(double)) for double in (False, True))
        return _Either(single, double, options.tolerance)
    phases_alone = may_be_single(options) and not scene.screen and not problem.listed
    return of_kind(problem, mixed() if phases_alone else types(double=True))


class _Either(NamedTuple):
    """Float32 first, and Float64 where that is not within the tolerance."""

    single: Evaluate
    double: Evaluate
    tolerance: float

    def __call__(self, receivers: Receivers) -> Factor:
        return _in_either(self.single, self.double, self.tolerance, receivers)

    @property
    def items(self) -> int:
        """As of Float32."""
        return self.single.items if isinstance(self.single, Grouped) else 0

    @property
    def inside_only(self) -> bool:
        """As of Float32."""
        return isinstance(self.single, Grouped) and self.single.inside_only

    def among(self, blocks: Blocks) -> Evaluate:
        """Both by what Float32 tells of the blocks."""
        assert isinstance(self.single, _Bodies)
        assert isinstance(self.double, _Bodies)
        found = self.single.known(blocks)
        return self._replace(single=self.single.by(found), double=self.double.by(found))


@syntax
def _in_either(single: Evaluate, double: Evaluate, tolerance: float, receivers: Receivers) -> Factor:
    F = types(double=True).Float
    m = single(receivers)
    real, imag, error, clearance = F(m.real), F(m.imag), F(m.error), F(m.clearance)
    again = receivers.active & (error > tolerance)
    if again:
        finer = double(receivers._replace(active=again))
        real, imag, error = F(finer.real), F(finer.imag), F(finer.error)
    return Factor(real, imag, error, clearance)


def _factor(
    tab: Table, rule: Rule, fr: Frame, k: float, margins: Margins, geometric: Any, sign: int, sums: Sum
) -> Factor:
    """M = geometric ± (1/2π) sum, and what is known of its error: tails, panels, rounding."""
    scale = sign / (2 * np.pi)
    tails = dr.sqrt(sums.err_real * sums.err_real + sums.err_imag * sums.err_imag) / np.pi
    error = tails + sums.unasked + dr.sqrt(sums.rounding2) / np.pi + (rule.share + _rounding(tab, fr, k, margins))
    return Factor(geometric + scale * sums.real, scale * sums.imag, error, dr.sqrt(margins.ray2))


def _rounding(tab: Table, fr: Frame, k: float, margins: Margins) -> Any:
    """What rounded coordinates do to M.

    They shift edges: M changes by as much as over that way across the rim (eq. 8), or, a few λ from S or P, by the
    angle that it subtends there. Beside a corner in Float32 the edges that meet there disagree by up to the shift over
    the way to it.
    """
    F = tab.types.Float
    of_edges = tab.types.precise.Float
    shift = dr.epsilon(of_edges) * (10 * fr.lever + tab.device(tab.reach))
    near = dr.rsqrt(dr.maximum(margins.receiver2, 1e-30)) + dr.rcp(tab.device(tab.from_source))
    error = 4 * dr.epsilon(F) + 2 * shift * (dr.sqrt(near * tab.device(k / (2 * np.pi))) + near / np.pi)
    if dr.itemsize_v(of_edges) == 8:
        return error
    corner = dr.minimum(shift * dr.rsqrt(margins.ray2), 1)
    return dr.select(corner > BESIDE, dr.maximum(error, corner), error)


def _planar(problem: Problem, precision: Types) -> Evaluate:
    """Coplanar holes in a screen, or masks; M = 1 on the source's own side."""
    screen, source = problem.scene.screen[0], problem.source
    tab = problem.packed.on(precision)
    rule, k = problem.rule(), problem.k
    far = beyond(screen, source)

    def evaluate(receivers: Receivers) -> Factor:
        shaded = receivers.active & far(receivers.p)
        fr = frame(source, receivers.p, tab, screen)
        sums, n, margins = planar_sum(fr, tab, tab.device(k), rule, shaded)
        geometric, sign = (n, -1) if screen.hole else (1 - n, 1)
        m = _factor(tab, rule, fr, k, margins, geometric, sign, sums)
        return Factor(
            dr.select(shaded, m.real, 1), dr.select(shaded, m.imag, 0), dr.select(shaded, m.error, 0), m.clearance
        )

    return evaluate


def _rays_alone(scene: Scene, source: Source) -> Evaluate:
    """Bodies without an outline, such as an empty room: the same shadow rays, which serve in its corners too."""
    probe = rays(scene, source)

    def evaluate(receivers: Receivers) -> Factor:
        p = mi.Point3f(receivers.p)
        lit = probe.lit(p + probe.epsilon(p) * receivers.n, receivers.active)
        zero = types(double=False).Float(0)
        return Factor(dr.select(lit, 1.0, zero), zero, zero)

    return evaluate


def unoccluded(problem: Problem, precision: Types) -> tuple[int, Callable[[Any, Any], tuple[Any, Any, Any]]]:
    """The number of pieces of the outlines of bodies, and a function of points in free space and pieces i.

    It gives Δ at the piece's middle, and (1/2π) ∫ C e^{ikΔ} dφ along it (real, imaginary), nothing in between.
    """
    tab = problem.packed.on(precision)
    rule, k = problem.rule(), tab.device(problem.k)

    def evaluate(p: Any, i: Any) -> tuple[Any, Any, Any]:
        fr = frame(problem.source, p, tab)
        piece = tab.piece(i)
        acts = sounds(fr, piece, dr.zeros(precision.Vector, dr.width(p)))
        wave = chain_wave(fr, tab, piece.first, piece.end, k, rule, acts).wave
        scale = dr.select(acts, 0.5 / np.pi, 0)
        return least_detour(fr, piece.middle, 0), scale * wave.real, scale * wave.imag

    return int(tab.n_pieces[0]), evaluate


def _bodies(problem: Problem, precision: Types) -> Grouped:
    return _Bodies(problem, precision)


class _Bodies:
    """Past bodies: of all pieces, or of those on the lists of the receivers' blocks."""

    def __init__(self, problem: Problem, precision: Types) -> None:
        scene, source, outline, _, options, _, grazed = problem
        tolerance = options.tolerance
        self.problem = problem
        self.rule = problem.rule()
        if options.rim == "smooth":
            self.rule = self.rule._replace(corners=None, damped=True)
        self.rays = rays(scene, source, outline.sag)
        self.tab = problem.packed.on(precision, AS_ONE * tolerance, problem.k)
        self.k = self.tab.device(problem.k)
        self.share = UNASKED * tolerance / int(self.tab.n_pieces[0])
        self.grazing = None if grazed is None else chords(grazed, self.tab.centre, precision)

    def __call__(self, receivers: Receivers) -> Factor:
        """By all pieces."""
        return self._by_all(Everywhere(self.tab, self.share), receivers)

    def _by_all(self, walk: Everywhere, receivers: Receivers) -> Factor:
        fr = frame(self.problem.source, receivers.p, self.tab)
        beside = None if self.grazing is None else near(fr, self.grazing, self.k, receivers)
        return self._factor(fr, receivers, self._sum(fr, walk, beside, receivers))

    def _by_marks(self, found: Marks, receivers: Receivers) -> Factor:
        """By all pieces, faint ones as far as the marks of the receivers' blocks say."""
        return self._by_all(Everywhere(self.tab, self.share, found.at(receivers)), receivers)

    def _by_lists(self, found: Lists, receivers: Receivers) -> Factor:
        """By the lists of the receivers' blocks."""
        receivers = receivers._replace(active=receivers.active & (receivers.block != OUTSIDE))
        fr = frame(self.problem.source, receivers.p, self.tab)
        beside = found.near(receivers, self.grazing)
        asked = self._sum(fr, Listed(found, self.tab, receivers), beside, receivers)
        return self._factor(fr, receivers, listed_sum(fr, found, self.tab, self.k, self.rule, asked, receivers))

    def _sum(self, fr: Frame, walk: Walk, beside: Near | None, receivers: Receivers) -> tuple[Sum, Nearest, Margins]:
        options = self.problem.options
        return body_sum(fr, self.tab, walk, self.k, self.rule, options.tolerance, self.probe, beside, receivers)

    def _factor(self, fr: Frame, receivers: Receivers, found: tuple[Sum, Nearest, Margins]) -> Factor:
        sums, nearest, margins = found
        lit = lit_share(*exact(fr, self.tab)[:2], nearest, self.rays, receivers)
        return _factor(self.tab, self.rule, fr, self.problem.k, margins, lit, 1, sums)

    @property
    def items(self) -> int:
        """The number of pieces, or of marks of them and of runs; 0 where blocks are of no use."""
        pieces = int(self.tab.n_pieces[0])
        if self.problem.listed:
            return pieces
        return dr.width(self.tab.ranges) if self.probe is not None and pieces >= MARKED else 0

    @property
    def inside_only(self) -> bool:
        """Whether it lists what acts on blocks."""
        return self.problem.listed

    @property
    def probe(self) -> Rays | None:
        """What blocks X→P."""
        return self.rays if self.problem.options.occlusion != "none" else None

    def among(self, blocks: Blocks) -> Evaluate:
        """By what is known of blocks."""
        return self.by(self.known(blocks))

    def known(self, blocks: Blocks) -> Lists | Marks:
        """What acts on each block, or which faint pieces reach it."""
        source, tolerance = self.problem.source, self.problem.options.tolerance
        search = Search(source, self.tab, self.k, self.rule, tolerance, self.share, self.probe, self.grazing)
        return lists(search, blocks) if self.problem.listed else marks(search, blocks)

    def by(self, found: Lists | Marks) -> Evaluate:
        """M of receivers in blocks, by what is known of these."""
        return partial(self._by_lists if isinstance(found, Lists) else self._by_marks, found)
