"""The same code on CUDA: fields and pictures are those of LLVM, to what tolerance and precision allow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba
import numpy as np
import pytest
from numpy.typing import NDArray

import grimaldi

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for

pytestmark = pytest.mark.skipif(
    not all(dr.has_backend(backend) for backend in (dr.JitBackend.LLVM, dr.JitBackend.CUDA)),
    reason="needs a GPU that CUDA answers for, beside LLVM",
)


def on_both(compute: Callable[[], NDArray[Any]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """What is computed by LLVM, and by CUDA; LLVM's variant is set afterwards."""
    mi.set_variant("llvm_ad_rgb")
    llvm = compute()
    mi.set_variant("cuda_ad_rgb")
    try:
        return llvm, compute()
    finally:
        mi.set_variant("llvm_ad_rgb")


def room() -> dict[str, Any]:
    """A ball, a box and a mirror on a floor, in a coherent point and another light."""
    T = mi.ScalarTransform4f
    grey = {"type": "diffuse"}
    film = {"type": "hdrfilm", "width": 48, "height": 40, "rfilter": {"type": "box"}}
    return {
        "type": "scene",
        "floor": {"type": "rectangle", "to_world": T().scale(6), "bsdf": grey},
        "ball": {"type": "sphere", "center": [-0.5, 0, 1], "radius": 0.8, "bsdf": grey},
        "box": {"type": "cube", "to_world": T().translate([2, -1, 0.5]).scale(0.5), "bsdf": grey},
        "mirror": {
            "type": "disk",
            "to_world": T().look_at([0, 5, 1], [0, 0, 1], [0, 0, 1]).scale(2),
            "bsdf": {"type": "twosided", "bsdf": {"type": "conductor"}},
        },
        "lamp": {"type": "coherent_point", "position": [2, 3, 4]},
        "lantern": {"type": "point", "position": [4, -4, 5], "intensity": 3.0},
        "camera": {
            "type": "perspective",
            "fov": 50,
            "to_world": T().look_at([5, -6, 4], [0.5, 0, 0.5], [0, 0, 1]),
            "film": film,
            "sampler": {"type": "independent", "sample_count": 4},
        },
    }


def points(n: int) -> NDArray[np.float64]:
    """On the floor, in and beside the shadows."""
    return np.append(np.random.default_rng(0).uniform(-3, 3, (n, 2)), np.zeros((n, 1)), axis=1)


@pytest.mark.parametrize(
    ("model", "options", "allowed"),
    [
        ("boundary", {"tolerance": 1e-3}, 1e-3),
        ("boundary", {"tolerance": 1e-6, "precision": "double"}, 1e-6),
        ("huygens", {"n": 3}, 1e-4),
        ("area", {"n": 256}, 1e-3),
        ("none", {}, 1e-5),
    ],
)
@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
def test_fields_are_llvms(model: str, options: dict[str, Any], allowed: float) -> None:
    """|ΔU| over the largest |U|; where a ray just meets or misses an edge, the two may decide otherwise."""

    def compute() -> NDArray[Any]:
        return grimaldi.field(room(), points(200), wavelength=0.05, diffraction=model, **options).U.values

    llvm, cuda = on_both(compute)
    assert np.abs(llvm).max() > 0
    assert np.quantile(np.abs(cuda - llvm), 0.99) <= 2 * allowed * np.abs(llvm).max()


@pytest.mark.parametrize(
    "options",
    [{}, {"fast": False}, {"max_depth": 4}, {"diffraction": "none"}, {"tolerance": 0.1}],
    ids=["fast", "at every sample", "mirrors", "rays", "loose"],
)
@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
def test_pictures_are_llvms(options: dict[str, Any]) -> None:
    """The same random numbers, so the same samples but for those that rounding takes past an edge."""
    tolerance = options.get("tolerance", 1e-3)

    def compute() -> NDArray[Any]:
        return grimaldi.render(room(), wavelength=0.05, spp=4, **options).picture.values

    llvm, cuda = on_both(compute)
    assert llvm.max() > 0
    assert np.quantile(np.abs(cuda - llvm), 0.98) <= 5 * tolerance * llvm.max()


@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
def test_the_integrator_is_llvms() -> None:
    def compute() -> NDArray[Any]:
        wave = mi.load_dict({"type": "wave", "wavelength": 0.05, "max_depth": 3})
        return np.array(mi.render(mi.load_dict(room()), integrator=wave, spp=4, seed=1))

    llvm, cuda = on_both(compute)
    assert np.quantile(np.abs(cuda - llvm), 0.98) <= 5e-3 * llvm.max()


def test_a_hole_by_one_transform() -> None:
    """Points of one plane behind a hole, which one transform serves."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    light = {"type": "coherent_directional", "direction": [0.0, 0.0, 1.0]}
    x, y = np.meshgrid(*[np.linspace(-2, 2, 64)] * 2)
    behind = np.stack([x, y, np.full_like(x, 30.0)], axis=-1).reshape(-1, 3)

    def compute() -> NDArray[Any]:
        hole = grimaldi.PlanarOutline(np.stack([np.cos(angle), np.sin(angle)], axis=1))
        scene = grimaldi.load({"type": "scene", "light": light}, outlines=[hole])
        return grimaldi.field(scene, behind, wavelength=0.1, tolerance=1e-6).U.values

    llvm, cuda = on_both(compute)
    np.testing.assert_allclose(cuda, llvm, rtol=0, atol=2e-6)
