"""The points of `grimaldi field`, from a file or as a grid on a plane."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grimaldi.errors import InputError
from grimaldi.pipeline import real

Points = NDArray[np.float64]


def read_points(path: Path) -> Points:
    """Points (n, 3) from a .npy file, or from a .csv file: x, y, z in rows, under these names or not.

    '#' begins a comment.
    """
    try:
        match path.suffix.lower():
            case ".npy":
                values = np.load(path, allow_pickle=False)
            case ".csv":
                values = _table(path.read_text(encoding="utf-8-sig"))
            case suffix:
                raise InputError(f"{path}: unknown kind of file {suffix!r}; give points as .npy or .csv")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the name") from None
    except (ValueError, TypeError, EOFError) as error:
        raise InputError(f"{path}: not a table of numbers ({error}); give x, y, z in rows") from None
    points = real(values, str(path))
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InputError(f"{path}: has the shape {points.shape}; give n rows of x, y, z")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(f"{path}: row {bad[0] + 1} is not finite; remove or mend it")
    return points


def _table(text: str) -> Points:
    """Numbers in rows (n, m)."""
    rows = [row for line in text.splitlines() if (row := line.partition("#")[0].strip())]
    if rows and rows[0].replace(" ", "").lower() == "x,y,z":
        del rows[0]
    return np.loadtxt(rows, delimiter=",", ndmin=2) if rows else np.empty((0, 3))


def parse_plane(text: str) -> tuple[Points, dict[str, Any]]:
    """The grid "corner; end of the first side; end of the second side; NxM" and its attributes.

    Returns points (N·M, 3), the first side running fastest, and {"grid": [M, N]}, the shape into which
    the results along `point` can be folded.
    """
    try:
        *vertices, counts = text.split(";")
        corner, first, second = np.array([[float(x) for x in vertex.split(",")] for vertex in vertices])
        sides = np.stack([first - corner, second - corner])
        columns, rows = (int(count) for count in counts.lower().split("x"))
        if sides.shape != (2, 3) or not np.isfinite(sides).all() or min(columns, rows) < 1:
            raise ValueError
    except ValueError:
        raise InputError(
            f"--plane: cannot read {text!r}; write 'x,y,z; x,y,z; x,y,z; NxM': "
            "a corner, the ends of the two sides that start there, and the points along each"
        ) from None
    if min(columns, rows) > 1 and np.linalg.norm(np.cross(*sides)) <= 1e-9 * np.linalg.norm(sides, axis=1).prod():
        raise InputError(f"--plane: the sides of {text!r} lie in one line; give two that do not, or a grid of Nx1")
    u = np.linspace(0.0, 1.0, columns)[None, :, None]
    v = np.linspace(0.0, 1.0, rows)[:, None, None]
    points = corner + u * sides[0] + v * sides[1]
    return points.reshape(-1, 3), {"grid": [rows, columns]}
