"""pbrt scenes, of versions 3 and 4: directives and the graphics state they change (pbrt.org/fileformat-v3, -v4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from grimaldi.conventions import did_you_mean
from grimaldi.scene.pbrt import lights, transforms
from grimaldi.scene.pbrt.camera import Shot
from grimaldi.scene.pbrt.materials import GREY, material, rgb, texture
from grimaldi.scene.pbrt.parameters import Parameters
from grimaldi.scene.pbrt.shapes import Shape
from grimaldi.scene.pbrt.tokens import Place, Token, tokens
from grimaldi.scene.pbrt.transforms import Reals
from grimaldi.scene.triangles import LARGEST

DEEPEST = 64  # files that include each other
MATTE: dict[str, Any] = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(GREY)}}

# How many numbers, or how many texts and whether parameters, follow a directive.
_NUMBERS = {
    "Translate": 3, "Scale": 3, "Rotate": 4, "LookAt": 9, "Transform": 16, "ConcatTransform": 16, "TransformTimes": 2,
}  # fmt: skip
_TEXTS = {
    "Identity": 0, "WorldBegin": 0, "WorldEnd": 0, "AttributeBegin": 0, "AttributeEnd": 0, "TransformBegin": 0,
    "TransformEnd": 0, "ObjectEnd": 0, "ReverseOrientation": 0, "CoordinateSystem": 1, "CoordSysTransform": 1,
    "NamedMaterial": 1, "ObjectBegin": 1, "ObjectInstance": 1, "Include": 1, "Import": 1, "ColorSpace": 1,
    "Camera": 1, "Film": 1, "Sampler": 1, "Integrator": 1, "SurfaceIntegrator": 1, "VolumeIntegrator": 1,
    "PixelFilter": 1, "Accelerator": 1, "Renderer": 1, "Material": 1, "MakeNamedMaterial": 1, "MakeNamedMedium": 1,
    "LightSource": 1, "AreaLightSource": 1, "Shape": 1, "Texture": 3, "MediumInterface": 2, "Attribute": 1,
    "Option": 0, "ActiveTransform": 0,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class State:
    """The graphics state that AttributeBegin keeps and AttributeEnd brings back."""

    to_world: Reals = field(default_factory=lambda: np.eye(4))
    bsdf: dict[str, Any] = field(default_factory=lambda: MATTE)
    radiance: Reals | None = None
    reversed: bool = False


@dataclass
class Reader:
    """What has been read so far."""

    path: Path
    state: State = field(default_factory=State)
    stack: list[tuple[State, str, Place]] = field(default_factory=list)
    shot: Shot = field(default_factory=Shot)
    systems: dict[str, Reals] = field(default_factory=dict)
    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    textures: dict[str, Any] = field(default_factory=dict)
    objects: dict[str, list[Shape]] = field(default_factory=dict)
    open_object: str | None = None
    scene: dict[str, Any] = field(default_factory=lambda: {"type": "scene"})
    left_out: dict[str, int] = field(default_factory=dict)  # what, and the line where it is first

    # -------------------------- Files --------------------------

    def read(self, path: Path, depth: int = 0) -> None:
        """Carry out the directives of a file."""
        rest = _Cursor(tokens(path))
        while (token := rest.take()) is not None:
            if token.kind != "word" or token.text not in _NUMBERS.keys() | _TEXTS.keys():
                advice = did_you_mean(token.text, [*_NUMBERS, *_TEXTS], otherwise="is this a pbrt scene?")
                raise token.place.error(f"{token.text[:40]!r} is no directive; {advice}")
            if token.text in _NUMBERS:
                self._transform(token, rest.numbers(_NUMBERS[token.text], token))
                continue
            names = rest.texts(_TEXTS[token.text], token)
            if token.text == "ActiveTransform":
                rest.take()  # StartTime, EndTime or All
            if token.text in ("Include", "Import"):
                file = self.path.parent / names[0]
                if not file.is_file():
                    raise token.place.error(f"file {names[0]!r} not found; name it relative to the scene's folder")
                if depth == DEEPEST:
                    raise token.place.error(f"files included in each other more than {DEEPEST} deep; break the circle")
                self.read(file, depth + 1)
                continue
            self._directive(token, names, rest.parameters(token))

    def finish(self) -> dict[str, Any]:
        """The Mitsuba scene; InputError where a block is left open."""
        if self.stack:
            _, opened, place = self.stack[-1]
            raise place.error(f"{opened}Begin is never ended; add {opened}End")
        self.scene["integrator"] = {"type": "wave", "max_depth": self.shot.bounces + 1}
        if sensor := self.shot.sensor():
            self.scene["sensor"] = sensor
        if self.shot.camera is not None:
            self._note_unused(f"Camera {self.shot.kind}", self.shot.camera)
        return self.scene

    # ----------------------- Transforms ------------------------

    def _transform(self, token: Token, n: Reals) -> None:
        place = token.place
        match token.text:
            case "Transform":
                matrix = transforms.of_file(n)
            case "ConcatTransform":
                matrix = self.state.to_world @ transforms.of_file(n)
            case "Translate":
                matrix = self.state.to_world @ transforms.translate(n)
            case "Scale":
                matrix = self.state.to_world @ transforms.scale(n)
            case "Rotate":
                if not n[1:].any():
                    raise place.error("Rotate: the axis is zero; give a direction")
                matrix = self.state.to_world @ transforms.rotate(float(n[0]), n[1:])
            case "LookAt":
                matrix = self.state.to_world @ transforms.look_at(n[:3], n[3:6], n[6:])
                if not np.isfinite(matrix).all():
                    raise place.error("LookAt: eye and target are one point, or up points along them; move one")
            case _:
                self._note(token.text, place)
                return
        if not (np.abs(matrix) < LARGEST).all():
            raise place.error(f"{token.text}: the transform runs over; give numbers below {LARGEST:g}")
        self.state = replace(self.state, to_world=matrix)

    # ----------------------- Directives ------------------------

    def _directive(self, token: Token, names: list[str], p: Parameters) -> None:
        word, place = token.text, token.place
        name = names[0] if names else ""
        match word:
            case "Identity":
                self.state = replace(self.state, to_world=np.eye(4))
            case "CoordinateSystem":
                self.systems[name] = self.state.to_world
            case "CoordSysTransform":
                if name not in self.systems:
                    raise place.error(f"no coordinate system {name!r}; {did_you_mean(name, self.systems, 'name one')}")
                self.state = replace(self.state, to_world=self.systems[name])
            case "ReverseOrientation":
                self.state = replace(self.state, reversed=not self.state.reversed)
            case "AttributeBegin" | "TransformBegin":
                self.stack.append((self.state, word.removesuffix("Begin"), place))
            case "AttributeEnd" | "TransformEnd":
                self._close(word.removesuffix("End"), place)
            case "WorldBegin":
                self.state = replace(self.state, to_world=np.eye(4))
                self.systems["world"] = np.eye(4)
            case "WorldEnd":
                pass
            case "Camera":
                self.shot.kind, self.shot.camera, self.shot.place = name, p, place
                self.shot.to_camera = self.state.to_world
                self.systems["camera"] = _inverse(self.state.to_world, place)
                return  # what it does not use is told at the end
            case "Film":
                self.shot.set_film(name, p)
            case "Sampler":
                self.shot.set_sampler(p)
                self._note(f"the pattern of Sampler {name}", place)
            case "Integrator" | "SurfaceIntegrator":
                if not self.shot.set_integrator(name, p):
                    self._note(f"{word} {name}", place)
            case "Material":
                self.state = replace(self.state, bsdf=self._material(name, p))
            case "MakeNamedMaterial":
                self.materials[name] = self._material(p.one("type", ""), p)
            case "NamedMaterial":
                if name not in self.materials:
                    raise place.error(f"no material {name!r}; {did_you_mean(name, self.materials, 'make it before')}")
                self.state = replace(self.state, bsdf=self.materials[name])
            case "Texture":
                self._texture(name, names[2], p)
            case "LightSource":
                self._light(name, p)
            case "AreaLightSource":
                self.state = replace(self.state, radiance=lights.scaled(p, "L"))
                p.one("samples", p.one("nsamples", 1))
            case "Shape":
                self._shape(name, p)
                return  # told where the shape is placed
            case "ObjectBegin" | "ObjectEnd" | "ObjectInstance":
                self._object(word, name, place)
            case _:
                self._note(f"{word} {name}".rstrip(), place)
                return
        self._note_unused(f"{word} {name}".rstrip(), p)

    def _close(self, opened: str, place: Place) -> None:
        if not self.stack or self.stack[-1][1] != opened:
            raise place.error(f"{opened}End without {opened}Begin; take it out")
        before, _, _ = self.stack.pop()
        self.state = replace(self.state, to_world=before.to_world) if opened == "Transform" else before

    def _material(self, kind: str, p: Parameters) -> dict[str, Any]:
        bsdf = material(kind, p, self.textures)
        if bsdf is None:
            self._leave_out(f"Material {kind} (grey instead)", p)
        return bsdf or MATTE

    def _texture(self, name: str, kind: str, p: Parameters) -> None:
        self.textures[name] = texture(kind, p, self.textures, self.path.parent)
        if self.textures[name] is None:
            self._leave_out(f"Texture {kind} (grey instead)", p)

    def _light(self, kind: str, p: Parameters) -> None:
        made = lights.light(kind, p, self.state.to_world)
        if made is None:
            self._leave_out(f"LightSource {kind}", p)
            return
        self._add(kind, made)

    # -------------------------- Shapes -------------------------

    def _shape(self, kind: str, p: Parameters) -> None:
        state = self.state
        shape = Shape(kind, p, self.path.parent, state.to_world, state.reversed, state.bsdf, state.radiance)
        if self.open_object is None:
            self._place(shape)
            return
        if shape.radiance is not None:
            self._note("AreaLightSource in an object", p.place)
        self.objects[self.open_object].append(replace(shape, radiance=None))

    def _place(self, shape: Shape) -> None:
        built = shape.built()
        if built is None:
            self._leave_out(f"Shape {shape.kind}", shape.parameters)
            return
        if shape.radiance is not None and shape.kind == "sphere":
            self._note("the size of a shining sphere (a point in its middle instead)", shape.parameters.place)
        self._add(shape.kind, built)
        self._note_unused(f"Shape {shape.kind}", shape.parameters)

    def _object(self, word: str, name: str, place: Place) -> None:
        if word == "ObjectBegin":
            if self.open_object is not None:
                raise place.error(f"object {name!r} begins inside {self.open_object!r}; end that first")
            self.stack.append((self.state, "Object", place))
            self.open_object, self.objects[name] = name, []
        elif word == "ObjectEnd":
            self._close("Object", place)
            self.open_object = None
        elif name not in self.objects:
            raise place.error(f"no object {name!r}; {did_you_mean(name, self.objects, 'define it before')}")
        elif self.open_object is not None:
            raise place.error(f"an instance inside object {self.open_object!r}; write its shapes there instead")
        else:
            for shape in self.objects[name]:
                self._place(replace(shape, to_world=self.state.to_world @ shape.to_world))

    def _add(self, kind: str, part: Any) -> None:
        self.scene[f"{kind}-{sum(name.startswith(f'{kind}-') for name in self.scene) + 1}"] = part

    # ----------------------- What is left out ------------------

    def _note(self, what: str, place: Place) -> None:
        self.left_out.setdefault(what, place.line)

    def _leave_out(self, what: str, p: Parameters) -> None:
        """The whole directive, so that its parameters are not told one by one."""
        self._note(what, p.place)
        p.asked |= p.values.keys()

    def _note_unused(self, what: str, p: Parameters) -> None:
        for name in p.unused():
            self._note(f"{name} of {what}", p.place)


class _Cursor:
    """The tokens of a file, one after the other."""

    def __init__(self, rest: Iterator[Token]) -> None:
        self.rest = rest
        self.next = next(rest, None)

    def take(self) -> Token | None:
        token, self.next = self.next, next(self.rest, None)
        return token

    def take_while(self, wanted: Callable[[Token], bool]) -> Iterator[Token]:
        while self.next is not None and wanted(self.next):
            token = self.take()
            assert token is not None
            yield token

    def numbers(self, count: int, directive: Token) -> Reals:
        """As many numbers as a directive takes, in brackets or not."""
        found: list[float] = []
        for token in self.take_while(lambda t: t.kind == "number" or t.text in "[]"):
            if token.kind == "number":
                found.append(token.number)
        if len(found) != count:
            raise directive.place.error(f"{directive.text} has {len(found)} numbers; give {count}")
        return np.array(found)

    def texts(self, count: int, directive: Token) -> list[str]:
        """The texts that a directive begins with."""
        found: list[str] = []
        while len(found) < count and (token := self.next) is not None and token.kind == "text":
            self.take()
            found.append(token.text)
        if len(found) != count:
            raise directive.place.error(f"{directive.text} has {len(found)} texts; give {count}")
        return found

    def parameters(self, directive: Token) -> Parameters:
        """What follows up to the next directive."""
        result = Parameters(directive.place)
        while self.next is not None and self.next.kind == "text":
            declared = self.take()
            assert declared is not None
            result.add(declared, self._values(declared))
        return result

    def _values(self, declared: Token) -> list[Token]:
        first = self.take()
        if first is None or first.text == "]":
            raise declared.place.error(f"{declared.text!r} has no value; give one")
        if first.text != "[" or first.kind != "bracket":
            return [first]
        values = list(self.take_while(lambda t: t.kind != "bracket"))
        last = self.take()
        if last is None or last.text != "]":
            raise first.place.error("a [ is not closed; end it with ]")
        return values


def _inverse(matrix: Reals, place: Place) -> Reals:
    try:
        return transforms.inverse(matrix)
    except np.linalg.LinAlgError:
        raise place.error("the transform flattens everything; give a scale that is nowhere 0") from None


def read(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """A pbrt scene as a Mitsuba dictionary, and what was left out of it with the line where it is first.

    Raises InputError, one line that names file and line, for whatever pbrt would not read either.
    """
    reader = Reader(path)
    reader.read(path)
    return reader.finish(), reader.left_out
