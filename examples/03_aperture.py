"""A star-shaped hole from arrays, lit by a plane wave: the field on a plane behind it, plotted."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import grimaldi

# five points, 1 mm across; lengths in mm
angle = np.pi / 2 + np.pi * np.arange(10) / 5
radius = np.where(np.arange(10) % 2 == 0, 0.5, 0.2)
star = grimaldi.PlanarOutline(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))

light = {"type": "scene", "laser": {"type": "coherent_directional", "direction": [0, 0, 1]}}
scene = grimaldi.load(light, outlines=[star], scene_unit="1 mm")

n, side, distance = 160, 1.6, 100.0
x = np.linspace(-side / 2, side / 2, n)
X, Y = np.meshgrid(x, x)
points = np.stack([X, Y, np.full_like(X, distance)], axis=-1)

field = grimaldi.field(scene, points.reshape(-1, 3), wavelength="532 nm")
U = field.U.values[0, 0].reshape(n, n)

figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
extent = (x[0], x[-1], x[0], x[-1])
for axis, values, title, colours in (
    (axes[0], np.abs(U) ** 2, "intensity", "magma"),
    (axes[1], np.angle(U * np.exp(-2j * np.pi * distance / 532e-6)), "phase past the plane wave's [rad]", "twilight"),
):
    picture = axis.imshow(values, extent=extent, origin="lower", cmap=colours)
    figure.colorbar(picture, ax=axis, label=title)
    axis.set(xlabel="x [mm]", ylabel="y [mm]")
figure.savefig("aperture.png", dpi=120)
print(f"on the axis  {np.abs(U[n // 2, n // 2]) ** 2:.3f}; largest error of U  {float(field.error.max()):.0e}")
