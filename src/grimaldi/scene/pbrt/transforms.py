"""pbrt's transforms as matrices (4, 4) that act on columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


def translate(offset: Reals) -> Reals:
    result = np.eye(4)
    result[:3, 3] = offset
    return result


def scale(factors: Reals) -> Reals:
    return np.diag([*factors, 1.0])


def rotate(degrees: float, axis: Reals) -> Reals:
    """About an axis that is not 0 (Rodrigues)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    result = np.eye(4)
    result[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return result


def look_at(eye: Reals, target: Reals, up: Reals) -> Reals:
    """From the world to a camera that looks along +z with +y up, in left-handed coordinates.

    Singular (not finite) where target is the eye, or up the way to it.
    """
    with np.errstate(invalid="ignore"):
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(up, ahead)
        right = right / np.linalg.norm(right)
    camera = np.eye(4)
    camera[:3] = np.stack([right, np.cross(ahead, right), ahead, eye], axis=1)
    return inverse(camera) if np.isfinite(camera).all() else camera


def inverse(matrix: Reals) -> Reals:
    """LinAlgError for a singular one."""
    return np.asarray(np.linalg.inv(matrix), np.float64)


def as_mitsubas(matrix: Reals) -> Any:
    """What Mitsuba takes for `to_world`."""
    import mitsuba

    mi: Any = mitsuba  # the stubs refuse arrays
    return mi.ScalarTransform4f(matrix)


def of_file(numbers: Reals) -> Reals:
    """A matrix as a pbrt file writes it: column by column."""
    return numbers.reshape(4, 4).T


def point(to_world: Reals, p: Reals) -> Reals:
    return to_world[:3, :3] @ p + to_world[:3, 3]


def mirrors(to_world: Reals) -> bool:
    """Whether it turns right hands into left ones."""
    return bool(np.linalg.det(to_world[:3, :3]) < 0)


def similar(to_world: Reals) -> float | None:
    """By how much it scales all lengths; None where it does not scale them alike."""
    lengths = np.linalg.svd(to_world[:3, :3], compute_uv=False)
    return float(lengths.mean()) if np.ptp(lengths) <= 1e-5 * lengths.mean() else None
