"""The integrator `wave` as users call it: through `mi.render`, in `grimaldi.render`, and against Mitsuba's own."""

from __future__ import annotations

from typing import Any

import mitsuba
import numpy as np
import pytest

import grimaldi
from grimaldi import light
from grimaldi.engine.tiles import Shot, bands, render_tile
from grimaldi.errors import InputError
from grimaldi.light import prepare
from grimaldi.options import Settings

mi: Any = mitsuba  # the stubs refuse numbers where arrays are asked for
mi.set_variant("llvm_ad_rgb")
T = mi.ScalarTransform4f


@pytest.fixture(autouse=True)
def rgb():
    mi.set_variant("llvm_ad_rgb")


def room(integrator: dict, **more) -> dict:
    """A floor, a glossy ball, a diffuse box; a point light unless `more` brings others."""
    lights = more or {
        "lamp": {"type": "point", "position": [2, 3, 4], "intensity": {"type": "rgb", "value": [30, 20, 9]}}
    }
    return {
        "type": "scene",
        "integrator": integrator,
        "floor": {"type": "rectangle", "to_world": T().scale(6), "bsdf": {"type": "diffuse"}},
        "ball": {
            "type": "sphere",
            "center": [0, 0, 1],
            "radius": 0.8,
            "bsdf": {"type": "roughconductor", "alpha": 0.3},
        },
        "box": {
            "type": "cube",
            "to_world": T().translate([2, -1, 0.5]).scale(0.5),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.6, 0.3]}},
        },
        "sensor": {
            "type": "perspective",
            "fov": 50,
            "to_world": T().look_at([5, -6, 4], [0.5, 0, 0.5], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 48, "height": 40, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 16},
        },
        **lights,
    }


RAYS = {"type": "wave", "wavelength": 0.01, "diffraction": "none", "interference": False}


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "llvm_ad_mono"])
@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
def test_without_waves_it_is_direct(variant):
    """One delta light, the same seed, the same samples: equal but for rounding. Glass throws Mitsuba's hard shadow."""
    before = mi.variant()
    mi.set_variant(variant)
    try:
        # `direct` draws no number for a choice among one light, so the same stream serves both
        pillar = {"type": "cylinder", "p0": [-2, 1, 0], "p1": [-2, 1, 2], "radius": 0.3, "bsdf": {"type": "dielectric"}}
        scene = mi.load_dict(room({"type": "direct", "bsdf_samples": 0}) | {"pillar": pillar})
        rays = np.array(mi.render(scene, spp=16, seed=3))
        wave = np.array(mi.render(scene, integrator=mi.load_dict(RAYS), spp=16, seed=3))
    finally:
        mi.set_variant(before)
    np.testing.assert_allclose(wave, rays, rtol=1e-4, atol=1e-5 * rays.max())


LIGHTS = {
    "lamp": {"type": "point", "position": [2, 3, 4], "intensity": 20.0},
    "sun": {"type": "directional", "direction": [1, 1, -2], "irradiance": 0.7},
    "sky": {"type": "constant", "radiance": 0.2},
}


@pytest.mark.parametrize(
    ("reference", "depth"),
    [({"type": "direct"}, 2), ({"type": "path", "max_depth": 4}, 4)],
    ids=["direct", "path"],
)
@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
def test_without_waves_it_is_mitsuba_in_the_mean(reference, depth):
    """Several lights, an environment and bounces: the same mean, within the noise of independent renders.

    Z-test of block means (48 x 40 in blocks of 8): each block's difference against its own spread over 6 renders,
    |Z| < 4.5 for all 90 values, which chance passes with probability 1 - 6e-4 (Šidák).
    """
    scene = mi.load_dict(room(reference, **LIGHTS))
    wave = mi.load_dict(RAYS | {"max_depth": depth})

    def blocks(integrator, seed):
        image = np.array(mi.render(scene, integrator=integrator, spp=64, seed=seed))
        return image.reshape(5, 8, 6, 8, 3).mean(axis=(1, 3))

    ours = np.stack([blocks(wave, seed) for seed in range(6)])
    theirs = np.stack([blocks(scene.integrator(), seed + 100) for seed in range(6)])
    spread = np.sqrt((ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / 6)
    difference = np.abs(ours.mean(axis=0) - theirs.mean(axis=0))
    # Student's t with 10 degrees of freedom has heavier tails than the normal: floor the spread by its median
    assert (difference < 4.5 * np.maximum(spread, np.median(spread))).all()


def young(width: int = 96) -> dict:
    """Two coherent sources s = 50 apart, L = 5000 over a screen 1000 wide that is seen from straight above; λ = 1."""
    return {
        "type": "scene",
        "integrator": {"type": "wave", "wavelength": 1.0},
        "screen": {"type": "rectangle", "to_world": T().scale(2000), "bsdf": {"type": "diffuse"}},
        "a": {"type": "coherent_point", "position": [-25, 0, 5000], "amplitude": 1e3},
        "b": {"type": "coherent_point", "position": [25, 0, 5000], "amplitude": 1e3},
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, 100], [0, 0, 0], [0, 1, 0]).scale([500, 500, 1]),
            "film": {"type": "hdrfilm", "width": width, "height": 8, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 64},
        },
    }


def test_youngs_fringes_in_a_picture_are_spaced_lambda_l_over_s():
    """λL/s = 100 of the screen's 1000 units: the picture's strongest period, by its Fourier transform."""
    width = 500
    data = grimaldi.render(young(width), spp=16, size=(width, 8))
    profile = data.picture.values[..., 0].mean(axis=0)
    spectrum = np.abs(np.fft.rfft(profile - profile.mean(), n=width * 64))
    period = 1000 / width * (width * 64) / np.argmax(spectrum)
    assert period == pytest.approx(100, rel=5e-3)
    # full contrast: dark where the paths differ by half a wavelength
    assert profile.min() < 0.01 * profile.max()


def test_without_interference_there_are_no_fringes():
    data = grimaldi.render(young(), spp=16, interference=False)
    assert list(data.group.values) == ["a", "b"]
    profile = data.picture.values[..., 0].mean(axis=0)
    assert np.ptp(profile) < 0.02 * profile.mean()  # cos θ alone varies by 1 % over the screen


def test_intensity_is_eq_3_of_the_layers_where_pixels_are_small():
    data = grimaldi.render(young(2000), spp=1)
    power = (np.abs(data.U.values) ** 2).sum(axis=(0, 1))
    np.testing.assert_allclose(data.intensity.values, power, rtol=1e-5)


def test_a_tile_equals_the_same_pixels_of_the_whole_bit_for_bit():
    dictionary = room({"type": "wave", "wavelength": 0.02})
    whole = grimaldi.render(dictionary, spp=8, seed=7)
    scene = grimaldi.load(dictionary)
    sensor = scene.mitsuba.sensors()[0]
    light = prepare(scene, Settings(wavelength=0.02))
    shot = Shot(48, 40, 8, 7, 2, 5, False)
    (band,) = bands(light, sensor, shot)
    tile = render_tile(light, sensor, shot, 48 * 13 + 5, 96, band)
    pixels = slice(48 * 13 + 5, 48 * 13 + 5 + 96)
    np.testing.assert_array_equal(tile.picture.T, whole.picture.values.reshape(-1, 3)[pixels])
    np.testing.assert_array_equal(tile.U[0].astype(np.complex64), whole.U.values.reshape(-1)[pixels])


@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
@pytest.mark.parametrize(("wavelength", "rounded"), [(0.02, True), (0.002, False)])
def test_phases_are_told_by_mitsubas_points_where_the_tolerance_allows(monkeypatch, wavelength, rounded):
    """U differs by less than that share of the tolerance, which its error holds; the picture does not."""
    tolerance, scene = 5e-2, room({"type": "wave", "wavelength": wavelength})
    most = light.PHASE * tolerance
    own = grimaldi.render(scene, spp=1, tolerance=tolerance)
    monkeypatch.setattr(light, "PHASE", 0.0)
    exact = grimaldi.render(scene, spp=1, tolerance=tolerance)
    off, more = abs(own.U.values - exact.U.values), own.error.values - exact.error.values
    if not rounded:
        assert off.max() == more.max() == 0
        return
    assert off.max() > 0
    assert (off <= 1.5 * more).all()  # |M| is up to 1.4
    assert more.max() < most * abs(exact.U.values).max()
    np.testing.assert_allclose(own.picture.values, exact.picture.values, rtol=1e-4, atol=1e-6)


@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
def test_errors_beside_the_sky_are_those_of_surfaces():
    """Nodes of cells that see nothing have none, whatever a model says of them."""
    data = grimaldi.render(room({"type": "wave", "wavelength": 0.02}), spp=1, tolerance=5e-2)
    sky = (data.U.values == 0).mean()
    assert 0 < sky < 1
    assert 0 < data.error.values.max() < 2 * 5e-2 * abs(data.U.values).max()


def test_layers_as_aovs_of_mitsubas_own_render():
    """U.<group> by name, bare and nested in `aov`; in a pixel far smaller than a fringe |U|² f cosθ is the picture."""
    integrator = {"type": "wave", "wavelength": 1.0, "groups": "0"}
    scene = mi.load_dict(young(2000))
    bare = mi.load_dict(integrator)
    assert bare.aov_names() == ["U.0.re", "U.0.im"]
    image = np.array(mi.render(scene, integrator=bare, spp=1))
    assert image.shape[2] == 5
    power = image[..., 3] ** 2 + image[..., 4] ** 2
    # a diffuse white-ish screen (0.5) 5000 below: f cosθ = 0.5/π cosθ, θ <= 5.8°
    np.testing.assert_allclose(image[..., 0], 0.5 / np.pi * power, rtol=6e-3, atol=1e-4 * power.max())
    nested = mi.load_dict({"type": "aov", "aovs": "p:position", "wave": integrator})
    assert np.isfinite(np.array(mi.render(scene, integrator=nested, spp=1))).all()


def test_scene_that_changes_is_prepared_anew():
    scene = mi.load_dict(young())
    wave = mi.load_dict({"type": "wave", "wavelength": 1.0})
    before = np.array(mi.render(scene, integrator=wave, spp=4, seed=1))
    params = mi.traverse(scene)
    key = "b.position"
    params[key] = mi.Point3d(25, 0, 5000.5)  # half a wavelength: dark becomes bright
    params.update()
    after = np.array(mi.render(scene, integrator=wave, spp=4, seed=1))
    middle = slice(47, 49)  # of a fringe 9.6 pixels wide
    assert after[:, middle].mean() < 0.2 * before[:, middle].mean()


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"wavelength": -1.0}, "wavelength"),
        ({"wavelength": [0.5, "0.5"]}, "given twice"),
        ({"interference": "no"}, "interference"),
        ({"precision": np.array([1, 2])}, "precision"),
        ({"diffraction": "boundry"}, "boundry"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"occlusion": "some"}, "occlusion"),
        ({"rim": "round"}, "rim"),
        ({"spp": 0}, "spp"),
        ({"size": (0, 4)}, "size"),
        ({"size": 5}, "size"),
        ({"size": (10.5, 4)}, "size"),
        ({"seed": -1}, "seed"),
        ({"max_depth": -3}, "max_depth"),
        ({"max_depth": 1 << 31}, "max_depth"),
        ({"tolerence": 1e-3}, "tolerance"),
    ],
)
def test_wrong_options_are_named(wrong, says):
    with pytest.raises(InputError, match=says) as caught:
        grimaldi.render(young(), **wrong)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("given", "means"), [(True, "graded"), (False, "none"), ("binary", "binary")])
def test_the_integrator_takes_what_render_takes(given, means):
    wave = mi.load_dict({"type": "wave", "wavelength": 1.0, "occlusion": given, "rim": "smooth"})
    options = wave.light_of.settings.options()
    assert (options.occlusion, options.rim) == (means, "smooth")
    with pytest.raises(RuntimeError, match="rim: 'round' is unknown"):
        mi.load_dict({"type": "wave", "wavelength": 1.0, "rim": "round"})


def test_numbers_of_numpy_are_numbers():
    of_numpy: Any = {"wavelength": np.array(10.0), "spp": np.int64(2), "seed": np.uint8(3), "size": np.array([24, 2])}
    plain = grimaldi.render(young(), wavelength=10.0, spp=2, seed=3, size=(24, 2))
    np.testing.assert_array_equal(grimaldi.render(young(), **of_numpy).U.values, plain.U.values)


SKY_AND_LAMPS = {
    "lamp": {"type": "point", "position": [2, 3, 4]},
    "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.3, 0.4, 0.5]}},
    "pane": {"type": "rectangle", "to_world": T().translate([0, 0, 5]), "emitter": {"type": "area"}},
    "globe": {"type": "sphere", "center": [-3, 0, 3], "radius": 0.3, "emitter": {"type": "area"}},
}


@pytest.mark.filterwarnings("ignore::grimaldi.errors.GrimaldiWarning")
def test_any_number_of_lights_may_be_ordinary():
    """The mean of the picture is Mitsuba's."""
    scene = mi.load_dict(room({"type": "path", "max_depth": 3}, **SKY_AND_LAMPS))
    expected = np.array(mi.render(scene, spp=256)).mean()
    ours = grimaldi.render(scene, wavelength=0.01, diffraction="none", max_depth=3, spp=256).picture.values.mean()
    assert ours == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    "sensor",
    [
        {"type": "radiancemeter", "origin": [0.3, 0.2, 30], "direction": [0, 0, -1]},
        {"type": "distant", "direction": [0, 0, -1], "target": [0, 0, 0]},
    ],
)
def test_a_sensor_may_have_a_single_ray(sensor):
    film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    dictionary = young() | {"sensor": sensor | {"film": film}}
    wave = grimaldi.render(dictionary, spp=4)
    flat = grimaldi.render(dictionary, spp=4, diffraction="none", interference=False)
    assert 0 < float(wave.picture.mean()) < 2.01 * float(flat.picture.mean())


def test_a_loaded_scene_is_of_its_variant():
    loaded = grimaldi.load(young())
    mi.set_variant("llvm_ad_mono")
    with pytest.raises(InputError, match="load it anew"):
        grimaldi.render(loaded)


def test_without_a_wavelength_one_is_suggested():
    dictionary = young()
    dictionary["integrator"] = {"type": "direct"}
    with pytest.raises(InputError, match="no wavelength; try") as caught:
        grimaldi.render(dictionary)
    suggested = float(str(caught.value).split("try ")[1].split(",")[0])
    # four pixels of 1000/96 units, fringes λL/s wide
    assert suggested == pytest.approx(4 * 1000 / 96 * 50 / 5000, rel=0.1)
