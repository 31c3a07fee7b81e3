"""Draws docs/images/creature.png: the built-in creature by rays (left) and by waves (right), at one exposure.

    .venv/bin/python docs/make_picture.py

Above the whole scene, split in the shadow of the creature's back; below it the shadow of the head from both pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.image import imsave
from numpy.typing import NDArray

import grimaldi
from grimaldi.film import automatic_exposure
from grimaldi.film.layers import Layers
from grimaldi.film.png import pixels

OUTPUT = Path(__file__).with_name("images") / "creature.png"
SIZE = (900, 675)
SCENE = np.s_[150:520, :]  # rows, columns
SPLIT = 608  # between two spikes of the shadow
HEAD = np.s_[180:450, 450:900]

Bytes = NDArray[np.uint8]


def compose(rays: Bytes, waves: Bytes) -> Bytes:
    """Both pictures (y, x, 3) as one, with white lines where they meet."""
    split = np.concatenate([rays[:, :SPLIT], waves[:, SPLIT:]], axis=1)
    split[:, SPLIT - 1 : SPLIT + 1] = 255
    heads = np.concatenate([rays[HEAD], waves[HEAD]], axis=1)
    middle = heads.shape[1] // 2
    heads[:, middle - 1 : middle + 1] = 255
    line = np.full((4, SIZE[0], 3), 255, np.uint8)
    return np.concatenate([split[SCENE], line, heads])


def main() -> None:
    waves = grimaldi.render("creature", size=SIZE, spp=12)
    rays = grimaldi.render("creature", size=SIZE, spp=12, diffraction="none")
    exposure = automatic_exposure(rays["picture"])
    OUTPUT.parent.mkdir(exist_ok=True)
    imsave(OUTPUT, compose(*(pixels(Layers.of(dataset), "picture", exposure) for dataset in (rays, waves))))


if __name__ == "__main__":
    main()
