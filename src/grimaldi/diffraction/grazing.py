"""What a wave loses on its way X→P where that grazes another silhouette: the edge wave's own diffraction.

Seen from X, a silhouette that stands between X and P is a knife edge at X₂. What passes it is the wave of X where X₂
does not hide it, plus the wave that X₂ sends on (J. B. Keller, J. Opt. Soc. Am. 52, 116 (1962), twice diffracted
rays; uniform here by Fresnel's integral in place of its asymptote):

    M₁₂ = V₁₂ M₁ ± M₁ E(v₂)/E(v₁) E(v₁₂) e^{iπv₁₂²/2},   + where X₂ hides X, - where it does not

M₁ is the wave from X at P; V₁₂ is 0 or 1; v₁₂ is Fresnel's parameter of the way X→P at X₂; v₁ and v₂ are those of X
for the directions X→P and X→X₂, both at P's distance; E is `knife_edge.amplitude`. The quotient turns the amplitude
that X sends towards P into the one that it sends towards X₂, so that the second term runs smoothly through the rim
of X's shadow and takes the step of V₁₂ away: there X₂ lies on X→P. It changes sign with the side of the light at X
that X₂ and P are on. Multiplying M₁ by 1 - E e^{iπv²/2} alone would leave a step in that rim.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from grimaldi.diffraction.arrays import Types
from grimaldi.diffraction.frame import HORIZON, Frame
from grimaldi.diffraction.hierarchy import NONE, Tree, flat, layout, least_detour
from grimaldi.diffraction.knife_edge import amplitude
from grimaldi.diffraction.model import Receivers
from grimaldi.diffraction.segment import line
from grimaldi.diffraction.sines import sincos
from grimaldi.diffraction.table import Piece, cut
from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Vector
from grimaldi.syntax import syntax

FEW = 64  # chords, that take no hierarchy
FAINT = 0.01  # |M| of a wave that is not worth a second edge
FAINTER = 0.2  # of the tolerance: likewise, at loose ones
WIDEST = 1 / (2**0.5 * np.pi * FAINT)  # Fresnel parameter beyond which E is fainter


class Chord(NamedTuple):
    """A few neighbouring segments as one."""

    start: Any
    e: Any
    length: Any
    body: Any
    outward: Any


class Chords(NamedTuple):
    """Whole silhouettes as flat device buffers, about the centre of the outlines' table."""

    records: Any
    tree: Tree
    types: Types

    def chord(self, i: Any) -> Chord:
        P, V = self.types.Packet, self.types.Vector
        a, b, c = (dr.gather(P, self.records, 3 * i + j) for j in range(3))
        return Chord(V(a.x, a.y, a.z), V(b.x, b.y, b.z), b.w, a.w, V(c.x, c.y, c.z))


class Passing(NamedTuple):
    """Where a way passes a chord: Fresnel's v² (infinite where it does not), the place on each, their distance²."""

    v2: Any
    t: Any
    along: Any
    distance2: Any


class Near(NamedTuple):
    """The two bodies whose silhouettes the ray S→P passes closest by, and v² there."""

    silhouettes: Chords
    body: Any
    v2: Any
    next_body: Any
    next_v2: Any

    def of(self, i: Any, active: Any, silhouettes: Chords) -> Near:
        """Those of some receivers, by their indices, in the precision of `silhouettes`."""
        F = silhouettes.types.Float
        return Near(silhouettes, *(F(dr.gather(type(v), v, i, active)) for v in self[1:]))


def chords(outline: Outline, centre: Vector, types: Types) -> Chords | None:
    """Whole silhouettes, packed; None where no other body's is there to be grazed."""
    if len(np.unique(outline.body)) < 2:
        return None
    ranges = cut(outline)
    first, last = ranges[:-1], ranges[1:] - 1
    of = outline.body[first]
    start, end = outline.start[first] - centre, outline.end[last] - centre
    length = np.maximum(np.linalg.norm(end - start, axis=1, keepdims=True), 1e-300)
    zero = np.zeros_like(length)
    outward = outline.outward[(first + last) // 2]
    records = np.concatenate([start, of[:, None], (end - start) / length, length, outward, zero], axis=1)
    middle, half = 0.5 * (start + end), 0.5 * length[:, 0]
    plan = flat(middle, half) if len(of) < FEW else layout(middle, half, of)
    item = np.where(plan.end == plan.begin + 1, plan.order[plan.begin], NONE)
    return Chords(types.buffer(records), plan.tree(item, types), types)


def passing(way: Frame, chord: Chord, k: float, room: Any = 0) -> Passing:
    """v² = (2/λ) d² (1/z1 + 1/z2), d the least distance of a way from a chord, less `room`."""
    ln = line(way, chord.start, chord.e)
    t = dr.clip(ln.td, 0, chord.length)
    along = ln.h + t * ln.ea
    d2 = ln.eqq * (dr.square(t - ln.td) + ln.w * ln.w)
    z2 = way.z2 - along
    d2 = dr.square(dr.maximum(dr.sqrt(d2) - room, 0))
    between = z2 > 0
    curvature = dr.rcp(z2)
    if not way.plane:
        z1 = way.z1 + along
        between &= z1 > 0
        curvature += dr.rcp(z1)
    return Passing(dr.select(between, (k / np.pi) * d2 * curvature, dr.inf), t, along, d2)


@syntax
def near(fr: Frame, silhouettes: Chords, k: float, receivers: Receivers, room: Any = 0) -> Near:
    """The bodies worth a look at each receiver; on a surface, only what rises above its horizon.

    room: how far other receivers may be, that are asked for with these.
    """
    F = silhouettes.types.Float
    n = silhouettes.types.Vector(receivers.n)
    p = fr.foot + fr.z2 * fr.a
    everywhere = dr.squared_norm(n) == 0
    body, v2, next_body, next_v2 = F(-1), F(dr.inf), F(-1), F(dr.inf)
    far = (0.5 * np.pi * WIDEST * WIDEST) / k  # v² is (2/π) kΔ or less
    i = dr.uint32_array_t(F)(0)
    while receivers.active & (i < silhouettes.tree.size):
        centre, radius = silhouettes.tree.node(i)
        inside = least_detour(fr, centre, radius + room) <= far
        item = silhouettes.tree.item_of(i)
        if receivers.active & inside & (item != NONE):
            chord = silhouettes.chord(item)
            at = passing(fr, chord, k, room)
            x = chord.start + at.t * chord.e - p
            rises = everywhere | (dr.dot(n, x) > HORIZON * dr.norm(x))
            v2_j = dr.select(rises, at.v2, dr.inf)
            other = chord.body != body
            closest = v2_j < v2
            moves_down = closest & other
            second = ~closest & other & (v2_j < next_v2)
            next_body = dr.select(moves_down, body, dr.select(second, chord.body, next_body))
            next_v2 = dr.select(moves_down, v2, dr.select(second, v2_j, next_v2))
            body = dr.select(closest, chord.body, body)
            v2 = dr.select(closest, v2_j, v2)
        i = silhouettes.tree.after(i, inside)
    return Near(silhouettes, body, v2, next_body, next_v2)


def other_than(found: Near, piece: Piece) -> tuple[Any, Any, Any]:
    """The nearest body that a piece is no part of, v² there, and whether it is near enough to matter."""
    own = found.body == piece.body
    v2 = dr.select(own, found.next_v2, found.v2)
    return dr.select(own, found.next_body, found.body), v2, v2 < WIDEST * WIDEST


def worth(wave: Any, v2: Any, tolerance: float) -> Any:
    """Whether what a second edge at Fresnel's parameter v makes of a wave, |M| = |wave| |E(v)|, is worth asking for."""
    least = max(FAINT * FAINT, FAINTER * tolerance)
    return (wave > FAINT) & (dr.square(wave) > (2 * np.pi**2 * least * least) * v2)


@syntax
def grazed(
    fr: Frame, silhouettes: Chords, piece: Piece, body: Any, visible: Any, k: float, active: Any
) -> tuple[Any, Any]:
    """The second term of M₁₂ over M₁ (real, imaginary) for the way from a piece's middle to P past a body.

    For P on the dark side of the light at X; on the lit side it is the opposite. A way that makes a wide angle
    with X→X₂ grazes nothing, nor does one that something else blocks.
    """
    F = silhouettes.types.Float
    U = dr.uint32_array_t(F)
    d = fr.foot + fr.z2 * fr.a - piece.middle
    s = dr.norm(d)
    way = Frame(d / s, piece.middle, F(0), s, s, False)
    far = (0.5 * np.pi * WIDEST * WIDEST) / k  # v² is (2/π) kΔ or less
    i, best, v2 = U(0), U(0), F(dr.inf)
    while active & (i < silhouettes.tree.size):
        inside = least_detour(way, *silhouettes.tree.node(i)) <= far
        item = silhouettes.tree.item_of(i)
        if active & inside & (item != NONE):
            here = silhouettes.chord(item)
            v2_i = passing(way, here, k).v2
            closer = (here.body == body) & (v2_i < v2)
            best = dr.select(closer, item, best)
            v2 = dr.select(closer, v2_i, v2)
        i = silhouettes.tree.after(i, inside)
    chord = silhouettes.chord(best)
    at = passing(way, chord, k)
    there = chord.start + at.t * chord.e
    towards = there - piece.middle
    beside = piece.middle + at.along * way.a - there
    acts = active & (v2 < WIDEST * WIDEST) & (visible | (dr.dot(chord.outward, beside) < 0) | (v2 < 0.25))
    taper = dr.maximum(1 - at.distance2 / dr.square(at.along), 0)
    # r s/(r+s), the length by which the angle at X becomes Fresnel's parameter at P
    reach = s
    if dr.hint(not fr.plane, mode="scalar"):
        r = dr.norm(piece.middle - fr.foot + fr.z1 * fr.a)
        reach = r * s / (r + s)
    scale = dr.sqrt((k / np.pi) * reach)
    sine = dr.dot(piece.outward, towards) / dr.norm(towards)
    to_p = amplitude(scale * dr.abs(dr.dot(piece.outward, way.a)))
    to_x2 = amplitude(scale * dr.abs(sine))
    past = amplitude(dr.sqrt(v2))
    sin, cos = sincos(0.5 * np.pi * v2)
    value = _product(_product(past, (cos, sin)), _quotient(to_x2, to_p))
    size = dr.select(acts, taper, 0) * dr.mulsign(F(1), dr.select(visible, sine, -sine))
    return dr.select(acts, size * value[0], 0), dr.select(acts, size * value[1], 0)


def _product(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _quotient(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    size = b[0] * b[0] + b[1] * b[1]
    return (a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size
