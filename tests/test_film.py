"""Files: what was rendered comes back exactly, and phases have the colours they should."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
import xarray as xr
from matplotlib.image import imread

from grimaldi import film
from grimaldi.errors import InputError
from grimaldi.film import phase
from grimaldi.film.colour import automatic_exposure, decode_srgb, encode_srgb
from grimaldi.film.layers import Layers


def rendered(*, channels=("R", "G", "B"), wavelengths=(0.4,), groups=("0", "lamp"), size=(5, 7)):
    random = np.random.default_rng(1)
    field = random.normal(size=(len(wavelengths), len(groups), *size, 2)).astype(np.float32)
    field = field.view(np.complex64)[..., 0]
    field[..., 0, 0] = 0
    return xr.Dataset(
        {
            "picture": (("y", "x", "channel"), random.random((*size, len(channels)), dtype=np.float32)),
            "U": (("wavelength", "group", "y", "x"), field),
            "intensity": (("y", "x"), (abs(field) ** 2).sum((0, 1))),
            "error": (("wavelength", "group", "y", "x"), 1e-3 * random.random(field.shape, dtype=np.float32)),
        },
        coords={"channel": list(channels), "wavelength": list(wavelengths), "group": list(groups)},
        attrs={
            "wavelength": list(wavelengths),
            "scene_unit": "1 um",
            "time_convention": "exp(-i omega t)",
            "tolerance": 1e-3,
            "interference": True,
            "non_finite": 3,
            "spp": 16,
        },
    )


def read(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: c.pixels for name, c in file.channels().items()}, dict(file.header())


def test_exr_gives_every_layer_back_exactly(tmp_path):
    data = rendered()
    film.write(data, tmp_path / "a.exr")
    layers, header = read(tmp_path / "a.exr")
    assert set(layers) == {
        *("R", "G", "B", "intensity", "phase", "error"),
        *("U.0.re", "U.0.im", "U.lamp.re", "U.lamp.im"),
    }
    assert all(layer.dtype == np.float32 for layer in layers.values())
    for c in "RGB":
        np.testing.assert_array_equal(layers[c], data.picture.sel(channel=c))
    for group in ("0", "lamp"):
        field = layers[f"U.{group}.re"] + 1j * layers[f"U.{group}.im"]
        np.testing.assert_array_equal(field, data.U.sel(group=group)[0])
    np.testing.assert_array_equal(layers["phase"], np.angle(data.U.sel(group="0")[0]))
    np.testing.assert_array_equal(layers["intensity"], data.intensity)
    np.testing.assert_array_equal(layers["error"], data.error.max(("wavelength", "group")))
    assert header["wavelength"] == "0.4"
    assert header["scene_unit"] == "1 um"
    assert header["time_convention"] == "exp(-i omega t)"
    assert "arg U" in header["phase_convention"]
    assert float(header["max_error"]) == float(data.error.max())
    assert header["non_finite"] == 3
    assert header["interference"] == "true"
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_exr_of_several_wavelengths_in_mono(tmp_path):
    data = rendered(channels=("L",), wavelengths=(0.45, 0.55), groups=("0",))
    film.write(data, tmp_path / "a.exr")
    layers, header = read(tmp_path / "a.exr")
    for c in "RGB":
        np.testing.assert_array_equal(layers[c], data.picture.sel(channel="L"))
    field = layers["U.0.1.re"] + 1j * layers["U.0.1.im"]
    np.testing.assert_array_equal(field, data.U.sel(group="0", wavelength=0.55))
    assert header["wavelength"] == "0.45, 0.55"


def test_files_are_the_same_of_a_dataset_in_any_order_and_of_its_plain_arrays(tmp_path):
    data = rendered()
    data["error"][0, 0, 1, 2] = np.nan  # where no error is known
    layers = Layers.of(data)
    xr.testing.assert_identical(layers.dataset(), data)
    for name, given in {"a": data, "b": layers, "c": data.transpose("channel", "x", "y", ...)}.items():
        film.write(given, tmp_path / f"{name}.exr")
        film.write(given, tmp_path / f"{name}.png", "phase-intensity")
    for suffix in ("exr", "png"):
        first, *others = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in "abc")
        assert others == [first, first]
    written, header = read(tmp_path / "a.exr")
    np.testing.assert_array_equal(written["error"], data.error.max(("wavelength", "group")))
    assert float(header["max_error"]) == float(data.error.max())


def test_exposure_takes_the_99th_percentile_of_what_is_lit_to_nine_tenths():
    lit = np.linspace(0.01, 5, 1000)
    factor = automatic_exposure(lit)
    assert np.percentile(lit * factor, 99) == pytest.approx(0.9)
    assert automatic_exposure(np.concatenate([lit, np.zeros(5000)])) == factor
    assert automatic_exposure(np.zeros(4)) == 1.0


def test_srgb_curve():
    assert encode_srgb([0.0, 0.0031308, 0.214041, 1.0, 7.0]) == pytest.approx([0.0, 0.04045, 0.5, 1.0, 1.0], abs=1e-5)
    x = np.linspace(0, 1, 101)
    np.testing.assert_allclose(decode_srgb(encode_srgb(x)), x, atol=1e-7)


def test_two_pictures_of_one_exposure_compare(tmp_path):
    bright = rendered()
    dim = bright.assign(picture=bright.picture / 2)
    exposure = automatic_exposure(bright.picture)
    film.write(bright, tmp_path / "a.png", exposure=exposure)
    film.write(dim, tmp_path / "b.png", exposure=exposure)
    a, b = (decode_srgb(imread(tmp_path / name)[..., :3]) for name in ("a.png", "b.png"))
    unclipped = a.max(axis=-1) < 1
    np.testing.assert_allclose(b[unclipped], a[unclipped] / 2, atol=0.006)


def test_phase_is_red_in_the_first_half_turn_and_blue_in_the_second():
    field = 3 * np.exp(1j * np.array([0.0, 0.1, 1.5, 3.1, 3.2, 4.7, 6.2, -0.1]))
    np.testing.assert_array_equal(
        phase.two_colours(field), [phase.RED] * 4 + [phase.BLUE] * 4, err_msg="red 0..π, blue π..2π"
    )
    np.testing.assert_array_equal(phase.two_colours(np.array([0j, 1.0])), [(0, 0, 0), phase.RED])


def test_cyclic_phase_has_even_steps_and_none_at_a_full_turn():
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 721))
    colours = phase.cyclic(turn)
    np.testing.assert_allclose(colours[0], colours[-1], atol=1e-12)
    steps = np.linalg.norm(np.diff(colours, axis=0), axis=1)
    assert steps.max() < 0.02
    assert steps.min() > 0
    around_zero = phase.cyclic(np.exp(1j * np.array([-1e-9, 0.0, 1e-9])))
    assert np.ptp(around_zero, axis=0).max() < 1e-6
    assert phase.cyclic(np.array([-1e-30j + 1])) == pytest.approx(colours[:1], abs=1e-9)


def test_phase_views(tmp_path):
    data = rendered()
    red = np.angle(data.U.values[0, 0]) >= 0
    red[0, 0] = False
    for view in ("phase", "phase-cyclic", "phase-intensity"):
        film.write(data, tmp_path / f"{view}.png", view=view)
    plain, cyclic, lit = (imread(tmp_path / f"{v}.png") for v in ("phase", "phase-cyclic", "phase-intensity"))
    np.testing.assert_array_equal(plain[..., 0] == 1, red)
    assert plain[0, 0, :3].max() == 0
    assert cyclic.shape[:2] == data.intensity.shape
    hue = lit[..., :3].argmax(-1)
    np.testing.assert_array_equal(hue[1:] == 0, red[1:])
    exposed = automatic_exposure(data.intensity) * data.intensity.values
    np.testing.assert_allclose(lit[1:, :, :3].max(-1), encode_srgb(exposed[1:]), atol=0.003)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("a.jpg", {}, ".exr or .png"),
        ("a.png", {"view": "phaze"}, "'phase'"),
        ("a.exr", {"view": "phase"}, ".png"),
        ("missing/a.png", {}, "does not exist"),
        ("missing/a.exr", {}, "does not exist"),
        ("a.png", {"exposure": float("nan")}, "positive"),
    ],
)
def test_wrong_input_is_one_clear_line_and_leaves_nothing(tmp_path, name, options, words):
    with pytest.raises(InputError, match=words) as caught:
        film.write(rendered(), tmp_path / name, **options)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file(tmp_path):
    (tmp_path / "a.exr").write_bytes(b"old")
    with pytest.raises(ValueError, match="shape"):
        film.write(replace(Layers.of(rendered()), intensity=np.zeros((2, 2), np.float32)), tmp_path / "a.exr")
    assert (tmp_path / "a.exr").read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1
