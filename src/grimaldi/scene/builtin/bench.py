"""What the textbook scenes share: an optical bench along z, in millimetres, its screen at z = 0.

The screen lies in the plane z = 0, where z is exact though rays are Float32, and x and y, small numbers, are good to a
small part of the wavelength. Light comes from +z.
"""

from __future__ import annotations

from typing import Any

UNIT = "1 mm"
GREEN = 532e-6  # wavelength of a green laser pointer [mm]
PIXELS = 512
WHITE = 0.8  # reflectance of the screen


def transform() -> Any:
    """Mitsuba's transform type, whatever variant is set."""
    import mitsuba as mi

    return mi.scalar_rgb.ScalarTransform4f  # type: ignore[reportAttributeAccessIssue]


def bench(wavelength: float, width: float, camera: float, parts: dict[str, Any]) -> dict[str, Any]:
    """A scene of `parts`, a diffuse screen and a camera `camera` in front of it that sees `width` of it.

    The camera's rays are parallel and fall straight on the screen: a pixel is width/PIXELS wide.
    """
    T = transform()
    return {
        "type": "scene",
        "scene_unit": UNIT,
        "integrator": {"type": "wave", "wavelength": wavelength},
        **parts,
        "screen": {
            "type": "rectangle",
            "to_world": T().scale([width, width, 1]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [WHITE] * 3}},
        },
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, camera], [0, 0, 0], [0, 1, 0]).scale([width / 2, width / 2, 1]),
            "film": film(PIXELS, PIXELS),
            "sampler": {"type": "independent", "sample_count": 4},
        },
    }


def film(width: int, height: int) -> dict[str, Any]:
    """A film that averages over each pixel's box and keeps all digits."""
    return {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
