"""Ten thousand receivers across the rim of a mesh's shadow: M has no spike there.

Past a straight edge |dM/dv| = 1/√2, so that over a step of the receiver M changes by at most step/√(λL),
1/L = 1/z1 + 1/z2, for each edge that acts. A crossing counted wrongly is a jump of 1. What hides one edge
behind another is yes or no, which leaves steps of up to 0.11 where that changes (THEORY 2).
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import oracle
import pytest
from optics import affine, factor, shape
from scipy.ndimage import median_filter

import grimaldi
from grimaldi.scene import builtin

KILLEROO = Path(__file__).parents[2] / "shared" / "scenes" / "killeroo.xml"
EDGES = 4  # that act together
RECEIVERS = 10_000
TOLERANCE = 1e-3
HIDING = 0.11  # largest step where an edge disappears behind a body
VISIBLE = 0.01  # a dot that stands out of its neighbours by more can be seen


class Rim(NamedTuple):
    scene: str | Path
    light: list[float]
    intensity: float
    at: tuple[float, float, float]  # where the shadow ends, by rays; the line runs along x
    z1: float  # from the light to the body
    z2: float  # from the body to the rim
    wavelength: float

    @property
    def fringe(self):
        """√(λL) on the receiving surface."""
        return np.sqrt(self.wavelength / (1 / self.z1 + 1 / self.z2))

    def line(self):
        """Distances from the rim (n,) and M there (n,), with what hides edges and without."""
        x = np.linspace(-3, 3, RECEIVERS) * self.fringe
        points = np.array(self.at) + x[:, None] * [1.0, 0, 0]
        distance = np.linalg.norm(points - np.array(self.light), axis=1)
        free = np.sqrt(self.intensity) * np.exp(2j * np.pi / self.wavelength * distance) / distance
        fields = [
            grimaldi.field(
                self.scene, points, wavelength=self.wavelength, tolerance=TOLERANCE, occlusion=occlusion
            ).U.values[0, 0]
            for occlusion in (True, False)
        ]
        return x, *(field / free for field in fields)


def killeroo(x, wavelength):
    return Rim(KILLEROO, [1456, 270, 458], 5e6, (x, -240, -141), 1550, 320, wavelength)


def creature(at):
    scene = builtin.build("creature")
    light = scene["light"]
    intensity = float(np.dot([0.212671, 0.715160, 0.072169], light["intensity"]["value"]))  # mono: luminance
    return Rim("creature", light["position"], intensity, at, 460, 140, scene["integrator"]["wavelength"])


def assert_no_spike(rim):
    x, m, in_sight = rim.line()
    assert np.isfinite(m).all()
    assert np.ptp(abs(m)) > 0.3, "the line must cross from shadow into light"
    step = EDGES * (x[1] - x[0]) / rim.fringe + 2 * TOLERANCE
    assert abs(np.diff(in_sight)).max() < step
    assert abs(np.diff(m)).max() < HIDING
    spike = np.hypot(m.real - median_filter(m.real, 5), m.imag - median_filter(m.imag, 5))
    assert spike[abs(x) < rim.fringe / 2].max() < VISIBLE


@pytest.mark.skipif(not KILLEROO.exists(), reason="the benchmark scene killeroo.xml is not here")
@pytest.mark.parametrize(("x", "wavelength"), [(-345.34, 0.4), (-288.21, 4.0)])
def test_no_spike_at_the_rim_of_killeroos_shadow(x, wavelength):
    assert_no_spike(killeroo(x, wavelength))


def test_no_spike_at_the_rim_of_the_creatures_shadow():
    assert_no_spike(creature((127.1, 120.0, 80.0)))


CORNERS = np.array([[-50, -50], [50, -50], [50, 50], [-50, 50.0]])


@pytest.mark.parametrize("corner", CORNERS)
def test_a_ray_exactly_through_a_corner(corner):
    """M runs smoothly there too: both edges that meet in it take the ray to pass on the same side."""
    square = grimaldi.PlanarOutline(CORNERS)
    light = oracle.Plane((0, 0, 1))
    points = np.array([[*(corner + shift), 2000] for shift in ([0, 0], [1e-5, 2e-5], [-1e-5, 1e-5])])
    exact, *near = factor(light, points, outlines=[square], precision="double")
    np.testing.assert_allclose(exact, near, atol=3e-3)


@pytest.mark.parametrize("precision", ["auto", "double"])
def test_a_ray_exactly_through_the_joint_of_two_segments_gives_a_number(precision):
    """A long edge is cut up, here also right behind the point."""
    sheet = shape("rectangle", affine((40, 1000, 1)))
    there, beside = factor(oracle.Plane((0, 0, 1)), [[40, 0, 2000], [40, 1, 2000]], sheet, precision=precision)
    assert there == pytest.approx(beside, abs=0.03)
