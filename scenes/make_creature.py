"""Make the creature of the flagship scene: one closed triangle mesh, far finer on the head than on the body.

    python scenes/make_creature.py [OUT.ply]

The body is the zero set of a smooth union of tapered limbs. A fine grid is cut by it (surface nets), and
edges are then collapsed until they have the wanted length: short on the head, longer on the body.
Lengths are in scene units; z is up, the creature stands on z = 0, looks along +x and is about 100 high.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Node = tuple[float, ...]  # x, y, z, radius
Face = tuple[int, ...]

DESTINATION = Path(__file__).parent.parent / "src/grimaldi/scene/builtin/creature.ply"

# -- the shape: f(p) < 0 inside ------------------------------------------------------------------------


def limb(p: Reals, *nodes: Node) -> Reals:
    """A chain of tapered capsules through the nodes (x, y, z, radius)."""
    distance = np.full(len(p), np.inf)
    for start, end in zip(np.array(nodes[:-1]), np.array(nodes[1:]), strict=True):
        axis = end[:3] - start[:3]
        t = np.clip((p - start[:3]) @ axis / (axis @ axis), 0, 1)
        radius = start[3] + t * (end[3] - start[3])
        distance = np.minimum(distance, np.linalg.norm(p - start[:3] - t[:, None] * axis, axis=1) - radius)
    return distance


def smooth(nodes: list[Node], steps: int) -> list[Node]:
    """Catmull-Rom points through the nodes, so that a limb bends without kinks."""
    n = np.array(nodes)
    n = np.vstack([2 * n[0] - n[1], n, 2 * n[-1] - n[-2]])
    t = np.arange(steps)[:, None] / steps
    points = [
        0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
        for a, b, c, d in zip(n[:-3], n[1:-2], n[2:-1], n[3:], strict=True)
    ]
    return [tuple(point) for point in np.vstack([*points, n[-2:-1]])]


def ellipsoid(p: Reals, centre: tuple[float, ...], radii: tuple[float, ...], pitch: float = 0.0) -> Reals:
    """An ellipsoid, nose up by `pitch` [rad]; near its surface about the distance."""
    q = p - np.array(centre)
    c, s = np.cos(pitch), np.sin(pitch)
    q = np.stack([c * q[:, 0] + s * q[:, 2], q[:, 1], -s * q[:, 0] + c * q[:, 2]], axis=1)
    k = np.linalg.norm(q / np.array(radii), axis=1)
    return k * (k - 1) / np.maximum(np.linalg.norm(q / np.array(radii) ** 2, axis=1), 1e-9)


def join(a: Reals, b: Reals, blend: float) -> Reals:
    """The union of two shapes, rounded over the length `blend`."""
    h = np.maximum(blend - np.abs(a - b), 0) / blend
    return np.minimum(a, b) - h**2 * blend / 4


def cut(a: Reals, b: Reals, blend: float) -> Reals:
    """The first shape without the second."""
    return -join(-a, b, blend)


HEAD = (63.0, 0.0, 80.0)
PITCH = 0.12


def on_head(x: float, y: float, z: float) -> tuple[float, float, float]:
    """A point given in the head's own frame: x to the nose, z to the crown."""
    c, s = np.cos(PITCH), np.sin(PITCH)
    return HEAD[0] + c * x - s * z, HEAD[1] + y, HEAD[2] + s * x + c * z


def trunk(p: Reals) -> Reals:
    spine = smooth([(-52, 0, 38, 11), (-38, 0, 43, 17), (-12, 0, 46, 19.5), (14, 0, 52, 18.5), (32, 0, 59, 14.5)], 4)
    neck = smooth([(28, 0, 60, 14), (42, 0, 69, 10), (52, 0, 76, 9), (60, 0, 79, 9)], 4)
    tail = smooth(
        [
            *((-46, 0, 38, 12), (-70, 3, 26, 9), (-95, 8, 17, 7), (-120, 12, 19, 5.6), (-139, 13, 34, 4.6)),
            *((-143, 12, 54, 4.0), (-131, 11, 70, 3.5), (-113, 10, 72, 3.0), (-105, 9, 61, 2.6)),
        ],
        5,
    )
    squeezed = p * np.array([1, 0.92, 1])
    return join(join(limb(squeezed, *spine), limb(p, *neck), 10), limb(p, *tail), 8)


def toes(p: Reals, at: tuple[float, float, float], heading: float) -> Reals:
    foot = np.full(len(p), np.inf)
    for spread in (-0.55, 0.0, 0.55):
        a = heading + spread
        tip = (at[0] + 14 * np.cos(a), at[1] + 14 * np.sin(a), 1.8)
        foot = np.minimum(foot, limb(p, (at[0], at[1], at[2] + 1, 4.2), (*tip[:2], 2.6, 2.5)))
    return foot


def legs(p: Reals) -> Reals:
    result = np.full(len(p), np.inf)
    # two hind legs, one standing fore leg
    for side, shift in ((1, -4.0), (-1, 7.0)):
        hip = (-36 + shift, side * 13, 40, 13)
        knee = (-24 + shift, side * 22, 23, 8.5)
        ankle = (-40 + shift, side * 23, 11, 5.2)
        sole = (-36 + shift, side * 23, 4, 5)
        leg = limb(p, *smooth([hip, knee, ankle, sole], 4))
        result = np.minimum(result, join(leg, toes(p, (sole[0] + 2, sole[1], 3), side * 0.25), 4))
    standing = smooth([(24, -11, 52, 11), (19, -19, 32, 7), (30, -20, 15, 5), (31, -20, 4.5, 4.8)], 4)
    result = np.minimum(result, join(limb(p, *standing), toes(p, (33, -20, 3), -0.2), 4))
    # the raised arm, claws spread
    arm = smooth([(25, 11, 54, 10.5), (37, 20, 43, 7), (58, 21, 40, 5), (70, 20, 49, 4.6)], 4)
    hand = limb(p, *arm)
    for tip in ((86, 14, 60), (88, 22, 52), (80, 28, 64)):
        mid = (0.45 * 70 + 0.55 * tip[0] + 2, 0.45 * 20 + 0.55 * tip[1], 0.45 * 49 + 0.55 * tip[2] - 3)
        hand = join(hand, limb(p, (70, 20, 49, 3.6), (*mid, 3.0), (*tip, 1.4)), 2)
    return np.minimum(result, hand)


def spikes(p: Reals) -> Reals:
    """A row of plates along the back and down the tail, and a thorn at its end."""
    result = np.full(len(p), np.inf)
    row = [(36, 74, 12), (22, 71, 15), (6, 67, 18), (-11, 64, 19), (-28, 60, 17), (-44, 52, 14)]
    row += [(-59, 42, 12), (-74, 32, 10), (-90, 24, 8)]
    flat = np.array([1, 1.4, 1])
    for x, z, length in row:
        y = 1.4 * max(0.0, (-50 - x) / 8)
        tip = (x - 0.55 * length - 2, y, z + 1.1 * length, 1.2)
        result = np.minimum(result, limb(p * flat, (x, y, z - 5, 6.0), tip))
    thorn = limb(p, (-107, 9, 63, 2.6), (-102, 9, 56, 4.6), (-98, 9, 43, 1.2))
    return np.minimum(result, thorn)


def head(p: Reals) -> Reals:
    skull = join(
        ellipsoid(p, on_head(3, 0, 2), (15, 12, 10.5), PITCH),
        ellipsoid(p, on_head(18, 0, 0.5), (12, 7.5, 5.2), PITCH - 0.1),
        6,
    )
    jaw = limb(p, (*on_head(0, 0, -6), 6.5), (*on_head(13, 0, -9.5), 4.6), (*on_head(25, 0, -8.5), 3.2))
    shape = join(skull, jaw, 2.5)
    mouth = limb(p, (*on_head(12, 0, -5.0), 0.8), (*on_head(22, 0, -4.5), 1.8), (*on_head(38, 0, -4), 3.2))
    wide = limb(p * np.array([1, 0.3, 1]), (*on_head(12, 0, -5.2), 0.6), (*on_head(34, 0, -4.3), 2.0))
    shape = cut(shape, np.minimum(mouth, wide), 1.0)
    for side in (-1, 1):
        brow = limb(p, (*on_head(1, side * 9, 9.5), 3.2), (*on_head(15, side * 6.5, 7.2), 2.2))
        shape = join(shape, brow, 3)
        shape = join(shape, ellipsoid(p, on_head(10.5, side * 9.6, 3.8), (3.2, 3.0, 3.2)), 0.5)
        nostril = ellipsoid(p, on_head(28, side * 3.6, 3.2), (1.4, 1.2, 1.1))
        shape = cut(shape, nostril, 0.8)
        # the crown of horns
        horns = [
            [(-4, 6, 9, 4.2), (-13, 9, 17, 3.0), (-24, 11, 22, 1.9), (-35, 11, 23, 1.2)],
            [(-7, 9, 4, 3.6), (-16, 15, 8, 2.4), (-26, 19, 9, 1.2)],
            [(-6, 10, -3, 3.2), (-14, 17, -3, 2.0), (-22, 21, -5, 1.2)],
            [(1, 9, -8, 2.6), (-5, 14.5, -10, 1.6), (-11, 18, -13, 1.1)],
        ]
        for horn in horns:
            nodes = [(*on_head(x, side * y, z), r) for x, y, z, r in horn]
            shape = join(shape, limb(p, *smooth(nodes, 3)), 1.5)
    return join(shape, limb(p, (*on_head(25, 0, 4), 2.4), (*on_head(28, 0, 13), 1.1)), 1.5)


def creature(p: Reals) -> Reals:
    """Negative inside the creature, positive outside, (n,) at points (n, 3); its zero set is the skin."""
    shape = join(trunk(p), legs(p), 7)
    shape = join(shape, spikes(p), 3)
    shape = join(shape, head(p), 2.5)
    # flat soles
    return cut(shape, p[:, 2], 1.0)


# -- the mesh: a fine net over the skin, then thinned out to the wanted edge lengths ----------------------

CELL = 1.2
HEAD_EDGE, HEAD_RADIUS, BODY_EDGE = 1.3, 20.0, 7.2


def wanted_length(vertices: Reals, faces: Integers) -> Reals:
    """Wanted length of the edges at each vertex: short on the head, elsewhere by the skin's curvature."""
    normals = skin_normals(vertices)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    bend = np.linalg.norm(normals[edges[:, 0]] - normals[edges[:, 1]], axis=1)
    bend /= np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    ends, both = edges.ravel(), np.repeat(bend, 2)
    curvature = np.bincount(ends, both) / np.bincount(ends)
    for _ in range(5):
        curvature = np.bincount(ends, curvature[edges[:, ::-1].ravel()]) / np.bincount(ends)
    length = np.clip(0.42 / np.maximum(curvature, 1e-9), 1.3, BODY_EDGE)
    beyond = np.linalg.norm(vertices - np.array(on_head(5, 0, 0)), axis=1) - HEAD_RADIUS
    length = np.minimum(length, HEAD_EDGE + 0.2 * np.maximum(beyond, 0))
    for _ in range(40):  # no jumps: at most a factor 1.25 from neighbour to neighbour
        np.minimum.at(length, edges[:, 0], 1.25 * length[edges[:, 1]])
    return length


def settled(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Fill in where a face of the grid has only two opposite corners inside: the net would pinch there."""
    while True:
        before = inside.sum()
        for axis in range(3):
            f = np.moveaxis(inside, axis, 0)  # a view: filling it fills `inside`
            a, b, c, d = f[:, :-1, :-1], f[:, 1:, :-1], f[:, :-1, 1:], f[:, 1:, 1:]
            pinched = (a == d) & (b == c) & (a != b)
            for corner in (a, b, c, d):
                corner |= pinched
        if inside.sum() == before:
            return inside


def surface_net() -> tuple[Reals, Integers]:
    """Triangles about the zero set: one vertex a crossed cell, two triangles a crossed grid edge."""
    axes = [np.arange(a, b, CELL) for a, b in ((-165.3, 115), (-60.2, 60), (-4.1, 120))]
    shape = tuple(len(a) for a in axes)
    value = np.empty(shape)
    for i, x in enumerate(axes[0]):
        plane = np.stack(np.meshgrid(x, axes[1], axes[2], indexing="ij"), axis=-1)
        value[i] = creature(plane.reshape(-1, 3)).reshape(shape[1:])
    inside = settled(value < 0)
    value = np.where(inside, np.minimum(value, -1e-3), np.maximum(value, 1e-3))

    total = np.zeros((*(n - 1 for n in shape), 3))
    count = np.zeros(total.shape[:3])
    quads = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        first = np.moveaxis(inside, (axis, b, c), (0, 1, 2))
        v = np.moveaxis(value, (axis, b, c), (0, 1, 2))
        i, j, k = np.nonzero(first[:-1] != first[1:])
        point = np.empty((len(i), 3))
        point[:, axis] = i + v[i, j, k] / (v[i, j, k] - v[i + 1, j, k])
        point[:, b], point[:, c] = j, k
        corners = []
        for dj, dk in ((0, 0), (-1, 0), (-1, -1), (0, -1)):
            index = np.empty((len(i), 3), dtype=np.int64)
            index[:, axis], index[:, b], index[:, c] = i, j + dj, k + dk
            np.add.at(total, tuple(index.T), point)
            np.add.at(count, tuple(index.T), 1)
            corners.append(np.ravel_multi_index(tuple(index.T), count.shape))
        quad = np.stack(corners, axis=1)
        quads.append(np.where(first[i, j, k][:, None], quad, quad[:, ::-1]))
    used, quad = np.unique(np.concatenate(quads), return_inverse=True)
    quad = quad.reshape(-1, 4)
    vertices = total.reshape(-1, 3)[used] / count.reshape(-1, 1)[used] * CELL + [a[0] for a in axes]
    return vertices, np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])


def skin_normals(points: Reals) -> Reals:
    """The gradient of `creature` at points (n, 3)."""
    h = 1e-4
    return np.stack([creature(points + h * e) - creature(points - h * e) for e in np.eye(3)], axis=1) / (2 * h)


def onto_skin(points: Reals, steps: int = 3) -> Reals:
    """The points (n, 3) moved onto the zero set by short Newton steps."""
    for _ in range(steps):
        slope = skin_normals(points)
        step = -creature(points)[:, None] * slope / np.maximum((slope**2).sum(1, keepdims=True), 0.05)
        length = np.linalg.norm(step, axis=1, keepdims=True)
        points = points + step * np.minimum(1, 0.3 * CELL / np.maximum(length, 1e-12))
    return points


def relax(vertices: Reals, faces: Integers, rounds: int, weight: float = 0.4) -> Reals:
    """Even out the triangles: vertices move towards their neighbours' mean along the skin."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    degree = np.maximum(np.bincount(edges[:, 0], minlength=len(vertices)), 1)[:, None]
    for _ in range(rounds):
        mean = np.zeros_like(vertices)
        np.add.at(mean, edges[:, 0], vertices[edges[:, 1]])
        pull = mean / degree - vertices
        normal = skin_normals(vertices)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        pull -= (pull * normal).sum(1, keepdims=True) * normal
        vertices = onto_skin(vertices + weight * pull, 2)
    return vertices


class Skin:
    """A closed triangle mesh that loses vertices and flips edges, and stays closed and manifold."""

    def __init__(self, vertices: Reals, faces: Integers, wanted: Reals) -> None:
        self.vertices = vertices
        self.wanted = wanted
        self.faces = [tuple(face) for face in faces.tolist()]
        self.around: list[set[int]] = [set() for _ in vertices]
        for i, face in enumerate(self.faces):
            for v in face:
                self.around[v].add(i)

    def neighbours(self, v: int) -> set[int]:
        return {w for i in self.around[v] for w in self.faces[i]} - {v}

    def normal(self, a: int, b: int, c: int) -> Reals:
        x = self.vertices
        return np.cross(x[b] - x[a], x[c] - x[a])

    def upright(self, old: Face, new: Face) -> bool:
        """Whether a changed triangle still faces the way it did and is no sliver."""
        m, n = self.normal(*old), self.normal(*new)
        longest = max(((self.vertices[new[i]] - self.vertices[new[i - 1]]) ** 2).sum() for i in range(3))
        size = np.sqrt(n @ n)
        return bool(m @ n > 0.6 * size * np.sqrt(m @ m) and size > 0.15 * longest)

    def replace(self, i: int, face: Face | None) -> None:
        for v in self.faces[i]:
            self.around[v].discard(i)
        if face is not None:
            self.faces[i] = face
            for v in face:
                self.around[v].add(i)

    def collapse(self, gone: int, kept: int) -> bool:
        """Pull vertex `gone` into its neighbour `kept`, where that keeps the mesh closed and upright."""
        if len(self.neighbours(gone) & self.neighbours(kept)) != 2:
            return False
        shared = self.around[gone] & self.around[kept]
        moved = {i: tuple(kept if v == gone else v for v in self.faces[i]) for i in self.around[gone] - shared}
        if not all(self.upright(self.faces[i], face) for i, face in moved.items()):
            return False
        for i in shared:
            self.replace(i, None)
        for i, face in moved.items():
            self.replace(i, face)
        return True

    def thin_out(self, least: float) -> None:
        """Collapse edges, shortest first, that are shorter than `least` times what is wanted at their ends."""
        wanted = self.wanted
        while True:
            pairs = np.array(
                [(v, w) for v in range(len(self.around)) for w in self.neighbours(v) if v < w and self.around[v]]
            )
            length = np.linalg.norm(self.vertices[pairs[:, 0]] - self.vertices[pairs[:, 1]], axis=1)
            ratio = length / np.minimum(wanted[pairs[:, 0]], wanted[pairs[:, 1]])
            done, busy = 0, set()
            for v, w in pairs[np.argsort(ratio)][: (ratio < least).sum()].tolist():
                # the end at the sharper place stays
                gone, kept = (v, w) if wanted[v] >= wanted[w] else (w, v)
                if gone in busy or kept in busy:
                    continue
                ring = self.neighbours(gone)
                if self.collapse(gone, kept) or self.collapse(kept, gone):
                    done += 1
                    busy |= ring | {gone}
            if done == 0:
                return

    def flip_edges(self) -> None:
        """Flip each edge whose opposite angles add up to more than π (a Delaunay step)."""
        for v in range(len(self.around)):
            for w in [w for w in self.neighbours(v) if v < w]:
                shared = list(self.around[v] & self.around[w])
                if len(shared) != 2:
                    continue
                first, second = (self.faces[i] for i in shared)
                k = next(i for i in range(3) if first[i] not in (v, w))
                a, p, q = first[k], first[k - 2], first[k - 1]
                b = next(u for u in second if u not in (v, w))
                x = self.vertices
                angles = [
                    np.arctan2(np.linalg.norm(np.cross(x[p] - x[o], x[q] - x[o])), (x[p] - x[o]) @ (x[q] - x[o]))
                    for o in (a, b)
                ]
                if sum(angles) < np.pi + 1e-3 or b in self.neighbours(a):
                    continue
                if min(len(self.neighbours(v)), len(self.neighbours(w))) < 4:
                    continue
                one, two = (a, p, b), (a, b, q)
                if self.upright(first, one) and self.upright(first, two):
                    self.replace(shared[0], one)
                    self.replace(shared[1], two)

    def mesh(self) -> tuple[Reals, Integers, Reals]:
        """Vertices, faces and wanted lengths, without what is gone."""
        live = sorted(set().union(*self.around))
        used, faces = np.unique(np.array([self.faces[i] for i in live]), return_inverse=True)
        return self.vertices[used], faces.reshape(-1, 3), self.wanted[used]


def make() -> tuple[Reals, Integers]:
    """The mesh: vertices (n, 3) and outward-wound faces (m, 3)."""
    vertices, faces = surface_net()
    vertices = relax(onto_skin(vertices), faces, 2)
    skin = Skin(vertices, faces, wanted_length(vertices, faces))
    skin.thin_out(0.75)
    for _ in range(3):
        skin.flip_edges()
        vertices, faces, wanted = skin.mesh()
        skin = Skin(relax(vertices, faces, 2, 0.25), faces, wanted)
        skin.thin_out(0.5)
    vertices, faces, _ = skin.mesh()
    vertices[:, 2] -= vertices[:, 2].min()
    return vertices, faces


if __name__ == "__main__":
    import trimesh
    from trimesh.exchange.ply import export_ply

    mesh = trimesh.Trimesh(*make(), process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DESTINATION
    path.write_bytes(export_ply(mesh, vertex_normal=False))
    print(f"{path}: {len(mesh.faces)} triangles, {mesh.body_count} body, extents {mesh.extents.round(1)}")
