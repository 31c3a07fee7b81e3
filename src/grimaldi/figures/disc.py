"""Figure 2: a coherent disc of radius 7000/6 λ, 10000/6 λ away, which took the report two days."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import grimaldi
from grimaldi.figures.drawing import Clock, Panel, grid, plane, sheet, strip
from grimaldi.figures.model import Answer, Figure, Picture, Settings

Reals = NDArray[np.float64]

RADIUS, DISTANCE = 7000 / 6, 10000 / 6  # wavelengths
PIXELS = 256  # of the page's default size
SAMPLES = 1024  # a pixel, as in the report
HALF = 512 * 4.6 / 2  # of the whole picture
CENTRE = 10.0  # half of the second one
STEP = 0.05  # of the radial line
FINER = 8  # times than the field is computed: its finest fringes on the plane are 1.23 λ wide (2a over the way there)
DIGITS = 9  # of a wavelength, in which both sides of the middle are told alike
TAPS = 10  # on either side, of the filter between


def scene() -> dict[str, Any]:
    """The disc as a `coherent_area` of amplitude 1 in the plane z = 0, shining along +z; λ = 1."""
    import mitsuba as mi

    scalar: Any = mi.scalar_rgb
    scale = scalar.ScalarTransform4f().scale([RADIUS, RADIUS, 1])
    return {"type": "scene", "disc": {"type": "disk", "to_world": scale, "emitter": {"type": "coherent_area"}}}


def radial(loaded: Any, farthest: float) -> tuple[Reals, Reals]:
    """Distances from the axis (n,) and |U|² there (n,).

    U is computed at three points a fringe, which determine it, and is even in the distance; between them a low-pass
    filter has it to 1e-5.
    """
    from scipy.signal import resample_poly

    count = round(np.ceil(farthest / (FINER * STEP))) + 1
    rho = FINER * STEP * np.arange(count + 2 * TAPS)
    points = np.stack([rho, 0 * rho, np.full(len(rho), DISTANCE)], axis=1)
    u = grimaldi.field(loaded, points, wavelength=1.0).U.values[0, 0]
    mirrored = np.concatenate([u[2 * TAPS : 0 : -1], u])
    fine = resample_poly(mirrored, FINER, 1, window=("kaiser", 10.0))[2 * TAPS * FINER :][: count * FINER]
    return np.asarray(STEP * np.arange(len(fine)), np.float64), fine.real**2 + fine.imag**2


def footprints(x: Reals, y: Reals, pixel: float, rho: Reals, intensity: Reals) -> Reals:
    """The mean of |U|² over square pixels centred at x by y: differences of its integral over rectangles.

    With f = |U|² at the distance ρ from the axis, ∫∫ f over 0..a by 0..b is

        ∫ f ρ (π/2 - acos(a/ρ) - acos(b/ρ)) dρ,  0 <= ρ <= √(a²+b²),  acos = 0 where its argument exceeds 1

    taken exactly for an f that is constant from halfway before each of `rho`, which are evenly spaced from 0, to
    halfway beyond.
    """
    columns, rows = (np.append(centres - 0.5 * pixel, centres[-1] + 0.5 * pixel) for centres in (x, y))
    a, b = np.abs(columns).round(DIGITS), np.abs(rows).round(DIGITS)
    edges = np.concatenate([[0], rho + 0.5 * (rho[1] - rho[0])])
    far = np.hypot(a, b[:, None])
    whole = 0.5 * np.pi * _partial(0.5 * edges**2, 0.5 * far**2, edges, intensity, far)
    along = _beyond(a, b, edges, intensity)
    down = along if np.array_equal(a, b) else _beyond(b, a, edges, intensity)
    integral = np.sign(columns) * np.sign(rows)[:, None] * (whole - along.T - down)
    return np.diff(np.diff(integral, axis=0), axis=1) / pixel**2


def _beyond(a: Reals, b: Reals, edges: Reals, intensity: Reals) -> Reals:
    """∫ f ρ acos(a/ρ) dρ up to √(a²+b²), (a, b)."""
    result = np.zeros((len(a), len(b)))
    for value in np.unique(a):
        first = int(np.searchsorted(edges, value, side="right")) - 1
        far = np.hypot(value, b)
        outer, of = edges[first:], intensity[first:]
        result[a == value] = _partial(_moment(value, outer), _moment(value, far), outer, of, far)
    return result


def _moment(a: float, rho: Reals) -> Reals:
    """∫ ρ acos(a/ρ) dρ from a to ρ."""
    out = np.maximum(rho, max(a, 1e-300))
    return 0.5 * (out**2 * np.arccos(a / out) - a * np.sqrt((out - a) * (out + a)))


def _partial(at_edges: Reals, at_far: Reals, edges: Reals, intensity: Reals, far: Reals) -> Reals:
    """∫ f dW up to the distances `far`, where W has the values `at_far`; `at_edges` are its values there."""
    steps = np.concatenate([[0], np.cumsum(intensity * np.diff(at_edges))])
    cell = np.minimum(np.searchsorted(edges, far, side="right") - 1, len(intensity) - 1)
    return steps[cell] + intensity[cell] * (at_far - at_edges[cell])


def exact(loaded: Any, x: Reals, y: Reals) -> tuple[Reals, Reals, Reals]:
    """`radial` as far as the square pixels centred at x by y reach, and the mean of |U|² over each of them (y, x)."""
    pixel = float(x[1] - x[0])
    rho, intensity = radial(loaded, float(np.hypot(np.abs(x).max() + pixel, np.abs(y).max() + pixel)))
    return rho, intensity, footprints(x, y, pixel, rho, intensity)


def draw(settings: Settings) -> Figure:
    from grimaldi.scene import load

    loaded = load(scene())
    n = 512 if settings.full else PIXELS
    x, y = grid(-HALF, HALF, -HALF, HALF, n)
    pixel = float(x[1] - x[0])

    clock = Clock()
    rho, intensity, means = exact(loaded, x, y)
    exact_time = str(clock)
    by_force, error = check(loaded, means, x, y, pixel)

    clock = Clock()
    samples = {"diffraction": "area", "n": SAMPLES, "wavelength": 1.0}
    noisy = grimaldi.field(loaded, plane(x, y, DISTANCE), **samples)
    random_time = str(clock)
    noise = float(np.sqrt((noisy.error.values**2).mean()))
    u = float(np.sqrt(intensity[0]))

    cx, cy = grid(-CENTRE, CENTRE, -CENTRE, CENTRE, n)
    centre = np.interp(np.hypot(*np.meshgrid(cx, cy)), rho, intensity)
    centre_noisy = grimaldi.field(loaded, plane(cx, cy, DISTANCE), **samples).intensity.values.reshape(n, n)

    whole = (-HALF, HALF, -HALF, HALF)
    noise_top = (0.0, float(np.percentile(noisy.intensity, 99)))
    strip(
        settings.folder / "figure-2.png",
        [
            Panel("Kirchhoff, mean over each pixel", means, "gray", (0.0, 1.6), "|U|²"),
            Panel(
                f"{SAMPLES:,} random samples a pixel",
                noisy.intensity.values.reshape(n, n),
                "gray",
                noise_top,
                "|U|²: noise, mind the scale",
            ),
        ],
        whole,
        "x [λ]",
        "y [λ]",
    )
    strip(
        settings.folder / "figure-2-centre.png",
        [
            Panel("Kirchhoff, the centre", centre, "gray", (0.0, float(centre.max())), "|U|²"),
            Panel(f"{SAMPLES:,} random samples", centre_noisy, "gray", noise_top, "|U|²"),
        ],
        (-CENTRE, CENTRE, -CENTRE, CENTRE),
        "x [λ]",
        "y [λ]",
    )
    _profile(settings.folder / "figure-2-profile.png", rho, intensity)
    needed = SAMPLES * (noise / (0.1 * u)) ** 2
    return Figure(
        "2",
        "A coherent area light",
        "A disc that shines as one coherent plane wave, on a plane so near that it is no far field: Fresnel number "
        f"{RADIUS**2 / DISTANCE:.4g}. The report summed random points of the disc's area.",
        (
            Picture("figure-2.png", f"The whole disc, {pixel:.2g} λ a pixel: fringes at its edge, no Airy disc"),
            Picture("figure-2-centre.png", f"Its centre, ±{CENTRE:g} λ: rings 0.87 λ apart"),
            Picture("figure-2-profile.png", "Intensity along a radius: the edge, and the rings near the axis"),
        ),
        {
            "disc": f"radius 7000/6 = {RADIUS:.4g} λ, {DISTANCE:.4g} λ from the plane",
            "pixels": f"{n} × {n} of {pixel:.2g} λ",
            "report": "1,024 samples a pixel, over two days",
        },
        {
            "exact: time": f"{exact_time}, by the symmetry about the axis",
            "exact: error": f"{error:.1g} of |U|² at most, at three pixels by brute force ({by_force:,} points each)",
            "1,024 random samples: time": random_time,
            "1,024 random samples: error": f"σ = {noise:.0f} beside |U| = {u:.3g}; for 10 % {needed:.1g} samples",
            "on the axis": f"|U|² = {intensity[0]:.4f} (THEORY 5: 1.7215 by Kirchhoff)",
        },
        (
            Answer(
                "A coherent disc, computed by volume integration over two days with 1,024 samples a pixel, shows an "
                "Airy disk (figure 2; the text calls it figure 3).",
                "corrected",
                "At this distance it is no Airy pattern but a disc with edge fringes about 41 λ wide and rings 0.87 λ "
                f"apart near the axis; 1,024 random samples leave noise {noise / u:.0f} times the field.",
            ),
            Answer(
                "The picture took over two days.",
                "bettered",
                f"{exact_time} with an error of {error:.1g}, and {random_time} for the same noise as the report's.",
            ),
        ),
    )


def check(loaded: Any, means: Reals, x: Reals, y: Reals, pixel: float) -> tuple[int, float]:
    """How many points in each of three pixels, and by how much their mean |U|² differs from `means` at most."""
    across, worst = 96, 0.0
    offsets = pixel * ((np.arange(across) + 0.5) / across - 0.5)
    middle = len(x) // 2
    for column in (middle, middle + len(x) // 5, middle + round(RADIUS / pixel) - 2):
        points = plane(x[column] + offsets, y[middle] + offsets, DISTANCE)
        mean = float(grimaldi.field(loaded, points, wavelength=1.0).intensity.mean())
        worst = max(worst, abs(mean - means[middle, column]))
    return across**2, worst


def _profile(path: Any, rho: Reals, intensity: Reals) -> None:
    with sheet(path, 9, 3.2) as figure:
        edge, rings = figure.subplots(1, 2)
        near = (rho > RADIUS - 250) & (rho < RADIUS + 100)
        edge.plot(rho[near], intensity[near], lw=0.8, color="k")
        edge.axvline(RADIUS, color="0.6", lw=0.8)
        edge.set(xlabel="distance from the axis [λ]", ylabel="|U|²", title="the disc's edge")
        inner = rho < CENTRE
        rings.plot(rho[inner], intensity[inner], lw=0.9, color="k")
        rings.set(xlabel="distance from the axis [λ]", title="near the axis")
