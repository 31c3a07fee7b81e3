"""Young's fringes: the field of two coherent point sources, and their spacing against λL/s."""

import numpy as np

import grimaldi

wavelength, separation, distance = 0.5, 40.0, 10_000.0

scene = {
    "type": "scene",
    "upper": {"type": "coherent_point", "position": [0, separation / 2, 0]},
    "lower": {"type": "coherent_point", "position": [0, -separation / 2, 0]},
}
y = np.linspace(-500, 500, 4001)
points = np.stack([np.zeros_like(y), y, np.full_like(y, distance)], axis=1)

field = grimaldi.field(scene, points, wavelength=wavelength)

intensity = field.intensity.values
bright = y[1:-1][(intensity[1:-1] > intensity[:-2]) & (intensity[1:-1] > intensity[2:])]
print(f"bright fringes       {len(bright)}")
print(f"their spacing        {np.diff(bright).mean():.2f}")
print(f"λL/s                 {wavelength * distance / separation:.2f}")
print(f"darkest / brightest  {intensity.min() / intensity.max():.1e}")
