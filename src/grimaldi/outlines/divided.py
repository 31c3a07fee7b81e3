"""An outline cut finer, or its edges put together again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from grimaldi.outlines.model import Integers, Outline


def divided(outline: Outline, parts: Integers) -> Outline:
    """The same outline, its segments cut into `parts` (n,) equal ones each, in the same order."""
    which = np.repeat(np.arange(len(outline)), parts)
    step = np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)
    low, high = (step / parts[which])[:, None], ((step + 1) / parts[which])[:, None]
    start, span = outline.start[which], (outline.end - outline.start)[which]
    begin, width = outline.interval[which, :1], np.diff(outline.interval, axis=1)[which]
    return replace(
        outline,
        start=start + low * span,
        end=np.where(high < 1, start + high * span, outline.end[which]),
        body=outline.body[which],
        edge=outline.edge[which],
        interval=begin + np.concatenate([low, high], axis=1) * width,
        normals=outline.normals[which],
        outward=outline.outward[which],
        behind=outline.behind[which],
        chain=outline.chain[which],
        radius=outline.radius[which],
    )


def joined(outline: Outline) -> Outline:
    """The same outline, neighbouring stretches of one mesh edge as one segment."""
    follows = (
        (outline.chain[1:] == outline.chain[:-1])
        & (outline.body[1:] == outline.body[:-1])
        & (outline.edge[1:] == outline.edge[:-1])
        & (outline.edge[1:] >= 0)
        & (outline.interval[1:, 0] == outline.interval[:-1, 1])
    )
    first = np.flatnonzero(np.append(True, ~follows)[: len(outline)])
    if not len(first):
        return outline
    last = np.append(first[1:], len(outline)) - 1
    return replace(
        outline,
        start=outline.start[first],
        end=outline.end[last],
        body=outline.body[first],
        edge=outline.edge[first],
        interval=np.stack([outline.interval[first, 0], outline.interval[last, 1]], axis=1),
        normals=outline.normals[first],
        outward=outline.outward[first],
        behind=np.minimum.reduceat(outline.behind, first),
        chain=outline.chain[first],
        radius=outline.radius[first],
    )
