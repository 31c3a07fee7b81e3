"""All silhouettes of bodies, also where the source does not reach them: what a way X→P may graze."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.extract import assemble, default_sags, edges_of
from grimaldi.outlines.lit import Stretches
from grimaldi.outlines.memory import once
from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Scene, Source


def silhouettes(scene: Scene, source: Source) -> Outline:
    """The outlines of a scene's bodies as if nothing stood in their light, curves within 1e-4 of their size."""
    return once(scene, ("silhouettes", source), lambda: _silhouettes(scene, source))


def _silhouettes(scene: Scene, source: Source) -> Outline:
    sag = default_sags(scene.bodies)
    edges, body = edges_of(scene, source, sag)
    n = len(edges)
    whole = Stretches.whole(n)
    return assemble(edges, body, whole, source, max(sag, default=0.0), longest=np.full(n, np.inf))
