"""Pictures: the integrator `wave` run tile by tile, with every layer of the result."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from inspect import signature
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from grimaldi.conventions import LONGEST_PATH, check_options, whole
from grimaldi.errors import GrimaldiWarning, InputError
from grimaldi.film.layers import Layers
from grimaldi.one_at_a_time import one_at_a_time
from grimaldi.options import Settings, describe

if TYPE_CHECKING:
    import xarray as xr

    from grimaldi.engine.means import Tile
    from grimaldi.engine.tiles import Shot
    from grimaldi.light import Light
    from grimaldi.scene.model import Scene

SAMPLES = 1 << 20  # a pixel, at most


@one_at_a_time
def render(
    scene: Any,
    *,
    wavelength: Any = None,
    scene_unit: str | None = None,
    spp: int | None = None,
    seed: int = 0,
    size: tuple[int, int] | None = None,
    diffraction: str | None = None,
    interference: bool | None = None,
    tolerance: float | None = None,
    precision: Literal["auto", "double"] | None = None,
    occlusion: bool | Literal["graded", "binary", "none"] | None = None,
    rim: Literal["sharp", "smooth"] | None = None,
    n: int | Literal["nyquist"] | None = None,
    weights: Literal["report", "length", "kernel"] | None = None,
    epsilon: float | None = None,
    fast: bool | None = None,
    max_depth: int | None = None,
    smooth: int = 0,
    **unknown: Any,
) -> xr.Dataset:
    """Render a scene with interference and diffraction.

    What is left out comes from the scene's own integrator where that is `wave`, and from its sensor and film.
    Samples are independent and pixels are boxes, whatever the film's filter: the same seed gives the same picture
    bit for bit on one type of CPU.

    Args:
        scene: path, dict, `mi.Scene`, name of a built-in scene, or what `grimaldi.load` returned.
        wavelength, scene_unit, diffraction, interference, tolerance, precision, occlusion, rim, n, weights, epsilon,
            smooth: as in `grimaldi.field`.
        spp: samples a pixel.
        seed: of the random numbers.
        size: (width, height) in pixels.
        fast: whether M may be interpolated over the film, within the tolerance (default: true); if not, it is asked
            for at every sample.
        max_depth: longest path from the camera; 2 is direct light, -1 no limit.

    Returns:
        Dataset with `picture` float32 (y, x, channel), linear radiance; `U` complex64 (wavelength, group, y, x), the
        mean field at what each pixel sees first (0 where it sees nothing), in units of √irradiance; `intensity`
        float32 (y, x), the mean of eq. 3; `error` float32 (wavelength, group, y, x), the mean estimated error of U.

    Raises:
        InputError: one line naming what is wrong and what to do; without a wavelength it suggests one.

    Warns:
        GrimaldiWarning: fringes finer than a pixel; emitters and shapes that do not diffract yet.
    """
    check_options(unknown, signature(render).parameters)
    asked = {
        "wavelength": wavelength,
        "scene_unit": scene_unit,
        "diffraction": diffraction,
        "interference": interference,
        "tolerance": tolerance,
        "precision": precision,
        "occlusion": occlusion,
        "rim": rim,
        "n": n,
        "weights": weights,
        "epsilon": epsilon,
        "fast": fast,
    }
    given = {name: value for name, value in asked.items() if value is not None}
    return layers(scene, given, spp=spp, seed=seed, size=size, max_depth=max_depth, smooth=smooth).dataset()


def layers(
    scene: Any,
    given: Mapping[str, Any],
    *,
    spp: int | None = None,
    seed: int = 0,
    size: tuple[int, int] | None = None,
    max_depth: int | None = None,
    smooth: int = 0,
) -> Layers:
    """What `render` returns, as plain arrays; given: those of `Settings` that differ from the scene's own."""
    from grimaldi.engine.progress import progress
    from grimaldi.engine.tiles import bands, render_tile, tiles
    from grimaldi.fringes import warn_of_fine_fringes
    from grimaldi.light import prepare
    from grimaldi.scene import load
    from grimaldi.scene.checking import require_sensor, require_sources
    from grimaldi.variants import ensure_variant

    ensure_variant("rgb")
    loaded = load(scene, scene_unit=given.get("scene_unit"), smooth=smooth)
    require_sensor(loaded)
    require_sources(loaded)
    own = _integrator(loaded)
    settings = replace(_settings(own), **given)
    settings.check()
    if settings.coherent:
        loaded = load(loaded, coherent=settings.coherent)
    sensor = loaded.mitsuba.sensors()[0]
    with resized(sensor, size):
        settings = _with_wavelength(settings, loaded, sensor)
        shot = shot_of(sensor, own, spp, seed, max_depth)
        light = prepare(loaded, settings)
        warn_of_fine_fringes(loaded, sensor, [wavelength for wavelength, _ in light.keys])
        done: list[Tile] = []
        with progress(shot.width * shot.height, "render") as advance:
            for band in bands(light, sensor, shot):
                for first, pixels in tiles(light, shot, band):
                    done.append(render_tile(light, sensor, shot, first, pixels, band))
                    advance(pixels)
    return _side_by_side(loaded, light, settings, shot, done)


def _integrator(scene: Scene) -> Any:
    """The scene's own integrator if it is `wave`, else None."""
    own = scene.mitsuba.integrator()
    return own if hasattr(own, "light_of") else None


def _settings(own: Any) -> Settings:
    return Settings() if own is None else own.light_of.settings


def _with_wavelength(settings: Settings, scene: Scene, sensor: Any) -> Settings:
    """The settings, if they have a wavelength; else an InputError that suggests one."""
    from grimaldi.fringes import suggested_wavelength

    if settings.wavelength is not None:
        return settings
    suggestion = suggested_wavelength(scene, sensor)
    advice = "give one" if suggestion is None else f"try {suggestion:.2g}, whose fringes are about four pixels wide"
    raise InputError(f"{scene.name}: no wavelength; {advice} (wavelength=…, --wavelength …, in scene units)")


@contextmanager
def resized(sensor: Any, size: tuple[int, int] | None) -> Iterator[None]:
    """The sensor with a film of another size, put back afterwards."""
    import mitsuba as mi

    from grimaldi.scene.checking import LARGEST_FILM

    if size is None:
        yield
        return
    sides = tuple(whole(side) or 0 for side in size) if isinstance(size, Iterable) else ()
    if len(sides) != 2 or min(sides) < 1 or sides[0] * sides[1] > LARGEST_FILM:
        raise InputError(f"size: {size!r} is no film size; give (width, height) in pixels, at most 2^28 in all")
    params: Any = mi.traverse(sensor)
    names = ("film.size", "film.crop_size", "film.crop_offset")
    before = {name: list(params[name]) for name in names}

    def change(size: Any, crop: Any, offset: Any) -> None:
        for name, value in zip(names, (size, crop, offset), strict=True):
            params[name] = mi.ScalarPoint2u(*(int(v) for v in value))
        params.update()

    change(sides, sides, (0, 0))
    try:
        yield
    finally:
        change(*before.values())


def shot_of(sensor: Any, own: Any, spp: int | None, seed: int, max_depth: int | None) -> Shot:
    """Film and sampling from the sensor, paths from the `wave` integrator, unless told otherwise."""
    from grimaldi.engine.tiles import Shot

    width, height = (int(v) for v in sensor.film().crop_size())
    count = sensor.sampler().sample_count() if spp is None else spp
    depth = max_depth if max_depth is not None else (own.max_depth if own is not None else 2)
    samples = _whole("spp", count, 1, SAMPLES, f"number of samples; give 1 to {SAMPLES}, such as 16")
    seed = _whole("seed", seed, 0, (1 << 32) - 1, "seed; give an integer from 0 to 2^32 - 1")
    depth = _whole("max_depth", depth, -1, LONGEST_PATH, "path length; give 2 for direct light, -1 for no limit")
    rr_depth, hidden = (own.rr_depth, own.hidden) if own is not None else (5, False)
    return Shot(width, height, samples, seed, depth, rr_depth, hidden)


def _whole(name: str, value: Any, least: int, most: int, what: str) -> int:
    """A whole number within limits; InputError saying `what` it is not."""
    number = whole(value)
    if number is None or not least <= number <= most:
        raise InputError(f"{name}: {value!r} is no {what}")
    return number


def _side_by_side(scene: Scene, light: Light, settings: Settings, shot: Shot, done: list[Tile]) -> Layers:
    """The tiles together, with their coordinates and a description."""
    wavelengths = tuple(dict.fromkeys(wavelength for wavelength, _ in light.keys))
    names = tuple(dict.fromkeys(group for _, group in light.keys))
    image = shot.height, shot.width
    of_field = len(wavelengths), len(names), *image
    picture = np.concatenate([tile.picture for tile in done], axis=1)
    lost = sum(tile.lost for tile in done)
    if lost:
        warnings.warn(f"{lost} samples were not finite and are left out", GrimaldiWarning, stacklevel=5)
    attrs = describe(
        scene,
        diffraction=settings.diffraction,
        interference=settings.interference,
        options=settings.options(),
    )
    attrs |= {"wavelength": list(wavelengths), "spp": shot.spp, "seed": shot.seed, "non_finite": lost}
    return Layers(
        np.moveaxis(picture.reshape(-1, *image), 0, 2),
        np.concatenate([tile.U for tile in done], axis=1).reshape(of_field),
        np.concatenate([tile.intensity for tile in done]).reshape(image),
        np.concatenate([tile.error for tile in done], axis=1).reshape(of_field),
        {1: ("L",), 3: ("R", "G", "B")}[len(picture)],
        wavelengths,
        names,
        attrs,
    )
