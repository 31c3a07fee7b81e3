"""Secondary point sources along silhouette edges, as in the report that Grimaldi began with (THEORY 4).

D. Johnston, P. Tarjan, "Ray-tracing Interference and Diffraction", Stanford CS348b, 2006. Each source X sends
w U0(X) e^{iks}/s, asked of a visibility ray X→P and added to the light that arrives by rays: the cost is that of as
many lamps. The weights w decide what the sum converges to:

    report   the body's outline over the number of its sources, for all alike: brighter where a mesh is finer
    length   the length that a source stands for: ∮ U0 e^{iks}/s dl, which is not Kirchhoff's field
    kernel   -C dφ r s/(2πR) at a hole, its opposite at a body: `boundary`, to second order in the spacing
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from grimaldi.diffraction import none
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.chains import closest
from grimaldi.diffraction.curves import curve_error
from grimaldi.diffraction.edges import Nearest, lit_share, planar_count, sounds
from grimaldi.diffraction.frame import Frame, constant, frame
from grimaldi.diffraction.model import NYQUIST, Evaluate, Factor, Options, Receivers
from grimaldi.diffraction.occlusion import Rays, rays
from grimaldi.diffraction.screen import beyond
from grimaldi.diffraction.segment import Line, detour, line
from grimaldi.diffraction.sines import sincos
from grimaldi.diffraction.table import Segment, Table, needs_double, packed
from grimaldi.errors import InputError
from grimaldi.outlines.divided import divided, joined
from grimaldi.outlines.model import Integers, Outline, Reals
from grimaldi.outlines.offset_test import offset_outline
from grimaldi.scene.model import Scene, Source
from grimaldi.syntax import syntax

DEFAULT = 3  # sources an edge, as in the report's figure 5
MOST = 10_000_000  # sources: 1.5 GB of them

Weight = Callable[[Frame, Segment, Line, Any, Any, Any, Any], Any]
"""w R/(r s) of the source in the middle of a segment, from frame, segment, line, C, 1/r, 1/s and its own length."""


class Lamps(NamedTuple):
    """Secondary sources, one in the middle of each segment, and the length (n,) that each stands for."""

    table: Table
    lengths: Any
    weight: Weight


class Sum(NamedTuple):
    """Σ w R/(r s) e^{ikΔ}, and how far it would move if each source were spread over its length."""

    real: Any
    imag: Any
    open: Any


def huygens(scene: Scene, source: Source, outline: Outline, k: float, options: Options) -> Evaluate:
    """The `huygens` model: options.n sources an edge, or under half a wavelength apart, with options.weights.

    The weights "report" and "length" act forward only (P - X along the light at X) and are added to Mitsuba's
    shadow ray; "report" finds the silhouettes by its own test (`outlines.offset_test`), and gives every body's
    sources one strength. The error is twice what averaging e^{ikΔ} over the length of each source, Δ taken as
    linear there, would change, and falls as 1/n². Of "kernel" it tells the distance from `boundary`, no less than
    which it is at about five points in six; of "report" and "length" only that from their own sums over more
    sources, not from nature. Where sources stand further apart than a wavelength it is a guess.

    Raises InputError for the weights "report" with apertures or planar masks, and for more than 1e7 sources.
    """
    if options.weights == "report":
        if scene.screen:
            raise InputError("weights: 'report' finds silhouettes of bodies, not apertures; use 'length' or 'kernel'")
        outline = offset_outline(scene, source, options.epsilon)
    else:
        outline = joined(outline)
    geometric = none.none(scene, source, outline, k, options)
    if len(outline) == 0:
        return geometric
    sources = divided(outline, _parts(outline, k, options))
    tab = packed(sources, source, np.arange(len(sources) + 1)).on(types(needs_double(outline, k, options)))
    lengths = np.linalg.norm(sources.end - sources.start, axis=1)
    if options.weights == "report":
        lengths = _shared(lengths, sources.body)
    lamps = Lamps(tab, tab.types.Float(lengths), _kernel if options.weights == "kernel" else _forward)
    rounding = 2e-15 if dr.itemsize_v(tab.types.Float) == 8 else 5e-7
    floor = rounding + curve_error(scene, outline, k)
    if scene.screen:
        return _planar(scene, source, lamps, k, floor, geometric)
    return _bodies(scene, source, lamps, sources.sag, k, floor, options.occlusion != "none", geometric)


def _parts(outline: Outline, k: float, options: Options) -> np.ndarray:
    """How many sources each segment gets: of a partly lit edge its share."""
    length = np.linalg.norm(outline.end - outline.start, axis=1)
    if options.n == NYQUIST:
        parts, advice = np.floor(length * k / np.pi) + 1, "give a number an edge, or a longer wavelength"
    else:
        parts = np.ceil(np.ptp(outline.interval, axis=1) * (options.n or DEFAULT) - 1e-9)
        advice = "give a smaller number an edge"
    if (total := parts.sum()) > MOST:
        raise InputError(f"n: {options.n!r} makes {total:.3g} sources, more than {MOST:.0e}; {advice}")
    return parts.astype(np.int64)


def _shared(lengths: Reals, body: Integers) -> Reals:
    """Each body's length shared out evenly among its sources."""
    index, which = np.unique(body, return_inverse=True)
    count = np.bincount(which, minlength=len(index))
    return (np.bincount(which, lengths) / count)[which]


def _forward(fr: Frame, seg: Segment, ln: Line, C: Any, inv_r: Any, inv_s: Any, w: Any) -> Any:
    """The length w, into the half space ahead."""
    spread = w * inv_s if fr.plane else w * (fr.z1 + fr.z2) * inv_r * inv_s
    return dr.select(C > 0.5, spread, 0)


def _kernel(fr: Frame, seg: Segment, ln: Line, C: Any, inv_r: Any, inv_s: Any, w: Any) -> Any:
    """C dφ/2π, dφ exact over the segment; its sign is κ's, from which n is counted too."""
    q1 = ln.q0 + seg.length * (seg.e - ln.ea * fr.a)
    return C * dr.atan2(ln.kappa * seg.length, dr.dot(ln.q0, q1)) / (2 * np.pi)


def _planar(scene: Scene, source: Source, lamps: Lamps, k: float, floor: float, geometric: Evaluate) -> Evaluate:
    """Coplanar holes in a screen, or masks; M = 1 on the source's own side."""
    hole = scene.screen[0].hole
    far = beyond(scene.screen[0], source)
    sign = -1 if hole and lamps.weight is _kernel else 1

    def evaluate(receivers: Receivers) -> Factor:
        shaded = receivers.active & far(receivers.p)
        fr = frame(source, receivers.p, lamps.table)
        # the screen is all that there is: no surface has a horizon
        sums, _ = source_sum(fr, lamps, k, None, Receivers(receivers.p, 0 * receivers.n, shaded))
        if lamps.weight is not _kernel:
            return _factor(geometric(receivers).real, sign, sums, floor)
        n = planar_count(fr, lamps.table, shaded)  # by the κ of the same segments, so that the rim shows no jump
        return _factor(dr.select(shaded, n if hole else 1 - n, 1), sign, sums, floor)

    return evaluate


def _bodies(
    scene: Scene, source: Source, lamps: Lamps, sag: float, k: float, floor: float, occlusion: bool, geometric: Evaluate
) -> Evaluate:
    probe = rays(scene, source, sag)

    def evaluate(receivers: Receivers) -> Factor:
        fr = frame(source, receivers.p, lamps.table)
        sums, nearest = source_sum(fr, lamps, k, probe if occlusion else None, receivers)
        if lamps.weight is _kernel:
            return _factor(lit_share(fr, lamps.table, nearest, probe, receivers), 1, sums, floor)
        return _factor(geometric(receivers).real, 1, sums, floor)

    return evaluate


def _factor(geometric: Any, sign: int, sums: Sum, floor: float) -> Factor:
    F = type(sums.real)
    return Factor(F(geometric) + sign * sums.real, sign * sums.imag, 2 * sums.open + floor)


def _spread(fr: Frame, ln: Line, t: Any, k: float, inv_r: Any, inv_s: Any) -> Any:
    """1 - sin ψ/ψ for ψ = kΔ't, half the phase that turns along a source of length 2t."""
    b = ln.eqq * (t - ln.td)
    slope = (b - (fr.z2 - ln.h - t * ln.ea) * ln.ea) * inv_s
    slope += ln.ea if fr.plane else ((fr.z1 + ln.h + t * ln.ea) * ln.ea + b) * inv_r
    psi = k * slope * t
    return dr.select(dr.abs(psi) < 0.1, psi * psi / 6, 1 - sincos(psi)[0] / psi)


@syntax
def source_sum(fr: Frame, lamps: Lamps, k: float, probe: Rays | None, receivers: Receivers) -> tuple[Sum, Nearest]:
    """The sum over sources, each where it reaches the receiver."""
    tab = lamps.table
    F = tab.types.Float
    U = dr.uint32_array_t(F)
    n = tab.types.Vector(receivers.n)
    p = mi.Point3f(receivers.p)
    if dr.hint(probe is not None, mode="scalar"):
        assert probe is not None
        p = p + probe.epsilon(p) * receivers.n
    real, imag, open_real, open_imag = F(0), F(0), F(0), F(0)
    nearest2, nearest_segment = F(dr.inf), U(0)
    i = U(0)
    while receivers.active & (i < tab.size):
        piece = tab.piece(i)
        acts = sounds(fr, piece, n)
        if dr.hint(probe is not None, mode="scalar"):
            assert probe is not None
            if acts:
                x = mi.Point3f(piece.middle + constant(tab.types.Vector, tab.centre))
                acts = probe.reaches(x, piece, p, acts)
        if acts:
            seg = tab.segment(i)
            ln = line(fr, seg.X0, seg.e)
            t = 0.5 * seg.length
            delta, C, inv_r, inv_s = detour(fr, ln, t, ln.eqq * (dr.square(t - ln.td) + ln.w * ln.w))
            sin, cos = sincos(k * delta)
            w = lamps.weight(fr, seg, ln, C, inv_r, inv_s, dr.gather(F, lamps.lengths, i))
            real = dr.fma(w, cos, real)
            imag = dr.fma(w, sin, imag)
            left_open = w * _spread(fr, ln, t, k, inv_r, inv_s)
            open_real = dr.fma(left_open, cos, open_real)
            open_imag = dr.fma(left_open, sin, open_imag)
            d2 = closest(fr, seg, ln)
            closer = d2 < nearest2
            nearest2 = dr.select(closer, d2, nearest2)
            nearest_segment = dr.select(closer, i, nearest_segment)
        i += 1
    left = dr.sqrt(open_real * open_real + open_imag * open_imag)
    return Sum(real, imag, left), Nearest(nearest2, nearest_segment)
