"""pbrt's materials and textures, of versions 3 and 4, as Mitsuba BSDFs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from grimaldi.scene.pbrt.parameters import Colour, Parameters

Textures = Mapping[str, Any]

GREY: Colour = (0.5, 0.5, 0.5)
COPPER = "metal-Cu-eta"
METALS = ("Ag", "Al", "Au", "Cu")


def rgb(colour: Colour) -> dict[str, Any]:
    return {"type": "rgb", "value": list(colour)}


def texture(kind: str, p: Parameters, textures: Textures, folder: Path) -> Any:
    """A Mitsuba texture; None where there is none like it."""
    match kind:
        case "constant":
            return rgb(p.colour("value", (1.0, 1.0, 1.0)))
        case "imagemap" if p.has("filename"):
            return {"type": "bitmap", "filename": str(folder / p.one("filename", ""))}
        case "checkerboard":
            import mitsuba as mi

            # Mitsuba's board has two fields to a unit
            repeat = [p.one(name, 1.0) / 2 for name in ("uscale", "vscale")]
            to_uv = mi.ScalarTransform4f().scale([*repeat, 1.0])
            ends = (_colour(p, name, default, textures) for name, default in (("tex1", 1.0), ("tex2", 0.0)))
            return {"type": "checkerboard", **dict(zip(("color0", "color1"), ends, strict=True)), "to_uv": to_uv}
        case _:
            return None


def material(kind: str, p: Parameters, textures: Textures) -> dict[str, Any] | None:
    """A Mitsuba BSDF, seen from both sides as in pbrt; None where there is none like it."""
    match kind:
        case "" | "none" | "interface":
            return {"type": "null"}
        case "glass" | "dielectric":
            return {"type": "dielectric", "int_ior": p.one("eta", p.one("index", 1.5))}
        case "thindielectric":
            return {"type": "thindielectric", "int_ior": p.one("eta", 1.5)}
        case "matte":
            bsdf = {"type": "diffuse", "reflectance": _colour(p, "Kd", 0.5, textures)}
        case "diffuse":
            bsdf = {"type": "diffuse", "reflectance": _colour(p, "reflectance", 0.5, textures)}
        case "plastic" | "uber" | "substrate":
            bsdf = {
                **_rough("plastic", p, ("uroughness",) if kind == "substrate" else ("roughness",), _version_3),
                "diffuse_reflectance": _colour(p, "Kd", 0.5 if kind == "substrate" else 0.25, textures),
                "specular_reflectance": _colour(p, "Ks", 0.5 if kind == "substrate" else 0.25, textures),
            }
        case "coateddiffuse":
            bsdf = {
                **_rough("plastic", p, ("roughness",), math.sqrt, default=0.0),
                "diffuse_reflectance": _colour(p, "reflectance", 0.5, textures),
            }
        case "mirror":
            bsdf = {"type": "conductor", "material": "none", "specular_reflectance": _colour(p, "Kr", 0.9, textures)}
        case "metal":
            bsdf = {**_rough("conductor", p, ("roughness",), _version_3, default=0.01), "material": _metal(p)}
        case "conductor" if p.has("reflectance"):
            bsdf = {
                **_rough("conductor", p, ("roughness",), math.sqrt, default=0.0),
                "material": "none",
                "specular_reflectance": _colour(p, "reflectance", 0.5, textures),
            }
        case "conductor":
            bsdf = {**_rough("conductor", p, ("roughness",), math.sqrt, default=0.0), "material": _metal(p)}
        case _:
            return None
    return {"type": "twosided", "bsdf": bsdf}


def _colour(p: Parameters, name: str, default: float, textures: Textures) -> Any:
    """A colour or a named texture, as Mitsuba's."""
    if p.type(name) != "texture":
        return rgb(p.colour(name, (default, default, default)))
    named = p.one(name, "")
    if named not in textures:
        raise p.place.error(f"{name}: there is no texture {named!r}; define it before its material")
    return textures[named] or rgb(GREY)


def _rough(surface: str, p: Parameters, names: tuple[str, ...], to_alpha: Any, default: float = 0.1) -> dict[str, Any]:
    """The smooth plugin or the rough one, by the roughness; that of a texture is left out."""
    value = next((p.one(name, default) for name in names if p.type(name) == "float"), default)
    alpha = to_alpha(value) if p.one("remaproughness", True) else value
    return {"type": surface} if value <= 0 else {"type": f"rough{surface}", "alpha": alpha}


def _version_3(roughness: float) -> float:
    """Roughness as alpha (pbrt-v3, TrowbridgeReitzDistribution::RoughnessToAlpha)."""
    x = math.log(max(roughness, 1e-3))
    return 1.62142 + 0.819955 * x + 0.1734 * x**2 + 0.0171201 * x**3 + 0.000640711 * x**4


def _metal(p: Parameters) -> str:
    """One of Mitsuba's metals of pbrt's names; copper, as in pbrt, where none is named."""
    named = p.values.get("eta")
    name = named.values[0] if named is not None and named.type == "spectrum" else COPPER
    metal = str(name).removeprefix("metal-").partition("-")[0]
    if metal not in METALS:
        return "Cu"
    p.asked |= {"eta", "k"}
    return metal
