"""Whatever names a scene, as a checked `Scene`."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from grimaldi.conventions import did_you_mean
from grimaldi.errors import GrimaldiWarning, InputError
from grimaldi.one_at_a_time import one_at_a_time
from grimaldi.scene.bodies import blockers, sort_shapes
from grimaldi.scene.checking import check_nodes, check_scene
from grimaldi.scene.instances import write_out
from grimaldi.scene.joined import joined
from grimaldi.scene.messages import one_line
from grimaldi.scene.model import Joined, Scene
from grimaldi.scene.planar import PlanarOutline
from grimaldi.scene.smooth import check_levels, smooth_meshes
from grimaldi.scene.sources import sources
from grimaldi.scene.xml import DEEPEST, check_xml


@one_at_a_time
def load(
    scene: Any,
    *,
    outlines: Iterable[PlanarOutline] = (),
    scene_unit: str | None = None,
    coherent: Collection[str] = (),
    smooth: int = 0,
) -> Scene:
    """A checked scene: its opaque bodies, holes and sources in Float64, and the Mitsuba scene itself.

    Args:
        scene: path of a Mitsuba XML file or of a pbrt file (.pbrt, version 3 or 4); a Mitsuba scene dictionary;
            a `mi.Scene`; the name of a built-in scene; or a `Scene`, which is returned as it is unless outlines,
            a unit or levels are given.
        outlines: planar outlines to add, holes of the aperture screen or opaque masks.
        scene_unit: length of one scene unit, such as "1 um". Otherwise that of the scene itself: in XML
            `<string name="scene_unit" value="1 um"/>` directly in `<scene>`, in a dictionary the key
            "scene_unit" beside "type".
        coherent: ids of Mitsuba's `point`, `directional` and `spot` lights that join coherence group "0".
        smooth: levels, 0 to 6, by which meshes with vertex normals are divided into the curved surfaces that these
            stand for, each face into 4^smooth: for the camera, for rays, and for outlines.

    Where no Mitsuba variant is set, the best mono one that works is. What is returned is of that variant, and does not
    follow what changes in the Mitsuba scene later: load that anew.

    Raises:
        InputError: one line that names file and place, what is wrong there and the remedy.
        NotYet: bodies and apertures that cannot be computed together yet.

    Warns:
        GrimaldiWarning: naming what does not diffract yet, and edges shared by more than two faces.
    """
    check_levels(smooth)
    added = _outlines(outlines)
    if isinstance(scene, Scene):
        _check_variant(scene)
        loaded = replace(scene, sources=sources(scene.mitsuba, coherent=coherent)) if coherent else scene
        if not added and scene_unit is None and smooth == 0:
            return loaded
    else:
        loaded = _read(scene, coherent)
    loaded = replace(
        loaded,
        holes=(*loaded.holes, *(outline for outline in added if outline.hole)),
        masks=(*loaded.masks, *(outline for outline in added if not outline.hole)),
        unit=loaded.unit if scene_unit is None else scene_unit,
    )
    with _in_scene(loaded.name):
        loaded = _smoothed(loaded, smooth)
        check_scene(loaded)
    return joined(loaded) if isinstance(scene, (str, Path, Mapping)) else loaded  # all shapes of others stay in use


def _smoothed(scene: Scene, levels: int) -> Scene:
    """The scene with its bodies divided; sources and holes keep the shapes that they name."""
    finer = smooth_meshes(scene.mitsuba, levels)
    if finer is scene.mitsuba:
        return scene
    found = sort_shapes(finer.shapes())
    new = {body.shape: body for body in found.bodies}
    same = [isinstance(surface, Joined) for surface in scene.surfaces]  # they have no normals that they could bend by
    bodies = tuple(body if same[body.shape] else new[body.shape] for body in scene.bodies)
    surfaces = tuple(old if kept else s for old, kept, s in zip(scene.surfaces, same, found.surfaces, strict=True))
    return replace(
        scene,
        mitsuba=finer,
        blockers=blockers(finer, bodies),
        surfaces=surfaces,
        bodies=bodies,
        smooth=scene.smooth + levels,
    )


def _outlines(outlines: Iterable[PlanarOutline]) -> tuple[PlanarOutline, ...]:
    outlines = (outlines,) if isinstance(outlines, PlanarOutline) else tuple(outlines)
    for outline in outlines:
        if not isinstance(outline, PlanarOutline):
            raise InputError(f"outlines: {type(outline).__name__} is no PlanarOutline; make one of it first")
    return outlines


def _read(scene: Any, coherent: Collection[str]) -> Scene:
    """The scene with its bodies, holes and sources, not yet checked."""
    import mitsuba as mi

    from grimaldi.variants import ensure_variant

    ensure_variant("mono")
    name, mi_scene, unit = _open(scene)
    if not isinstance(mi_scene, mi.Scene):
        raise InputError(f"{name}: is a {type(mi_scene).__name__}, no scene of variant {mi.variant()}; give a scene")
    with _in_scene(name):
        shapes = sort_shapes(mi_scene.shapes())
        found = sources(mi_scene, coherent=coherent)
    if shapes.others:
        warnings.warn(f"{', '.join(shapes.others)}: does not diffract yet", GrimaldiWarning, stacklevel=4)
    return Scene(
        name=name,
        mitsuba=mi_scene,
        blockers=blockers(mi_scene, shapes.bodies),
        surfaces=shapes.surfaces,
        bodies=shapes.bodies,
        sources=found,
        holes=shapes.holes,
        unit=unit or _of_wave(mi_scene.integrator(), "scene_unit"),
        wavelength=_of_wave(mi_scene.integrator(), "wavelength"),
    )


def _of_wave(integrator: Any, name: str) -> Any:
    """A setting of a scene's own `wave` integrator; None of any other."""
    light_of = getattr(integrator, "light_of", None)
    return None if light_of is None else getattr(light_of.settings, name)


def _check_variant(scene: Scene) -> None:
    """InputError where a scene was loaded in another variant than that in use."""
    import mitsuba as mi

    if not isinstance(scene.mitsuba, mi.Scene):
        raise InputError(
            f"{scene.name}: was not loaded in variant {mi.variant()}; load it anew, or set its own variant"
        )


def _open(scene: Any) -> tuple[str, Any, str | None]:
    """Name, Mitsuba scene and unit."""
    if isinstance(scene, Mapping):
        return "scene", *_from_dict(dict(scene))
    if not isinstance(scene, (str, Path)):
        return "scene", scene, None
    path = Path(scene)
    if path.is_file() and path.suffix.lower() == ".pbrt":
        return path.name, *_from_pbrt(path)
    if path.is_file():
        return path.name, *_from_file(path)
    return str(scene), *_from_dict(_builtin(str(scene)))


def _builtin(name: str) -> dict[str, Any]:
    from grimaldi.scene import builtin

    names = sorted(builtin.names())
    if name in names:
        return builtin.build(name)
    if Path(name).is_dir():
        raise InputError(f"{name}: is a folder; name the scene's XML file in it")
    advice = did_you_mean(name, names, otherwise=f"built-in scenes are {', '.join(names)}")
    raise InputError(f"{name}: no such file or built-in scene; {advice}")


def _from_file(path: Path) -> tuple[Any, str | None]:
    import mitsuba as mi

    check_xml(path)
    config = _config()
    with _searching(path.parent), _mitsuba_errors():
        return _instantiate(config, mi.parser.parse_file(config, str(path)))


def _from_pbrt(path: Path) -> tuple[Any, str | None]:
    from grimaldi.scene import pbrt

    scene, left_out = pbrt.read(path)
    if left_out:
        what = ", ".join(f"{name} (line {line})" for name, line in left_out.items())
        warnings.warn(f"{path.name}: left out: {what}", GrimaldiWarning, stacklevel=6)
    return _from_dict(scene)


def _from_dict(scene: dict[str, Any]) -> tuple[Any, str | None]:
    import mitsuba as mi

    _check_depth(scene)
    config = _config()
    with _mitsuba_errors():
        return _instantiate(config, mi.parser.parse_dict(config, scene))


def _config() -> Any:
    """Without merging, which would make one nameless mesh of the two rectangles of a double slit."""
    import mitsuba as mi

    config = mi.parser.ParserConfig(str(mi.variant()))
    config.merge_meshes = config.merge_equivalent = False
    return config


def _instantiate(config: Any, state: Any) -> tuple[Any, str | None]:
    import mitsuba as mi

    unit = state.root.props.get("scene_unit", None)
    if unit is not None:
        if not isinstance(unit, str):
            raise InputError(f"scene_unit: {unit!r} has no unit; write it like '1 um'")
        del state.root.props["scene_unit"]
    mi.parser.transform_all(config, state)
    write_out(state)
    check_nodes(state)
    return mi.parser.instantiate(config, state), unit


def _check_depth(scene: dict[str, Any]) -> None:
    level: list[Any] = [scene]
    for _ in range(DEEPEST):
        level = [value for node in level for value in node.values() if isinstance(value, dict)]
        if not level:
            return
    raise InputError(f"scene: dictionaries nested deeper than {DEEPEST}; flatten the scene")


@contextmanager
def _searching(folder: Path) -> Iterator[None]:
    """Has Mitsuba look for files in `folder` first."""
    import mitsuba

    mi: Any = mitsuba  # the stubs misplace these functions
    before = mi.file_resolver()
    resolver = mi.FileResolver(before)
    resolver.prepend(str(folder))
    mi.set_file_resolver(resolver)
    try:
        yield
    finally:
        mi.set_file_resolver(before)


@contextmanager
def _in_scene(name: str) -> Iterator[None]:
    """Puts the scene's name before what is wrong with one of its parts."""
    try:
        yield
    except InputError as error:
        raise type(error)(f"{name}: {error}") from error


@contextmanager
def _mitsuba_errors() -> Iterator[None]:
    """Mitsuba's errors as InputError."""
    try:
        yield
    except InputError:
        raise
    except (RuntimeError, TypeError, ValueError) as error:
        raise InputError(one_line(error)) from error
