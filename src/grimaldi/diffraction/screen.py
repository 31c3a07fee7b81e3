"""The two sides of a plane that holds apertures or masks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np

from grimaldi.diffraction.arrays import types
from grimaldi.diffraction.frame import constant
from grimaldi.scene.model import Source
from grimaldi.scene.planar import PlanarOutline


def beyond(plane: PlanarOutline, source: Source) -> Callable[[Any], Any]:
    """A function of points (Float64): whether they lie on the side of the plane that the source does not light."""
    V = types(double=True).Vector
    if source.position is None:
        assert source.direction is not None
        towards = -source.direction
    else:
        towards = source.position - plane.origin
    normal = plane.normal * np.sign(towards @ plane.normal)

    def far(p: Any) -> Any:
        return dr.dot(p - constant(V, plane.origin), constant(V, normal)) < 0

    return far
