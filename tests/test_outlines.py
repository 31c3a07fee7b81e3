"""Outlines of many and of finely meshed bodies against what their definitions say, edge by edge and ray by ray."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba
import numpy as np
import oracle
import pytest
from numpy.typing import NDArray
from optics import factor, line, mesh

import grimaldi
import grimaldi.outlines.soup as of_soup
from grimaldi.errors import InputError
from grimaldi.outlines.chains import chains
from grimaldi.outlines.extract import edges_of, outline, sight_of, soup_of
from grimaldi.outlines.merging import runs
from grimaldi.outlines.overlaps import Index
from grimaldi.outlines.silhouettes import silhouettes
from grimaldi.scene.model import Body, Mesh, Scene, Source, Sphere

mi: Any = mitsuba
mi.set_variant("llvm_ad_mono")

Reals = NDArray[np.float64]

POINT = Source("lamp", "0", 1.0, 0.0, position=np.array([2.0, 3.0, 9.0]))
INSIDE = Source("lamp", "0", 1.0, 0.0, position=np.array([0.1, 0.05, 0.3]))
PLANE = Source("sun", "0", 1.0, 0.0, direction=np.array([2.0, -1.0, -2.0]) / 3)
SOURCES = pytest.mark.parametrize("source", [POINT, INSIDE, PLANE], ids=["point", "amid", "plane"])


def scene_of(*geometries: Any) -> Scene:
    bodies = tuple(Body(f"body {i}", i, geometry) for i, geometry in enumerate(geometries))
    return Scene("scene", None, None, geometries, bodies, ())


def turned(rng: np.random.Generator) -> Reals:
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def box(n: int, size: tuple[float, float, float] = (1, 1, 1)) -> Mesh:
    """The cube [-size, size] with n × n squares of two triangles on each side, not welded."""
    grid = np.linspace(-1, 1, n + 1)
    u, v = (x.ravel() for x in np.meshgrid(grid, grid, indexing="ij"))
    i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    a = i * (n + 1) + j
    square = np.concatenate([np.stack([a, a + n + 1, a + n + 2], axis=1), np.stack([a, a + n + 2, a + 1], axis=1)])
    vertices, faces = [], []
    for axis in range(3):
        for side in (-1, 1):
            faces.append(square[:, ::side] + len(vertices) * len(u))
            vertices.append(np.roll(np.stack([0 * u + side, u, v], axis=1), axis, axis=1))
    return Mesh(np.concatenate(vertices) * size, np.concatenate(faces))


def ball(levels: int = 1) -> Mesh:
    """An octahedron, each face divided into 4^levels and its corners moved onto the unit sphere."""
    n = 2**levels
    steps = np.array([(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)])
    number = {tuple(step): k for k, step in enumerate(steps)}
    faces = [[number[i, j, n - i - j], number[i + 1, j, n - i - j - 1], number[i, j + 1, n - i - j - 1]]
             for i in range(n) for j in range(n - i)]  # fmt: skip
    faces += [[number[i + 1, j, n - i - j - 1], number[i + 1, j + 1, n - i - j - 2], number[i, j + 1, n - i - j - 1]]
              for i in range(n - 1) for j in range(n - 1 - i)]  # fmt: skip
    signs = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    points = np.concatenate([steps * s for s in signs]) / n
    of = np.array(faces)
    turns = [of[:, :: int(np.prod(s))] + k * len(steps) for k, s in enumerate(signs)]
    return Mesh(points / np.linalg.norm(points, axis=1, keepdims=True), np.concatenate(turns))


def moved(shape: Mesh, scale: float, turn: Reals, at: Reals) -> Mesh:
    return Mesh(scale * shape.vertices @ turn.T + at, shape.faces)


def crowd(seed: int, n: int = 12) -> Scene:
    """Boxes, balls and sheets anywhere, some of them within each other."""
    rng = np.random.default_rng(seed)
    sheet = Mesh(np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    shapes: list[Any] = []
    for i in range(n):
        kind = (box(2), ball(2), sheet)[i % 3]
        shapes.append(moved(kind, rng.uniform(0.3, 1.2), turned(rng), rng.uniform(-3, 3, 3)))
    return scene_of(*shapes, Sphere(rng.uniform(-3, 3, 3), 0.8))


def towards(source: Source, x: Reals) -> Reals:
    if source.position is not None:
        return source.position - x
    assert source.direction is not None
    return -source.direction


def literal_silhouette(shape: Mesh, source: Source) -> set[tuple[bytes, bytes]]:
    """Edges (start, end), all of whose triangles turn the same way round along the rays."""
    turns = defaultdict(list)
    for face in shape.faces:
        corners = shape.vertices[face] + 0.0
        side = np.sign(-np.cross(corners[1] - corners[0], corners[2] - corners[0]) @ towards(source, corners[0]))
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            low, high = sorted([a.tobytes(), b.tobytes()])
            turns[low, high].append(side if a.tobytes() == low else -side)
    bounds = {ends: sum(turn) for ends, turn in turns.items() if abs(sum(turn)) == len(turn)}
    return {(low, high) if total > 0 else (high, low) for (low, high), total in bounds.items()}


@SOURCES
@pytest.mark.parametrize("seed", [0, 1])
def test_silhouettes_are_the_edges_whose_triangles_all_turn_one_way(source, seed):
    scene = crowd(seed)
    edges, body = edges_of(scene, source, [0.1] * len(scene.bodies))
    found = defaultdict(set)
    for start, end, i in zip(edges.start, edges.end, body, strict=True):
        found[int(i)].add((start.tobytes(), end.tobytes()))
    for i, of in enumerate(scene.bodies):
        if isinstance(of.geometry, Mesh):
            assert found[i] == literal_silhouette(of.geometry, source)


@SOURCES
@pytest.mark.parametrize("seed", [2, 3])
def test_hidden_is_what_any_triangle_between_hides(source, seed):
    """Every triangle of the scene is asked for every point, but for the two beside its edge."""
    scene = crowd(seed)
    soup = soup_of(scene)
    edges, body = edges_of(scene, source, [0.01] * len(scene.bodies))
    sight = sight_of(scene.bodies, soup, source, edges, body)
    corners = np.moveaxis(soup.triangles(np.arange(len(soup))), 2, 0)  # (m, coordinate, corner)
    sphere = scene.bodies[-1].geometry
    assert isinstance(sphere, Sphere)
    states = []
    for t in (0.013, 0.46, 0.89):
        which = np.arange(len(edges))
        computed = sight.hidden(which, np.full(len(edges), t))
        for i, x in enumerate(edges.at(which, np.full(len(edges), t))):
            w = towards(source, x)
            with np.errstate(divide="ignore", invalid="ignore"):
                u = np.linalg.solve(corners, np.broadcast_to(x, (len(soup), 3))[..., None])[..., 0]
                v = np.linalg.solve(corners, np.broadcast_to(w, (len(soup), 3))[..., None])[..., 0]
                place = (1 - u.sum(1)) / v.sum(1)  # barycentric weights u + place v add up to 1
            inside = (u + place[:, None] * v >= 0).all(axis=1) & (place > 1e-9)
            inside &= (place < 1) | source.is_plane
            inside[edges.faces[i][edges.faces[i] >= 0]] = False
            expected = inside.any()
            if body[i] != len(scene.bodies) - 1:
                d = x - sphere.centre
                a, b, c = w @ w, w @ d, d @ d - sphere.radius**2
                root = b * b - a * c
                if root > 0:
                    places = (-b + np.array([-1, 1]) * np.sqrt(root)) / a
                    expected |= bool(((places > 0) & ((places < 1) | source.is_plane)).any())
            assert computed[i] == expected, (i, t)
        states.append(computed)
    assert 0.05 < np.mean(states) < 0.95


@pytest.mark.parametrize("seed", range(6))
def test_boxes_of_all_sizes_and_densities_that_overlap(seed):
    rng = np.random.default_rng(seed)

    def boxes(n: int) -> tuple[Reals, Reals]:
        middle = rng.normal(size=(3, n)) * 10 ** rng.uniform(-4, 0, n)
        half = 10 ** rng.uniform(-6, 0.3, n) * rng.uniform(0, 1, (3, n))
        return middle - half, middle + half

    low, high = boxes(400)
    query_low, query_high = boxes(300)
    query_low[:, :3], query_high[:, :3] = -np.inf, np.inf
    query, box = Index(low, high).overlapping(query_low, query_high)
    meet = (query_low[:, :, None] <= high[:, None]) & (query_high[:, :, None] >= low[:, None])
    expected = np.stack(np.nonzero(meet.all(axis=0)))
    order = np.lexsort((box, query))
    np.testing.assert_array_equal(np.stack([query, box])[:, order], expected)


def test_chains_follow_each_other_and_loops_close():
    rng = np.random.default_rng(4)
    x = rng.normal(size=(40, 3))
    # two loops that share a point, and an open way
    ways = [[0, 1, 2, 3, 4, 0], [2, 5, 6, 2], [10, 11, 12, 13]]
    start = np.concatenate([x[way[:-1]] for way in ways])
    end = np.concatenate([x[way[1:]] for way in ways])
    shuffled = rng.permutation(len(start))
    order, chain = chains(start[shuffled], end[shuffled])
    a, b = start[shuffled][order], end[shuffled][order]
    assert sorted(order) == list(range(len(start)))
    same = chain[1:] == chain[:-1]
    assert (a[1:] == b[:-1])[same].all()
    assert (a[0] == x[10]).all()
    assert (b[2] == x[13]).all()
    for number in range(1, chain[-1] + 1):
        of = np.flatnonzero(chain == number)
        assert (a[of[0]] == b[of[-1]]).all()


@SOURCES
def test_bodies_in_one_mesh_or_in_many_have_the_same_outlines(source):
    shapes: list[Any] = [body.geometry for body in crowd(5).bodies[:-1]]
    many = scene_of(*shapes)
    offset = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    faces = [shape.faces + first for shape, first in zip(shapes, offset, strict=False)]
    one = scene_of(Mesh(np.concatenate([shape.vertices for shape in shapes]), np.concatenate(faces)))

    def ends(scene: Scene) -> set[bytes]:
        o = silhouettes(scene, source)
        return {np.concatenate(pair).tobytes() for pair in zip(o.start, o.end, strict=True)}

    assert ends(many) == ends(one)
    lengths = [np.linalg.norm(o.end - o.start, axis=1).sum() for o in (outline(scene, source) for scene in (many, one))]
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-12)
    whole = silhouettes(many, source)
    assert lengths[0] < 0.9 * np.linalg.norm(whole.end - whole.start, axis=1).sum()


@SOURCES
def test_an_outline_does_not_depend_on_the_parts_that_it_is_found_in(source, monkeypatch):
    """Parts of whole bodies for what meets at a point, of any triangles for what is before what."""

    def found() -> Any:
        o = outline(crowd(6), source)
        return np.sort(np.column_stack([o.start, o.end, o.behind, o.body]), axis=0)

    whole = found()
    monkeypatch.setattr(of_soup, "PART", 16)
    assert len(whole) > 100
    np.testing.assert_array_equal(found(), whole)


def in_float32(shape: Mesh, turn: Reals, at: Reals) -> Mesh:
    return Mesh((shape.vertices @ turn.T + at).astype(np.float32).astype(float), shape.faces)


@SOURCES
def test_the_outline_of_a_finely_meshed_box_is_that_of_a_box(source):
    """Its faces' borders go on in one line through 40 edges each, whose corners are rounded to Float32."""
    turn, at = turned(np.random.default_rng(6)), np.array([0.3, -0.2, -4.0])
    size = (3.0, 2.0, 1.0)
    coarse, fine = (scene_of(in_float32(box(n, size), turn, at)) for n in (1, 40))
    for find in (silhouettes, outline):
        a, b = find(coarse, source), find(fine, source)
        assert len(b) == len(a)
        assert len(silhouettes(fine, source)) == len(silhouettes(coarse, source)) <= 6
        nearest = np.linalg.norm(a.start[:, None] - b.start, axis=2).argmin(axis=1)
        for name in ("start", "end", "outward", "normals", "behind"):
            np.testing.assert_allclose(
                getattr(b, name)[nearest], getattr(a, name), atol=3e-4 if name == "normals" else 3e-6
            )
        follows = b.chain[1:] == b.chain[:-1]
        assert (b.end[:-1] == b.start[1:])[follows].all()


def test_a_finely_meshed_boxs_field_is_a_boxs(tmp_path: Path):
    light = oracle.Spherical((2, 3, 40))
    turn = turned(np.random.default_rng(7))
    points = line((-12, 1, -30), (12, -2, -30), 25)
    coarse, fine = (
        factor(
            light,
            points,
            mesh(tmp_path / f"{n}.obj", box(n, (3, 2, 4)).vertices @ turn.T, box(n).faces),
            occlusion=False,
        )
        for n in (1, 24)
    )
    np.testing.assert_allclose(fine, coarse, atol=1e-3)


def test_lines_end_where_something_hides_them():
    """A plate whose border of 20 edges passes behind a bar: two lit segments a crossing, and nothing within."""
    plate = moved(box(20), 1.0, np.diag([1.0, 1.0, 0.01]), np.zeros(3))
    bar = moved(box(1), 1.0, np.diag([0.1, 3.0, 0.1]), np.array([0.0, 0.0, 2.0]))
    found = outline(scene_of(plate, bar), replace(PLANE, direction=np.array([0.0, 0.0, -1.0])))
    of_plate = found.body == 0
    x = 0.5 * (found.start + found.end)[of_plate]
    assert (np.abs(x[:, 0]) > 0.1).all()
    length = np.linalg.norm(found.end - found.start, axis=1)[of_plate].sum()
    assert length == pytest.approx(8 - 2 * 0.2, rel=1e-6)


def test_runs_keep_every_corner_near_their_chord():
    """A circle's arcs of sag s are 2√(2s) wide: so many are left, or up to twice as many."""
    n, sag = 4096, 1e-4
    angle = 2 * np.pi * np.arange(n + 1) / n
    x = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    first = runs(x[:-1], x[1:], np.zeros(n - 1, bool), np.full(n, sag))
    last = np.append(first[1:], n)
    for a, b in zip(first, last, strict=True):
        chord = (x[b] - x[a]) / np.linalg.norm(x[b] - x[a])
        v = x[a:b] - x[a]
        assert np.linalg.norm(v - (v @ chord)[:, None] * chord, axis=1).max() <= sag
    least = 2 * np.pi / (2 * np.sqrt(2 * sag))
    assert least <= len(first) <= 2.1 * least


def test_runs_keep_ways_back_and_breaks():
    x = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0], [2, 0, 0]])
    assert list(runs(x[:-1], x[1:], np.zeros(2, bool), np.full(3, 0.1))) == [0, 2]
    straight = np.arange(6.0)[:, None] * [1, 0, 0]
    assert list(runs(straight[:-1], straight[1:], np.array([False, True, False, False]), np.zeros(5))) == [0, 2]


def test_an_instance_in_a_ready_scene_is_refused_in_one_line():
    group = {"type": "shapegroup", "ball": {"type": "sphere"}}
    copy = {"type": "instance", "of": {"type": "ref", "id": "group"}}
    ready = mi.load_dict({"type": "scene", "group": group, "copy": copy, "light": {"type": "point"}})
    with pytest.raises(InputError, match="copy: an instance"):
        grimaldi.load(ready)
