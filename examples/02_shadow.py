"""The shadow of a ball and a rod on a floor: your own scene, by waves and by rays, at one exposure."""

import mitsuba as mi

import grimaldi
from grimaldi import film

mi.set_variant("llvm_ad_rgb")
T = mi.ScalarTransform4f
white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.8}}

scene = {
    "type": "scene",
    "scene_unit": "10 um",
    "sun": {"type": "coherent_directional", "direction": [0.3, 0.2, -1]},
    "floor": {"type": "rectangle", "to_world": T().scale([200, 200, 1]), "bsdf": white},
    "ball": {"type": "sphere", "center": [-12, 0, 60], "radius": 12, "bsdf": white},
    "rod": {"type": "cube", "to_world": T().translate([20, 0, 50]).scale([2, 30, 2]), "bsdf": white},
    "camera": {
        "type": "perspective",
        "fov": 40,
        "to_world": T().look_at([0, -150, 120], [16, 10, 26], [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": 200, "height": 150},
    },
}

waves = grimaldi.render(scene, wavelength="633 nm", spp=4)
rays = grimaldi.render(scene, wavelength="633 nm", spp=4, diffraction="none")

exposure = film.automatic_exposure(rays.picture)
film.write(waves, "shadow-waves.png", exposure=exposure)
film.write(rays, "shadow-rays.png", exposure=exposure)
film.write(waves, "shadow-waves.exr")
print(f"brightest / the rays' brightest  {float(waves.intensity.max() / rays.intensity.max()):.2f}")
