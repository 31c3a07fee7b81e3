"""All silhouettes of bodies, also where the source does not reach them: what a way X→P may graze."""

from __future__ import annotations

import numpy as np

from grimaldi.outlines.extract import assemble, default_sags, edges_of
from grimaldi.outlines.lit import Stretches
from grimaldi.outlines.model import Outline
from grimaldi.outlines.soup import Soup
from grimaldi.scene.model import Scene, Source


def silhouettes(scene: Scene, source: Source) -> Outline:
    """The outlines of a scene's bodies as if nothing stood in their light, curves within 1e-4 of their size."""
    sag = default_sags(scene.bodies)
    edges, body = edges_of(scene.bodies, Soup.of(scene.bodies), source, sag)
    n = len(edges.start)
    return assemble(edges, body, Stretches.whole(n), np.full(n, np.inf), source, max(sag, default=0.0))
