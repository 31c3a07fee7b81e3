"""Ten thousand receivers across the rim of a mesh's shadow: M is as smooth there as Fresnel's integral.

Past a straight edge |dM/dv| = 1/√2, so that over a step of the receiver M changes by at most step/√(λL),
1/L = 1/z1 + 1/z2. Several edges may act at once; a wrong crossing is a jump of 1.
"""

from pathlib import Path

import numpy as np
import pytest

import grimaldi
from grimaldi.scene import builtin

KILLEROO = Path(__file__).parents[2] / "shared" / "scenes" / "killeroo.xml"
EDGES = 4  # that act together
RECEIVERS = 10_000
TOLERANCE = 1e-3


def factor(scene, light, intensity, points, wavelength):
    result = grimaldi.field(scene, points, wavelength=wavelength, tolerance=TOLERANCE)
    distance = np.linalg.norm(points - light, axis=1)
    free = np.sqrt(intensity) * np.exp(2j * np.pi / wavelength * distance) / distance
    return result.U.values[0, 0] / free


def assert_smooth(m, step, wavelength, length):
    assert np.isfinite(m).all()
    assert np.ptp(abs(m)) > 0.4, "the line must cross from shadow into light"
    allowed = EDGES * step / np.sqrt(wavelength * length) + 2 * TOLERANCE
    jump = abs(np.diff(m))
    worst = int(jump.argmax())
    assert jump[worst] < allowed, f"M jumps by {jump[worst]:.3g} at receiver {worst} of {len(m)}"


@pytest.mark.skipif(not KILLEROO.exists(), reason="the benchmark scene killeroo.xml is not here")
@pytest.mark.parametrize("wavelength", [0.4, 4.0])
@pytest.mark.parametrize("rim", [-345.34, -288.21])
def test_no_spike_across_the_rim_of_killeroos_shadow(rim, wavelength):
    # On the floor, z = -141, behind the body; the light is 1870 away and the body 320 to 400.
    width = 60 * np.sqrt(wavelength)
    x = rim + np.linspace(-width / 2, width / 2, RECEIVERS)
    points = np.stack([x, np.full_like(x, -240), np.full_like(x, -141)], axis=1)
    m = factor(KILLEROO, [1456, 270, 458], 5e6, points, wavelength)
    assert_smooth(m, width / RECEIVERS, wavelength, 1 / (1 / 1550 + 1 / 320))


@pytest.mark.parametrize("start", [(180.0, 120.0, 70.0), (118.0, 120.0, 80.0)])
def test_no_spike_across_the_rim_of_the_creatures_shadow(start):
    scene = builtin.build("creature")
    light = np.array(scene["light"]["position"])
    wavelength = scene["integrator"]["wavelength"]
    points = start + np.linspace(0, 20, RECEIVERS)[:, None] * [1.0, 0, 0]
    intensity = np.dot([0.212671, 0.715160, 0.072169], scene["light"]["intensity"]["value"])
    m = factor("creature", light, intensity, points, wavelength)
    assert_smooth(m, 20 / RECEIVERS, wavelength, 1 / (1 / 460 + 1 / 140))
