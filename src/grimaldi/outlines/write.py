"""Outlines and shadow mask as files: SVG and PNG as the source sees them, PLY in space."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from grimaldi.errors import InputError
from grimaldi.files import replacing
from grimaldi.outlines.mask import Mask, shadow_mask
from grimaldi.outlines.model import Integers, Outline, Reals
from grimaldi.scene.model import Scene, Source

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

INCHES, DPI = 8.0, 150
GREY, INK = "0.72", "#b40426"
MARGIN = 0.06  # of the shown extent


def write(outline: Outline, scene: Scene, source: Source, path: str | Path) -> None:
    """Write what `source` sees of `scene`.

    .svg and .png: the shadow mask in grey, the lit outlines as red lines, in the projection that
    `projection` chooses (named below the picture) and fitted to the mask. .ply: the outlines in space, as
    vertices (Float64) and edges, neighbours sharing their vertex.

    Raises:
        InputError: another suffix, or a folder that is missing or not writable.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".svg", ".png", ".ply"):
        raise InputError(f"{path}: unknown kind of file {path.suffix!r}; end the name in .svg, .png or .ply")
    with replacing(path) as temporary:
        if suffix == ".ply":
            temporary.write_bytes(_ply(outline))
        else:
            _draw(outline, shadow_mask(scene, source), f"{scene.name}, seen from {source.name}", temporary)


def _ply(outline: Outline) -> bytes:
    vertices, edges = _polylines(outline)
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment outlines in scene units\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element edge {len(edges)}\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    )
    return header.encode() + vertices.astype("<f8").tobytes() + edges.astype("<i4").tobytes()


def _polylines(outline: Outline) -> tuple[Reals, Integers]:
    """Vertices (m, 3), the same one only once, and edges (n, 2) between them."""
    ends = np.concatenate([outline.start, outline.end])
    vertices, index = np.unique(ends, axis=0, return_inverse=True)
    return vertices, index.reshape(2, -1).T.astype(np.int64)


def _draw(outline: Outline, mask: Mask, title: str, path: Path) -> None:
    import matplotlib as mpl
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch

    lines = _lines(outline, mask)
    low, high = _window(mask, lines)
    width, height = high - low
    scale = INCHES / max(width, height)
    figure = Figure(figsize=(width * scale, height * scale + 0.4), dpi=DPI)
    axes = figure.add_axes((0, 0.4 / (height * scale + 0.4), 1, height * scale / (height * scale + 0.4)))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xticks=[], yticks=[], aspect="equal")
    axes.spines[:].set_visible(False)
    axes.set_facecolor(GREY if mask.hole else "white")
    if not mask.region.is_empty:
        axes.add_patch(PathPatch(_path(mask.region), fc="white" if mask.hole else GREY, ec="none"))
    if lines:
        axes.add_patch(PathPatch(_compound(lines, closed=False), fc="none", ec=INK, lw=0.9, joinstyle="round"))
    figure.text(0.02, 0.1 / (height * scale + 0.4), f"{title} ({mask.projection.kind})", fontsize=8)
    # the same outlines give the same bytes
    with mpl.rc_context({"svg.hashsalt": "grimaldi"}):
        figure.savefig(path, metadata={"Date": None} if path.suffix.lower() == ".svg" else None)


def _lines(outline: Outline, mask: Mask) -> list[Reals]:
    """The outlines in the picture, one polyline (k, 2) a chain."""
    if not len(outline):
        return []
    bends = mask.projection.kind == "azimuthal equidistant"
    t = np.linspace(0, 1, 16 if bends else 1, endpoint=False)[:, None, None]
    points = np.moveaxis(outline.start + t * (outline.end - outline.start), 0, 1)
    cuts = np.flatnonzero(np.diff(outline.chain)) + 1
    result = []
    for segments, ends in zip(np.split(points, cuts), np.split(outline.end, cuts), strict=True):
        chain = np.concatenate([segments.reshape(-1, 3), ends[-1:]])
        result.extend(_in_front(chain, mask))
    return result


def _in_front(chain: Reals, mask: Mask) -> list[Reals]:
    """The chain in the picture, broken where it leaves what the projection can show."""
    flat = mask.projection(chain)
    if mask.projection.kind == "parallel":
        return [flat]
    assert mask.projection.source.position is not None
    depth = (chain - mask.projection.source.position) @ mask.projection.axis
    distance = np.linalg.norm(chain - mask.projection.source.position, axis=1)
    limit = np.cos(np.radians(85 if mask.projection.kind == "gnomonic" else 179))
    shown = depth > limit * distance
    cuts = np.flatnonzero(np.diff(shown)) + 1
    return [
        part
        for part, visible in zip(np.split(flat, cuts), np.split(shown, cuts), strict=True)
        if visible[0] and len(part) > 1
    ]


def _window(mask: Mask, lines: list[Reals]) -> tuple[Reals, Reals]:
    """Low and high corner of what is shown: the mask and a margin, or the lines where it is empty."""
    if not mask.region.is_empty:
        box = np.array(mask.region.bounds)
    elif lines:
        points = np.concatenate(lines)
        box = np.concatenate([points.min(axis=0), points.max(axis=0)])
    else:
        box = np.array([-1.0, -1.0, 1.0, 1.0])
    low, high = box[:2], box[2:]
    size = high - low
    # a window at most four times as long as wide
    grow = np.maximum(size.max() / 4 - size, 0) / 2 + MARGIN * size.max()
    return low - grow, high + grow


def _path(region: BaseGeometry) -> Any:
    """The polygons of a shapely geometry as one compound path."""
    import shapely

    polygons = [part for part in shapely.get_parts(region) if part.geom_type == "Polygon"]
    rings = [np.asarray(r.coords) for p in polygons for r in (p.exterior, *p.interiors)]
    return _compound(rings, closed=True)


def _compound(lines: list[Reals], closed: bool) -> Any:
    from matplotlib.path import Path as Compound

    codes = [np.full(len(line), Compound.LINETO, np.uint8) for line in lines]
    for code in codes:
        code[0] = Compound.MOVETO
        if closed:
            code[-1] = Compound.CLOSEPOLY
    return Compound(np.concatenate(lines), np.concatenate(codes))
