"""The WFIRST starshade, whose field others have published.

Computed with a boundary diffraction wave code: github.com/harnessa/diffraq, non_package_sandbox/bdw_comparison.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

import grimaldi
from grimaldi.validation.computing import Reals, difference
from grimaldi.validation.model import STARSHADE_FILES, Case, Curve

PROMISE = 3e-7  # of |U|; theirs is 1e-5
TOLERANCE = 1e-8


def starshade(folder: Path) -> Case:
    """max ||U| - |U_ref|| over the telescope's pupil at 405 and 641 nm."""
    import h5py

    opacity, fields = STARSHADE_FILES
    opened: Any = h5py.File(folder / fields)  # the stubs do not know what is in it
    with opened as file:
        wavelengths = file["waves"][()]
        distance, diameter = float(file["z1"][()]), float(file["tel_diameter"][()])
        petals, corners = int(file["num_petals"][()]), int(file["num_occ_pts"][()])
        published = [file[f"pupil_{w * 1e9:.0f}"][()] for w in wavelengths]
    mask = grimaldi.PlanarOutline(_outline(folder / opacity, petals, corners), hole=False)
    scene = grimaldi.load(
        {"type": "scene", "light": {"type": "coherent_directional", "direction": [0, 0, 1]}}, outlines=[mask]
    )
    n = len(published[0])
    axis = diameter * (np.arange(n) / n - 0.5)
    x, y = np.meshgrid(axis, axis)
    pupil = published[0] != 0
    points = np.stack([x[pupil], y[pupil], np.full(pupil.sum(), distance)], axis=1)
    begun = time.perf_counter()
    field = grimaldi.field(scene, points, wavelength=wavelengths.tolist(), tolerance=TOLERANCE, precision="double")
    seconds = time.perf_counter() - begun
    computed = abs(field.U.values[:, 0])
    expected = np.stack([abs(u[pupil]) for u in published])
    errors = [difference(*pair) for pair in zip(computed, expected, strict=True)]
    row = y[pupil] == 0
    said = ", ".join(f"{e:.2g} at {w * 1e9:.0f} nm" for e, w in zip(errors, wavelengths, strict=True))
    return Case(
        "starshade",
        "exact",
        "diffraq, published",
        max(errors),
        TOLERANCE,
        PROMISE - TOLERANCE,
        seconds,
        f"||U| - |U_ref|| over the pupil: {said}; {2 * petals * corners} corners; theirs is good to 1e-5",
        Curve(
            x[pupil][row], computed[-1][row], expected[-1][row], "x across the pupil [m]", "|U|", is_logarithmic=True
        ),
    )


def _outline(path: Path, petals: int, corners: int) -> Reals:
    """Petals (n, 2) [m] joined into a loop: half angle π/petals times the apodisation at equal steps of the radius."""
    radius, opacity = np.loadtxt(path, delimiter=",").T
    even = np.linspace(radius[0], radius[-1], corners)
    half = np.pi / petals * np.interp(even, radius, opacity)
    angle = np.concatenate([-half, half[::-1]]) + 2 * np.pi / petals * np.arange(petals)[:, None]
    along = 1e-6 * np.concatenate([even, even[::-1]])
    return np.stack([-along * np.cos(angle), along * np.sin(angle)], axis=-1).reshape(-1, 2)
