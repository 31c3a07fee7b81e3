"""The interface of a diffraction model: (scene, source, outline) → a function from points to M and its error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Scene, Source

Precision = Literal["auto", "double"]
Occlusion = Literal["graded", "binary", "none"]
Rim = Literal["sharp", "smooth"]
Weights = Literal["report", "length", "kernel"]
NYQUIST: Literal["nyquist"] = "nyquist"


@dataclass(frozen=True)
class Options:
    """What every model is asked for.

    tolerance: |M_computed - M| allowed for each source and point; precision: "auto" or "double";
    occlusion: how bodies block the way from an outline to a point: as knife edges where it grazes them, by yes or
    no, or not at all; "graded" is `boundary`'s alone, the other models take it for "binary";
    rim: "sharp", black screens, or "smooth", waves that creep round smooth bodies (`boundary` alone);
    fast: whether `field` may take one transform for all points of a plane behind holes or masks, and `render` may
    interpolate M over the film.

    Of the models that sum over sources: n is how many an edge (`huygens`; "nyquist": λ/2 apart) or a point
    (`area`) gets, None for the model's own choice; `huygens` has `weights`, and the distance epsilon [scene units]
    of the report's silhouette test, None for its own choice.
    """

    tolerance: float = 1e-3
    precision: Precision = "auto"
    occlusion: Occlusion = "graded"
    rim: Rim = "sharp"
    n: int | Literal["nyquist"] | None = None
    weights: Weights = "report"
    epsilon: float | None = None
    fast: bool = True


class Receivers(NamedTuple):
    """Points where the field is asked, as Dr.Jit arrays; part of a traced kernel."""

    p: Any  # Float64 (3)
    n: Any  # unit normal of the surface the point lies on, towards the side that is asked; 0 in free space
    active: Any


class Factor(NamedTuple):
    """M = U/U0 at the receivers, the estimated |M_computed - M|, and how near the ray passes an outline.

    `clearance` [scene units] is 0 where a model does not tell.
    """

    real: Any
    imag: Any
    error: Any
    clearance: Any = 0


Evaluate = Callable[[Receivers], Factor]
Model = Callable[[Scene, Source, Outline, float, Options], Evaluate]
"""model(scene, source, outline, k, options); a pure function of blocks of points, traceable by Dr.Jit."""
