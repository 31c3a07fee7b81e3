"""Which fields add and which intensities add (THEORY eq. 3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grimaldi.parts import parts
from grimaldi.scene.model import Source


def groups(sources: tuple[Source, ...]) -> tuple[str, ...]:
    """The coherence groups in the order of their first source."""
    return tuple(dict.fromkeys(source.group for source in sources))


def separated(sources: tuple[Source, ...]) -> tuple[Source, ...]:
    """The same sources, each a group of its own: no interference between them."""
    if len({source.name for source in sources}) == len(sources):
        return tuple(replace(source, group=source.name) for source in sources)
    return tuple(replace(source, group=f"{source.name}.{i}") for i, source in enumerate(sources))


def intensity(U: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Σ_λ Σ_group |U|² over the first two axes of U (wavelength, group, …)."""
    result = np.zeros(U.shape[2:])
    fields, each = U.reshape(U.shape[0] * U.shape[1], -1), result.ravel()
    for some in parts(len(each)):
        total = each[some]
        for u in fields[:, some]:
            total += np.square(u.real)
            total += np.square(u.imag)
    return result
