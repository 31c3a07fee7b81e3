"""What no choice of coordinates, units, triangles or vertex order may change, and what waves conserve (THEORY 5)."""

from __future__ import annotations

from typing import Any

import numpy as np
import oracle
import pytest
import trimesh
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from optics import APERTURE, affine, factor, mesh, shape
from scipy.spatial.transform import Rotation

import grimaldi

CORNERS = np.array([[-10, -9], [11, -8], [2, 1], [9, 12], [-12, 10]], float)
LAMP = np.array([3.0, -2, -40])
LIGHT = oracle.Spherical(LAMP)
POINTS = np.array([[0, 0, 60], [15, -4, 60], [-30, 5, 20], [40, 2, 90]], float)
TOLERANCE = 1e-6
FINE: dict[str, Any] = {"tolerance": TOLERANCE, "precision": "double"}

# no shrinking: each example is a computation of its own
few = settings(
    max_examples=6,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
more = settings(few, max_examples=14)
angles, lengths, seeds = st.floats(-3.0, 3.0), st.floats(-50.0, 50.0), st.integers(0, 2**32 - 1)
turns = st.tuples(angles, angles, angles).map(lambda turn: Rotation.from_rotvec(turn).as_matrix())
mirrors = st.sampled_from([(1, 1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1)])
places = st.tuples(lengths, lengths, lengths)


def similar(scale, turn, mirror, move):
    """The (4, 4) matrix that mirrors, turns, moves and then scales everything."""
    return affine(scale) @ affine(1.0, at=move, turn=turn) @ affine(mirror)


def moved(x, matrix):
    return np.asarray(x) @ matrix[:3, :3].T + matrix[:3, 3]


def in_plane(loop):
    return np.c_[loop, np.zeros(len(loop))]


# ------------------------------------------------------------------------------ planar outlines


def planar(matrix=None, *, hole=True, loop=CORNERS, wavelength=1.0):
    """M behind the outline, with light and receivers moved along with `matrix`."""
    to_world = np.eye(4) if matrix is None else matrix
    outline = grimaldi.PlanarOutline(loop, to_world, hole=hole)
    light = oracle.Spherical(moved(LAMP, to_world))
    return factor(light, moved(POINTS, to_world), outlines=[outline], wavelength=wavelength, **FINE)


def reference(hole=True):
    m = oracle.edge_factor(LIGHT, POINTS, oracle.polygon_edge(in_plane(CORNERS)), 1)
    return m if hole else 1 - m


@more
@given(st.floats(-6, 6), turns, mirrors, places, st.booleans())
def test_outlines_similar_with_everything(exponent, turn, mirror, move, hole):
    """Lengths and λ scaled together, rotated, moved, mirrored: the same M."""
    scale = 10**exponent
    computed = planar(similar(scale, turn, mirror, move), hole=hole, wavelength=scale)
    np.testing.assert_allclose(computed, reference(hole), rtol=0, atol=2 * TOLERANCE)


@few
@given(st.integers(0, 4), st.booleans(), st.booleans())
def test_order_of_the_corners(first, backwards, hole):
    """A loop is the same wherever it starts and whichever way it runs."""
    loop = np.roll(CORNERS, first, axis=0)[:: -1 if backwards else 1]
    np.testing.assert_allclose(planar(hole=hole, loop=loop), reference(hole), rtol=0, atol=2 * TOLERANCE)


@few
@given(mirrors, st.booleans())
def test_a_mirrored_frame(mirror, hole):
    """The same corners in the world, written in a mirrored frame: the same M."""
    outline = grimaldi.PlanarOutline(CORNERS * mirror[:2], affine(mirror), hole=hole)
    computed = factor(LIGHT, POINTS, outlines=[outline], **FINE)
    np.testing.assert_allclose(computed, reference(hole), rtol=0, atol=2 * TOLERANCE)


def star(seed, corners=9):
    """A star-shaped polygon (corners, 2) about the origin, 4 to 14 wide."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.8, corners)) / corners
    return rng.uniform(4, 14, corners)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@few
@given(seeds, st.booleans(), st.sampled_from([LIGHT, oracle.Plane((0, 0, 1)), oracle.Plane((0.6, 0, 0.8))]))
def test_babinet(seed, island, light):
    """A mask passes what a hole of the same loops stops: M_hole + M_mask = 1, by two models in turn."""
    loops = [star(seed), 0.3 * star(seed)] if island else star(seed)
    outlines = {hole: [grimaldi.PlanarOutline(loops, hole=hole)] for hole in (True, False)}
    for by_area in (None, True, False):
        hole, mask = (
            factor(
                light, POINTS, outlines=outlines[hole], diffraction="area" if hole is by_area else "boundary", **FINE
            )
            for hole in (True, False)
        )
        assert abs(hole).max() > 0.02
        np.testing.assert_allclose(hole + mask, 1, rtol=0, atol=2 * TOLERANCE)


@few
@given(seeds, st.floats(0, 3))
def test_superposition_of_holes(seed, turn):
    """Holes that do not overlap pass the sum of what each of them passes."""
    x, y = np.cos(turn), np.sin(turn)
    holes = [grimaldi.PlanarOutline(star(seed) + 15 * side * np.array([x, y])) for side in (-1, 1)]
    both = factor(LIGHT, POINTS, outlines=holes, **FINE)
    apart = [factor(LIGHT, POINTS, outlines=[hole], **FINE) for hole in holes]
    assert min(abs(m).max() for m in apart) > 0.05
    np.testing.assert_allclose(both, sum(apart), rtol=0, atol=3 * TOLERANCE)


PLANAR = {
    "hole": ([], [grimaldi.PlanarOutline(CORNERS)]),
    "mask": ([], [grimaldi.PlanarOutline([CORNERS, 0.25 * CORNERS], hole=False)]),
    "aperture": ([shape("disk", affine((10, 5, 1), turn=[[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]), APERTURE)], []),
    "disk": ([shape("disk", affine(8))], []),
    "rectangle": ([shape("rectangle", affine((6, 9, 1)))], []),
}


@pytest.mark.parametrize("screen", PLANAR)
@few
@given(st.tuples(st.floats(-30, 30), st.floats(-30, 30)), st.tuples(st.floats(-30, 30), st.floats(-30, 30)))
def test_reciprocity(screen, source, receiver):
    """Lamp and receiver change places: U stays, and M with it, for planar screens."""
    shapes, outlines = PLANAR[screen]
    s, p = (*source, -50.0), (*receiver, 70.0)
    tolerance = 1e-5
    there, back = (
        factor(oracle.Spherical(a), [b], *shapes, outlines=outlines, tolerance=tolerance) for a, b in ((s, p), (p, s))
    )
    np.testing.assert_allclose(there, back, rtol=0, atol=2 * tolerance)


@pytest.mark.parametrize(("radius", "expected", "digit"), [(5.0, 0.983, 1e-3), (100.0, 0.9991, 1e-4)])
def test_flux_behind_an_aperture(radius, expected, digit):
    """∫ Im(U* ∂zU)/k dA behind a circular hole, over πa²: 0.983 at a = 5λ, 0.9991 at 100λ (THEORY 5).

    In the plane z = a, by the polar angle θ up to the rim and beyond it; what is beyond 89.9° is 2e-3 of what
    turns that far. ∂z from two planes: Im(U1* U2)/sin 2kh is exact for light straight on.
    """
    z, step, k = radius, 0.01, 2 * np.pi
    x, w = np.polynomial.legendre.leggauss(int(60 + 1.5 * radius))
    spans = [(0, np.pi / 4), (np.pi / 4, np.radians(89.9))]
    theta = np.concatenate([low + (high - low) * (x + 1) / 2 for low, high in spans])
    weight = np.concatenate([(high - low) * w / 2 for low, high in spans])
    rho = z * np.tan(theta)
    area = weight * z / np.cos(theta) ** 2 * 2 * np.pi * rho
    heights = np.repeat([z - step, z + step], len(rho))
    points = np.stack([np.tile(rho, 2), 0 * heights, heights], axis=1)
    light, hole = oracle.Plane((0, 0, 1)), grimaldi.PlanarOutline.ellipse(affine(radius))
    M = factor(light, points, outlines=[hole], tolerance=1e-4, precision="double")
    before, after = (M * light.wave(points, k)[0]).reshape(2, -1)
    flux = (np.imag(before.conj() * after) / np.sin(2 * k * step) * area).sum() / (np.pi * radius**2)
    assert flux == pytest.approx(expected, abs=0.5 * digit)


# --------------------------------------------------------------------------------------- bodies

TILTED = Rotation.from_rotvec((0.4, -0.7, 0.3)).as_matrix()
BODIES: dict[str, tuple[Any, dict[str, Any]]] = {
    "cube": (affine((8, 6, 2), turn=TILTED), {}),
    "sphere": (affine(8), {}),
    "disk": (affine((8, 5, 1), turn=TILTED), {}),
    "rectangle": (affine((8, 5, 1), turn=TILTED), {}),
    "cylinder": (affine(1.0, turn=TILTED), {"p0": [0, -9, 1], "p1": [0, 8, -2], "radius": 4.0}),
    "cone": (affine((4, 5, 9), turn=TILTED), {"p0": [0, 0, -1], "p1": [0, 0, 1]}),
}


@pytest.mark.parametrize("kind", BODIES)
@few
@given(st.floats(-3, 3), turns, mirrors, places)
def test_bodies_similar_with_everything(kind, exponent, turn, mirror, move):
    """Lengths and λ scaled together, rotated, moved, mirrored: the same M.

    Mitsuba keeps shapes in Float32: a position of 100 is known to 4e-6, a phase of kθ 4e-6 = 1e-5.
    """
    local, parameters = BODIES[kind]
    scale = 10**exponent
    matrix = similar(scale, turn, mirror, move)
    body = shape(kind, matrix @ local, **parameters)
    computed = factor(
        oracle.Spherical(moved(LAMP, matrix)), moved(POINTS, matrix), body, wavelength=scale, tolerance=1e-4
    )
    plain = factor(LIGHT, POINTS, shape(kind, local, **parameters), tolerance=1e-4)
    assert abs(plain - 1).max() > 0.3
    np.testing.assert_allclose(computed, plain, rtol=0, atol=1e-3)


@few
@given(st.sampled_from(["cube", "sphere", "disk", "rectangle"]), mirrors)
def test_a_body_mirrored_in_its_own_planes(kind, mirror):
    """A body with these planes of symmetry is the same body when `to_world` mirrors it."""
    plain, mirrored = (
        factor(LIGHT, POINTS, shape(kind, affine(8 * np.array(m))), tolerance=1e-5) for m in ((1, 1, 1), mirror)
    )
    assert abs(plain - 1).max() > 0.3
    np.testing.assert_allclose(mirrored, plain, rtol=0, atol=2e-5)


def shuffled(faces, seed):
    """The same triangles in any order, from any corner, wound any way."""
    rng = np.random.default_rng(seed)
    faces = faces[rng.permutation(len(faces))]
    return np.stack([np.roll(face, rng.integers(3))[:: rng.choice([1, -1])] for face in faces])


SOLIDS = {
    "box": trimesh.creation.box((16, 12, 4)),
    "icosphere": trimesh.creation.icosphere(subdivisions=2, radius=8),
    "torus": trimesh.creation.torus(7, 2, major_sections=16, minor_sections=8),
}
LIGHTS = {"aside": LIGHT, "along the walls": oracle.Plane((0, 0, 1)), "in a wall": oracle.Spherical((8, 0, -40))}


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("solid", SOLIDS)
@few
@given(seed=seeds)
def test_vertex_order_and_winding(tmp_path, solid, light, seed):
    """A surface is its set of triangles: neither their order nor the way they turn matters, edge-on ones included."""
    body = SOLIDS[solid]
    given_, other = (
        factor(LIGHTS[light], POINTS, mesh(tmp_path / f"{i}.obj", body.vertices, faces), tolerance=1e-5)
        for i, faces in enumerate((body.faces, shuffled(np.array(body.faces), seed)))
    )
    assert abs(given_ - 1).max() > 0.3
    np.testing.assert_allclose(other, given_, rtol=0, atol=2e-5)


def split(vertices, faces, rng):
    """One edge, and the faces beside it, cut at a random place; or one face at a random point inside."""
    corner = int(rng.integers(len(faces)))
    first, second, third = np.roll(faces[corner], int(rng.integers(3)))
    new = len(vertices)
    if rng.random() < 0.5:
        weight = rng.dirichlet([1, 1, 1])
        x = weight @ vertices[[first, second, third]]
        parts = [
            faces[np.arange(len(faces)) != corner],
            [[first, second, new], [second, third, new], [third, first, new]],
        ]
    else:
        x = vertices[first] + rng.uniform(0.02, 0.98) * (vertices[second] - vertices[first])
        beside = (np.isin(faces, (first, second)).sum(axis=1)) == 2
        halves = [np.where(faces[beside] == end, new, faces[beside]) for end in (first, second)]
        parts = [faces[~beside], *halves]
    return np.concatenate([vertices, x[None]]), np.concatenate(parts)


@pytest.mark.parametrize(
    ("light", "solid"), [*((light, "box") for light in LIGHTS), ("aside", "icosphere"), ("aside", "torus")]
)
@few
@given(seed=seeds, times=st.integers(1, 60))
def test_remeshing(tmp_path, light, solid, seed, times):
    """Faces and edges cut anywhere leave the surface as it is: the same M, to what Float32 vertices leave of it.

    Edge-on faces only of the box: its planes are exact in Float32, others' cuts would tilt out of the light.
    """
    rng = np.random.default_rng(seed)
    vertices, faces = np.array(SOLIDS[solid].vertices), np.array(SOLIDS[solid].faces)
    plain = factor(LIGHTS[light], POINTS, mesh(tmp_path / "a.obj", vertices, faces), tolerance=1e-5)
    for _ in range(times):
        vertices, faces = split(vertices, faces, rng)
    cut = factor(LIGHTS[light], POINTS, mesh(tmp_path / "b.obj", vertices, faces), tolerance=1e-5)
    np.testing.assert_allclose(cut, plain, rtol=0, atol=5e-5)


# -------------------------------------------------------------------------------------- sources

lamps = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-90, -30), st.floats(0.1, 1e3), angles)


@few
@given(st.lists(lamps, min_size=2, max_size=4), st.floats(0.5, 20))
def test_superposition_of_sources(lights, wavelength):
    """Eq. 3: fields add in a group, intensities across groups; each light's amplitude and phase are a factor of U."""
    body = {"ball": shape("sphere", affine(8)), "plate": shape("rectangle", affine(6, at=(12, 3, 9)))}

    def field(*chosen: tuple[float, ...], **strength: Any):
        scene: dict[str, Any] = {"type": "scene", **body}
        for i, (x, y, z, amplitude, phase) in enumerate(chosen):
            light = {"type": "coherent_point", "position": [x, y, z], "amplitude": amplitude, "phase": phase}
            scene[f"light{i}"] = {**light, **strength}
        return grimaldi.field(scene, POINTS, wavelength=wavelength)

    together, alone = field(*lights), [field(light) for light in lights]
    scale = max(abs(one.U.values).max() for one in alone)
    np.testing.assert_allclose(together.U, sum(one.U.values for one in alone), rtol=0, atol=1e-12 * scale)
    unit = field(lights[0], amplitude=1.0, phase=0.0)
    amplitude, phase = lights[0][3:]
    np.testing.assert_allclose(alone[0].U, amplitude * np.exp(1j * phase) * unit.U, rtol=1e-9)
    np.testing.assert_allclose(alone[0].error, amplitude * unit.error, rtol=1e-9)
