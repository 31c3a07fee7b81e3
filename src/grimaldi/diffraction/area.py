"""Kirchhoff's integral by brute force over the open area (THEORY 4; Born & Wolf §8.3.2, eq. 17).

    M = -(1/4π) ∫ (R/rs) e^{ikΔ} [(ik - 1/s) n·(P-X)/s + (ik - 1/r) n·(X-S)/r] dA       behind holes
    M = 1 - the same over the surface that the source sees                              past bodies and masks

What `boundary` finds along outlines this finds without them: each checks the other. No X→P is traced, as with
occlusion=False. What the source sees of a body spans its outline where it hides nothing else of the bodies; where it
does, the edge of its shadow on them acts as an edge too, which is not so in nature.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba
import numpy as np

from grimaldi.diffraction import none
from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.frame import HORIZON, constant
from grimaldi.diffraction.model import NYQUIST, Evaluate, Factor, Options, Receivers
from grimaldi.diffraction.occlusion import Rays, rays
from grimaldi.diffraction.screen import beyond
from grimaldi.diffraction.sines import sincos
from grimaldi.diffraction.surface import Patches, Surface, lit_surface, opening
from grimaldi.errors import InputError
from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Scene, Source
from grimaldi.syntax import syntax

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

CELL = 0.5  # wavelengths: the phase k(r+s) turns at most once over it
MOST = 4_000_000  # nodes, 256 MB


class Kernel(NamedTuple):
    """The integrand for one source and wavenumber."""

    source: Source
    k: float

    def at(self, p: Any, n: Any, x: Any, element: Any) -> tuple[Any, Any]:
        """Its real and imaginary part for receivers p with normals n, at x on an area element; all Float64."""
        w = p - x
        s = dr.norm(w)
        k = self.k
        on_s = dr.dot(w, element) / s
        if self.source.position is None:
            assert self.source.direction is not None
            d = constant(type(p), self.source.direction)
            spread, path = 1 / s, s - dr.dot(w, d)
            out, in_ = on_s + dr.dot(d, element), on_s / s
        else:
            v = x - constant(type(p), self.source.position)
            r, R = dr.norm(v), dr.norm(v + w)
            on_r = dr.dot(v, element) / r
            spread, path = R / (r * s), r + s - R
            out, in_ = on_s + on_r, on_s / s + on_r / r
        sin, cos = sincos(k * path)
        free = dr.squared_norm(n) == 0
        above = free | (dr.dot(n, w) < -HORIZON * s)
        scale = dr.select(above, spread / (4 * np.pi), 0)
        # -(ik out - in) e^{ikΔ}
        return scale * (in_ * cos + k * out * sin), scale * (in_ * sin - k * out * cos)


def area(scene: Scene, source: Source, outline: Outline, k: float, options: Options) -> Evaluate:
    """The `area` model: by quadrature, or by options.n random samples a point, the same for the same point.

    Surfaces act on a receiver that lies on one only above its horizon. The error of quadrature is the difference to
    a coarser rule (of partly hidden triangles it is of first order), that of random samples their standard error;
    Float32 rays, which tell what the source sees of bodies, leave some 1e-5 beside.

    Raises InputError where quadrature would take more than 4e6 nodes, and for n = "nyquist".
    """
    if options.n == NYQUIST:
        raise InputError("n: 'nyquist' spaces the sources of huygens; give a number of samples, or none for quadrature")
    patches, reached = _surface(scene, source)
    if not len(patches):
        return none.none(scene, source, outline, k, options)
    kernel = Kernel(source, k)
    if options.n is None:
        integral = _by_quadrature(kernel, patches, reached, options.tolerance)
    else:
        integral = _by_samples(kernel, patches, reached, options.n)
    far = beyond(scene.screen[0], source) if scene.screen else None
    hole = bool(scene.screen) and scene.screen[0].hole

    def evaluate(receivers: Receivers) -> Factor:
        p, n = receivers.p, type(receivers.p)(receivers.n)
        if far is None:
            real, imag, error = integral(p, n, receivers.active)
            return Factor(1 - real, -imag, error)
        shaded = receivers.active & far(p)
        real, imag, error = integral(p, 0 * n, shaded)  # the screen is all that there is: no surface has a horizon
        if not hole:
            real, imag = 1 - real, -imag
        return Factor(dr.select(shaded, real, 1), dr.select(shaded, imag, 0), dr.select(shaded, error, 0))

    return evaluate


def _surface(scene: Scene, source: Source) -> tuple[Patches, Reached | None]:
    """What is integrated over, and which points of it the source reaches."""
    if scene.screen:
        return opening(scene.screen, source), None
    patches = lit_surface([body.geometry for body in scene.bodies], source)
    return patches, _reached(rays(scene, source)) if scene.bodies else None


Reached = Callable[[Any, Any, Any], Any]
"""From points on surfaces, their area elements and a mask to whether the source sees them."""

Integral = Callable[[Any, Any, Any], tuple[Any, Any, Any]]
"""From points, their normals and a mask to the integral's real and imaginary part and its error."""


def _reached(probe: Rays) -> Reached:
    """Whether the source sees points x on surfaces with area elements."""

    def reached(x: Any, element: Any, active: Any) -> Any:
        x, e = mi.Point3f(x), mi.Vector3f(dr.normalize(element))
        if probe.source.position is None:
            assert probe.source.direction is not None
            d = constant(mi.Vector3f, probe.source.direction)
            length = mi.Float(4 * probe.extent)
        else:
            v = x - constant(mi.Point3f, probe.source.position)
            length = dr.norm(v)
            d = v / length
        slack = probe.epsilon(x) / dr.maximum(dr.abs(dr.dot(d, e)), 1e-3)
        ray = mi.Ray3f(x - length * d, d, dr.maximum(length - 2 * slack, 0), 0, mi.Color0f())
        return ~probe.blockers.ray_test(ray, active)

    return reached


def _by_quadrature(kernel: Kernel, patches: Patches, reached: Reached | None, tolerance: float) -> Integral:
    """Gauss-Legendre in cells of half a wavelength, by two rules."""
    order = 4 if tolerance >= 5e-4 else 6 if tolerance >= 1e-6 else 9
    fine = _nodes(kernel, patches, reached, order)
    coarse = _nodes(kernel, patches, reached, order - 1)

    def integral(p: Any, n: Any, active: Any) -> tuple[Any, Any, Any]:
        real, imag = node_sum(kernel, fine, p, n, active)
        re, im = node_sum(kernel, coarse, p, n, active)
        return real, imag, dr.sqrt(dr.square(real - re) + dr.square(imag - im))

    return integral


class Nodes(NamedTuple):
    """Points and area elements as one device buffer."""

    size: int
    records: Any


def _nodes(kernel: Kernel, patches: Patches, reached: Reached | None, order: int) -> Nodes:
    along, across = (np.maximum(np.ceil(size * kernel.k / (2 * np.pi * CELL)), 1) for size in patches.sizes)
    total = float((along * across).sum()) * order**2
    if total > MOST:
        raise InputError(
            f"diffraction: 'area' takes {total:.2g} nodes here, more than {MOST:.0e}; give a longer wavelength, or "
            "samples by n, or use 'boundary'"
        )
    cells = (along * across).astype(np.int64)
    patch = np.repeat(np.arange(len(patches)), cells)
    cell = np.arange(len(patch)) - np.repeat(np.cumsum(cells) - cells, cells)
    columns, rows = along[patch], across[patch]
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = 0.5 * (x + 1), 0.5 * w
    u = ((cell // rows)[:, None, None] + x[:, None]) / columns[:, None, None]
    v = ((cell % rows)[:, None, None] + x[None, :]) / rows[:, None, None]
    weight = np.outer(w, w) / (columns * rows)[:, None, None]
    u, v = np.broadcast_arrays(u, v)

    double = types(double=True)
    index = dr.uint32_array_t(double.Float)
    at, element = Surface.of(patches).at(
        index(np.repeat(patch, order**2).astype(np.uint32)), double.buffer(u), double.buffer(v)
    )
    element *= double.buffer(weight)
    if reached is not None:
        element = dr.select(reached(at, element, dr.mask_t(at.x)(True)), element, 0)
    kept = np.array(element).T
    lit = kept.any(axis=1)
    zero = np.zeros((int(lit.sum()), 1))
    records = np.concatenate([np.array(at).T[lit], zero, kept[lit], zero], axis=1)
    return Nodes(len(records), double.buffer(records))


@syntax
def node_sum(kernel: Kernel, nodes: Nodes, p: Any, n: Any, active: Any) -> tuple[Any, Any]:
    """Σ over nodes of the integrand."""
    double = types(double=True)
    V, P = double.Vector, double.Packet
    real, imag = double.Float(0), double.Float(0)
    i = dr.uint32_array_t(double.Float)(0)
    while active & (i < nodes.size):
        a, b = dr.gather(P, nodes.records, 2 * i), dr.gather(P, nodes.records, 2 * i + 1)
        re, im = kernel.at(p, n, V(a.x, a.y, a.z), V(b.x, b.y, b.z))
        real += re
        imag += im
        i += 1
    return real, imag


def _by_samples(kernel: Kernel, patches: Patches, reached: Reached | None, n: int) -> Integral:
    """The mean of n samples spread evenly over the area, times the area."""
    double = types(double=True)
    areas = patches.areas
    samples = Samples(Surface.of(patches), double.buffer(np.cumsum(areas) / areas.sum()), len(patches), n, reached)
    shares = double.buffer(areas / areas.sum())

    def integral(p: Any, normal: Any, active: Any) -> tuple[Any, Any, Any]:
        return sample_mean(kernel, samples, shares, p, normal, active)

    return integral


class Samples(NamedTuple):
    """Where random samples fall: patches by their cumulative share of the area."""

    surface: Surface
    cumulative: Any
    patches: int
    n: int
    reached: Reached | None

    def pick(self, choice: Any) -> Any:
        """The patch of a number in 0..1."""
        return dr.binary_search(0, self.patches - 1, lambda i: dr.gather(type(choice), self.cumulative, i) < choice)


def _stream(p: Any) -> Any:
    """A generator of each point's own, from the bits of its coordinates."""
    words: list[Any] = [dr.reinterpret_array(mi.UInt64, x + 0.0) for x in (p.x, p.y, p.z)]
    a, b = mi.UInt32(0), mi.UInt32(0)
    for word in words:
        a, b = mi.sample_tea_32(a ^ mi.UInt32(word & 0xFFFFFFFF), b ^ mi.UInt32(word >> 32))
    return mi.PCG32(initstate=mi.UInt64(a), initseq=mi.UInt64(b))


@syntax
def sample_mean(
    kernel: Kernel, samples: Samples, shares: Any, p: Any, normal: Any, active: Any
) -> tuple[Any, Any, Any]:
    """Mean of samples over the density of the patches, and its standard error."""
    F = types(double=True).Float
    real, imag, square = F(0), F(0), F(0)
    rng = _stream(p)
    i = mi.UInt32(0)
    while active & (i < samples.n):
        choice, u, v = rng.next_float64(), rng.next_float64(), rng.next_float64()
        patch = samples.pick(choice)
        x, element = samples.surface.uniform(patch, dr.maximum(u, 1e-300), v)
        element = element / dr.gather(F, shares, patch)
        re, im = kernel.at(p, normal, x, element)
        if dr.hint(samples.reached is not None, mode="scalar"):
            assert samples.reached is not None
            seen = samples.reached(x, element, active)
            re, im = dr.select(seen, re, 0), dr.select(seen, im, 0)
        real += re
        imag += im
        square += re * re + im * im
        i += 1
    count = float(samples.n)
    real, imag, square = real / count, imag / count, square / count
    spread = dr.maximum(square - real * real - imag * imag, 0)
    return real, imag, dr.sqrt(spread / max(count - 1, 1))
