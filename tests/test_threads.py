"""Several threads may ask at once: they take turns, and each gets what it would have got alone."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
from concurrent.futures import ThreadPoolExecutor
import numpy as np
import grimaldi

scene = grimaldi.load("arago")
points = np.random.default_rng(0).uniform(-1, 1, (200, 3))
sides = 24, 32, 40, 48  # of films: all resize that of the one camera

def picture(side):
    return grimaldi.render(scene, wavelength=side / 2400, size=(side, side), spp=2).picture.values

def field(side):
    return grimaldi.field(scene, points, wavelength=side / 2400).U.values

alone = [ask(side) for ask in (picture, field) for side in sides]
for _ in range(5):
    with ThreadPoolExecutor(8) as pool:
        running = [pool.submit(ask, side) for ask in (picture, field) for side in sides]
        together = [each.result() for each in running]
    assert all(np.array_equal(a, b) for a, b in zip(alone, together, strict=True))
"""


def test_threads_that_share_a_scene_get_what_each_gets_alone() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
