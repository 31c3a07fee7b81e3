"""The whole method on one screen: scene → sources → outlines → boundary integral → U at points → coherence."""

from __future__ import annotations

from inspect import signature
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grimaldi.errors import InputError
from grimaldi.one_at_a_time import one_at_a_time
from grimaldi.options import checked_options, describe
from grimaldi.scene.triangles import LARGEST

if TYPE_CHECKING:
    import xarray as xr

Summed = dict[tuple[int, ...], NDArray[Any]]  # numbers of all points, by wavelength or by that and group


@one_at_a_time
def field(
    scene: Any,
    points: ArrayLike,
    *,
    wavelength: Any = None,
    scene_unit: str | None = None,
    diffraction: str = "boundary",
    interference: bool = True,
    tolerance: float = 1e-3,
    precision: Literal["auto", "double"] = "auto",
    occlusion: bool | Literal["graded", "binary", "none"] = True,
    rim: Literal["sharp", "smooth"] = "sharp",
    n: int | Literal["nyquist"] | None = None,
    weights: Literal["report", "length", "kernel"] = "report",
    epsilon: float | None = None,
    fast: bool = True,
    smooth: int = 0,
    **unknown: Any,
) -> xr.Dataset:
    """The complex field of a scene's sources at points.

    Args:
        scene: path, dict, `mi.Scene`, name of a built-in scene, or what `grimaldi.load` returned.
        points: (n, 3) float64, in scene units. A point on a surface is taken on the side that the source is on.
        wavelength: one or several, > 0; numbers in scene units, or text with units ("532 nm", "450 nm, 550 nm").
            That of the scene's own `wave` integrator, if it has one, unless given.
        scene_unit: length of one scene unit, such as "1 um"; needed where the wavelength has a unit.
        diffraction: "boundary" (THEORY eq. 4-6), "huygens" (sources along silhouettes, THEORY 4), "area" (brute-force
            sum over the open area), or "none" (shadow rays).
        interference: whether sources of one coherence group add their fields; if not, each is its own group.
        tolerance: |M_computed - M| allowed for each source and point, where U = U0 M: the error of integrating the
            stated model, not of the model.
        precision: "auto" (Float32 sums where the tolerance allows), or "double".
        occlusion: how bodies block the way from an outline to a point. True or "graded": of "boundary", by Fresnel's
            factor where it grazes another silhouette; "binary": by yes or no; False or "none": not at all.
        rim: how "boundary" takes the rims of smooth bodies: "sharp", as those of black screens, or "smooth", with waves
            into the shadow damped like creeping waves (spheres, cylinders, meshes that bend by less than 30° an edge).
        n: sources an edge of "huygens" (3 unless given; "nyquist": at most λ/2 apart); random samples a point of
            "area", which unless given integrates by quadrature.
        weights: of the sources of "huygens": "report" (equal strength), "length" or "kernel" (which converges to
            "boundary" as n grows).
        epsilon: how far beside an edge the silhouette test of "report" looks [scene units]; 2e-4 of the body's size
            unless given.
        fast: whether "boundary" may sum points on a plane behind holes or masks by one non-uniform FFT (Barnett,
            JATIS 7(2) 021211) where the bound of its error, or an estimate from 16 of the points, is within
            `tolerance` and it is expected to be faster. False: always along the outlines.
        smooth: levels by which meshes with vertex normals are divided, as in `grimaldi.load`.

    Returns:
        Dataset with `U` complex128 (wavelength, group, point) by eq. 1-2 and 4-6, `intensity` float64 (point) by
        eq. 3, `error` float64 (wavelength, group, point), the estimated |U_computed - U|, and coordinates x, y, z.

    Raises:
        InputError: one line naming what is wrong and what to do.

    Warns:
        GrimaldiWarning: the tolerance is not reached somewhere; most of the light is fainter than a few tolerances.
    """
    import xarray as xr

    from grimaldi.accuracy import Misses, warn_of_faint_light
    from grimaldi.coherence import groups, intensity, separated
    from grimaldi.conventions import check_options, checked_flag, parse_wavelengths
    from grimaldi.diffraction import model
    from grimaldi.engine.progress import progress
    from grimaldi.propagate import propagate_all
    from grimaldi.scene import load
    from grimaldi.scene.checking import require_sources

    check_options(unknown, signature(field).parameters)
    p = checked_points(points)
    options = checked_options(
        tolerance=tolerance,
        precision=precision,
        occlusion=occlusion,
        rim=rim,
        n=n,
        weights=weights,
        epsilon=epsilon,
        fast=fast,
    )
    factor = model(diffraction)
    loaded = load(scene, scene_unit=scene_unit, smooth=smooth)
    wavelengths = parse_wavelengths(loaded.wavelength if wavelength is None else wavelength, loaded.unit)
    require_sources(loaded)
    sources = loaded.sources if checked_flag("interference", interference) else separated(loaded.sources)

    names = groups(sources)
    fields: Summed = {}
    errors: Summed = {}
    frees: Summed = {}
    misses = Misses(options.tolerance)
    with progress(len(wavelengths) * len(sources) * len(p), "field") as advance:
        for i, length in enumerate(wavelengths):
            for source in sources:
                of = i, names.index(source.group)
                for part in propagate_all(loaded, source, factor, 2 * np.pi / length, options, p):
                    for sums, place, values in (fields, of, part.U), (errors, of, part.error), (frees, (i,), part.free):
                        sums[place] = _plus(sums.get(place), part.which, values, len(p))
                    misses.add(source, p[part.which], part.error, part.free)
                    advance(len(part.U))
    each = (len(wavelengths), len(names))
    U, error = _stacked(fields, each, len(p), complex), _stacked(errors, each, len(p), float)
    if diffraction == "boundary":
        misses.warn(loaded)
        warn_of_faint_light(U, _stacked(frees, each[:1], len(p), float), options.tolerance)
    data = {
        "U": (("wavelength", "group", "point"), U),
        "intensity": ("point", intensity(U)),
        "error": (("wavelength", "group", "point"), error),
    }
    coords = {"wavelength": list(wavelengths), "group": list(names)}
    coords |= {axis: ("point", p[:, i]) for i, axis in enumerate("xyz")}
    attrs = describe(loaded, diffraction=diffraction, interference=interference, options=options)
    return xr.Dataset(data, coords, attrs)


def _plus(total: NDArray[Any] | None, which: Any, values: NDArray[Any], n: int) -> NDArray[Any]:
    """`total` (n,), zeros if None, and `values` at some points; `values` themselves where they are all there is."""
    if total is None:
        if isinstance(which, slice) and len(values) == n:
            return values
        total = np.zeros(n, values.dtype)
    total[which] += values
    return total


def _stacked(sums: Summed, shape: tuple[int, ...], n: int, kind: type) -> NDArray[Any]:
    """The sums of n points each, at the places of an array of a shape; zeros where there are none."""
    each = [sums[place] if place in sums else np.zeros(n, kind) for place in np.ndindex(shape)]
    return (each[0] if len(each) == 1 else np.stack(each)).reshape(*shape, n)


def checked_points(points: ArrayLike) -> NDArray[np.float64]:
    """A copy of points as (n, 3) float64, column by column; InputError where they are not that, or out of reach."""
    from grimaldi.diffraction.arrays import aligned_empty
    from grimaldi.parts import parts

    p = real(points, "points")
    if p.shape == (3,):
        p = p[None]
    if p.ndim != 2 or p.shape[1] != 3:
        raise InputError(f"points: shape {p.shape} is not (n, 3); give one x, y, z to a row")
    columns = aligned_empty(p.size, np.float64).reshape(3, -1)
    for some in parts(len(p)):
        columns[:, some] = p[some].T
        if not (np.abs(columns[:, some]) <= LARGEST).all():
            row = int(np.flatnonzero(~(np.abs(p) <= LARGEST).all(axis=1))[0])
            what = f"further than {LARGEST:g} away" if np.isfinite(p[row]).all() else "not finite"
            raise InputError(f"points: row {row} is {what}; give points of the scene")
    return columns.T


def real(values: Any, name: str) -> NDArray[np.float64]:
    """Real numbers in Float64; InputError for what is something else: complex numbers, times, flags, text, gaps."""
    try:
        array = np.asarray(values)
        if array.dtype.kind in "iufO" and not np.ma.is_masked(values):
            return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InputError(f"{name}: not real numbers, or not all; give an array of shape (n, 3)")
