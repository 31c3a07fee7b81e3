"""The boundary diffraction wave: Kirchhoff's integral as a line integral along the outlines (THEORY eq. 4-6).

Maggi 1888, Rubinowicz 1917, Miyamoto & Wolf 1962; non-singular after A. Barnett, JATIS 7(2) 021211. A segment's
wave is `segment.segment_wave`, the sums over outlines are in `edges`.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from grimaldi.diffraction import none
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.edges import Sum, body_sum, lit_share, planar_sum
from grimaldi.diffraction.frame import frame
from grimaldi.diffraction.grazing import Chords, chords, near
from grimaldi.diffraction.model import Evaluate, Factor, Options, Receivers
from grimaldi.diffraction.occlusion import rays
from grimaldi.diffraction.screen import beyond
from grimaldi.diffraction.segment import Rule
from grimaldi.diffraction.table import Table, needs_double, table
from grimaldi.outlines.model import Outline
from grimaldi.outlines.silhouettes import loops, same_loop, silhouettes
from grimaldi.scene.model import Scene, Source

HIDDEN_END = 0.5  # of the tolerance: what an untested X→P may at most leave behind


def boundary(scene: Scene, source: Source, outline: Outline, k: float, options: Options) -> Evaluate:
    """The `boundary` model for one source: M by eq. 4 behind holes, by eq. 5 past bodies and masks.

    Raises InputError in variants without vectorised arrays.
    """
    if len(outline) == 0:
        return none.none(scene, source, outline, k, options)
    arrays = types(needs_double(outline, k, options))
    rule = Rule.of(options.tolerance)
    if scene.screen:
        return _planar(scene, source, table(outline, arrays), k, rule)
    if options.occlusion != "graded":
        return _bodies(scene, source, table(outline, arrays), None, outline.sag, k, rule, options)
    whole = silhouettes(scene, source)
    loop = loops(whole)
    tab = table(outline, arrays, loop=same_loop(outline, whole, loop))
    return _bodies(scene, source, tab, chords(whole, loop, tab.centre, arrays), outline.sag, k, rule, options)


def _factor(tab: Table, rule: Rule, geometric: Any, sign: int, sums: Sum) -> Factor:
    """M = geometric ± (1/2π) sum, and what is known of its error: series, panels, rounding."""
    scale = sign / (2 * np.pi)
    rounding = 2e-15 if dr.itemsize_v(tab.types.Float) == 8 else 5e-7
    series = dr.sqrt(sums.err_real * sums.err_real + sums.err_imag * sums.err_imag) / np.pi
    return Factor(geometric + scale * sums.real, scale * sums.imag, series + (rule.share + rounding))


def _planar(scene: Scene, source: Source, tab: Table, k: float, rule: Rule) -> Evaluate:
    """Coplanar holes in a screen, or masks; M = 1 on the source's own side."""
    hole = scene.screen[0].hole
    far = beyond(scene.screen[0], source)

    def evaluate(receivers: Receivers) -> Factor:
        shaded = receivers.active & far(receivers.p)
        fr = frame(source, receivers.p, tab)
        sums, n = planar_sum(fr, tab, k, rule, shaded)
        m = _factor(tab, rule, n, -1, sums) if hole else _factor(tab, rule, 1 - n, 1, sums)
        return Factor(dr.select(shaded, m.real, 1), dr.select(shaded, m.imag, 0), dr.select(shaded, m.error, 0))

    return evaluate


def _bodies(
    scene: Scene,
    source: Source,
    tab: Table,
    grazing: Chords | None,
    sag: float,
    k: float,
    rule: Rule,
    options: Options,
) -> Evaluate:
    probe = rays(scene, source, sag)

    def evaluate(receivers: Receivers) -> Factor:
        fr = frame(source, receivers.p, tab)
        sums, nearest = body_sum(
            fr,
            tab,
            k,
            rule,
            HIDDEN_END * options.tolerance,
            probe if options.occlusion != "none" else None,
            None if grazing is None else near(fr, grazing, k, receivers),
            options.rim == "smooth",
            receivers,
        )
        return _factor(tab, rule, lit_share(fr, tab, nearest, probe, receivers), 1, sums)

    return evaluate
