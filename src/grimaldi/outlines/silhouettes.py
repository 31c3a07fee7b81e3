"""All silhouettes of bodies, also where the source does not reach them: what a way X→P may graze."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from grimaldi.outlines.extract import DEFAULT_SAG, assemble, curve, edges_of
from grimaldi.outlines.lit import Stretches
from grimaldi.outlines.model import Integers, Outline
from grimaldi.scene.model import Scene, Source


def silhouettes(scene: Scene, source: Source) -> Outline:
    """The outlines of a scene's bodies as if nothing stood in their light, curves within 1e-4 of their size."""
    sag = [DEFAULT_SAG * curve(body.geometry)[1] for body in scene.bodies]
    edges, body = edges_of(scene, source, sag)
    n = len(edges.start)
    return assemble(edges, body, Stretches.whole(n), np.full(n, np.inf), source, max(sag, default=0.0))


def loops(outline: Outline) -> Integers:
    """Which loop each segment (n,) of whole silhouettes belongs to: in a mesh what hangs together, else the body."""
    n = len(outline)
    corners = np.column_stack([np.tile(outline.body, 2), np.concatenate([outline.start, outline.end])])
    nodes, node = np.unique(corners, axis=0, return_inverse=True)
    first, second = node.reshape(2, n)
    graph = coo_array((np.ones(n), (first, second)), shape=(len(nodes), len(nodes)))
    label = connected_components(graph, directed=False)[1][first].astype(np.int64)
    label = np.where(outline.edge < 0, len(nodes) + outline.body, label)
    return np.unique(label, return_inverse=True)[1].astype(np.int64)


def same_loop(outline: Outline, whole: Outline, loop: Integers) -> Integers:
    """The loop (n,) of each segment of an outline that is part of whole silhouettes with loops (m,)."""
    wide = int(max(whole.edge.max(initial=0), 0)) + 2
    key = whole.body * wide + whole.edge + 1
    known, first = np.unique(key, return_index=True)
    return loop[first[np.searchsorted(known, outline.body * wide + outline.edge + 1)]]
