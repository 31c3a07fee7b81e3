"""Many points on a plane behind holes as one transform: against the line integral and closed forms."""

import warnings

import numpy as np
import pytest

import grimaldi
from grimaldi import PlanarOutline
from grimaldi.diffraction import fresnel_plane as fast
from grimaldi.diffraction import quadrature, transform
from grimaldi.diffraction.lattice import lattice
from grimaldi.diffraction.model import Options
from grimaldi.errors import GrimaldiWarning, InputError
from grimaldi.reference import circle

FAR, WAVELENGTH = 1e12, 1.0  # a hole of 1e6 has N = 1 there, and leaves out some 1e-11
TURN = np.pi * np.arange(10) / 5
STAR = (1 + 0.4 * (-1) ** np.arange(10))[:, None] * np.stack([np.cos(TURN), np.sin(TURN)], axis=1)
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)


def ellipse(x, y, hole=True):
    return PlanarOutline.ellipse(np.diag([x, y, 1.0, 1.0]), hole=hole)


def holes(a):
    return {
        "circle": [ellipse(a, a)],
        "ellipse": [ellipse(a, 0.6 * a)],
        "rectangle": [PlanarOutline(a * SQUARE * [1, 0.5])],
        "star": [PlanarOutline(a * STAR)],
        "star with an island": [PlanarOutline([a * STAR, 0.3 * a * SQUARE])],
        "two holes": [PlanarOutline(0.5 * a * SQUARE - [a, 0]), PlanarOutline(0.3 * a * STAR + [a, 0])],
        "mask": [PlanarOutline(a * STAR, hole=False)],
    }


def lights(z1, tilt):
    return {
        "plane": {"type": "coherent_directional", "direction": [0, 0, 1]},
        "oblique plane": {"type": "coherent_directional", "direction": [tilt, -tilt / 2, 1]},
        "point": {"type": "coherent_point", "position": [tilt * z1, 0.3 * tilt * z1, -z1], "amplitude": z1},
    }


def grid(b, z, shape=(5, 6), at=(0, 0)):
    rows, columns = (np.linspace(-b, b, n) for n in shape)
    x, y = np.meshgrid(columns + at[0], rows + at[1])
    return np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3)


def scattered(b, z, n=30):
    xy = np.random.default_rng(1).uniform(-b, b, (n, 2))
    return np.concatenate([xy, np.full((n, 1), z)], axis=1)


@pytest.fixture
def acts(monkeypatch):
    """Whether each call of the fast path served; its cost is taken to be nothing."""
    answers = []
    original = fast.fresnel_plane

    def spied(*arguments):
        result = original(*arguments)
        answers.append(result is not None)
        return result

    monkeypatch.setattr("grimaldi.propagate.fresnel_plane", spied)
    monkeypatch.setattr(fast, "seconds", lambda *_: 0.0)
    return answers


def both(scene, points, tolerance, wavelength=WAVELENGTH, line_tolerance=None):
    ours = grimaldi.field(scene, points, wavelength=wavelength, tolerance=tolerance)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GrimaldiWarning)  # of circles this large polygons leave some 1e-9
        line = grimaldi.field(
            scene, points, wavelength=wavelength, tolerance=line_tolerance or tolerance, precision="double", fast=False
        )
    return ours, line


@pytest.mark.parametrize(
    ("light", "layout"), [("plane", grid), ("oblique plane", scattered), ("point", grid), ("point", scattered)]
)
@pytest.mark.parametrize("hole", holes(1))
def test_it_is_the_line_integral_where_nothing_is_left_out(hole, light, layout, acts):
    a, tilt = 8e5, 1e-7
    scene = grimaldi.load({"type": "scene", "light": lights(FAR, tilt)[light]}, outlines=holes(a)[hole])
    ours, line = both(scene, layout(2 * a, FAR), 1e-9, line_tolerance=1e-10)
    assert acts == [True]
    assert abs(line.U.values).max() > 0.2
    np.testing.assert_allclose(ours.U.values, line.U.values, rtol=0, atol=1e-9)
    assert float(ours.error.max()) <= 1e-9


@pytest.mark.parametrize("number", [0.5, 2, 3.3])
def test_a_circle_on_its_axis(number, acts):
    """I = 4 sin²(πN/2) (THEORY 5)."""
    radius = np.sqrt(number * WAVELENGTH * FAR)
    scene = grimaldi.load({"type": "scene", "light": lights(FAR, 0)["plane"]}, outlines=[ellipse(radius, radius)])
    result = grimaldi.field(scene, grid(radius, FAR, (9, 9)), wavelength=WAVELENGTH, tolerance=1e-7)
    assert acts == [True]
    assert float(result.intensity[40]) == pytest.approx(4 * np.sin(np.pi * number / 2) ** 2, abs=4e-7)
    assert abs(result.U.values[0, 0, 40]) == pytest.approx(abs(circle.fresnel(radius, FAR, WAVELENGTH)), abs=1e-7)


def test_the_bound_is_kept_wherever_it_acts(acts):
    random = np.random.default_rng(7)
    served = 0
    for _ in range(14):
        a, z = 10 ** random.uniform(1.5, 2.5), 10 ** random.uniform(3.5, 6)
        b, tolerance = a * 10 ** random.uniform(-1, 0.5), random.choice([1e-5, 1e-4, 1e-3])
        hole = random.choice([name for name in holes(1) if "circle" not in name and "ellipse" not in name])
        light = random.choice(list(lights(1, 0)))
        tilt = random.uniform(0, 0.1)
        scene = grimaldi.load({"type": "scene", "light": lights(z, tilt)[light]}, outlines=holes(a)[hole])
        at = {"plane": 0, "oblique plane": tilt * z, "point": -tilt * z}[light]
        points = grid(b, z, (7, 7), at=(at, -at / 2 if light == "oblique plane" else 0.3 * at))
        acts.clear()
        ours, line = both(scene, points, tolerance, line_tolerance=1e-7)
        if acts != [True]:
            continue
        served += 1
        u0 = 1 if light != "point" else z / np.linalg.norm(points - [tilt * z, 0.3 * tilt * z, -z], axis=1)
        assert (abs(ours.U.values - line.U.values)[0, 0] <= ours.error.values[0, 0]).all(), (hole, light, a, z, b)
        assert (ours.error.values[0, 0] / u0 <= tolerance * (1 + 1e-12)).all()
    assert served >= 4


@pytest.mark.parametrize("hole", ["circle", "star", "mask"])
def test_fine_lattices_are_interpolated_within_the_tolerance(hole, acts, monkeypatch):
    """300 × 280 points where 60 × 60 would do, at N = 5: some of them along the outlines."""
    a, z, tolerance = 6e4, 7.2e8, 1e-6
    used = []
    coarser = transform.coarser
    monkeypatch.setattr(transform, "coarser", lambda *given: used.append(coarser(*given)) or used[-1])
    scene = grimaldi.load({"type": "scene", "light": lights(z, 0)["plane"]}, outlines=holes(a)[hole])
    points = grid(1.2 * a, z, (300, 280))
    ours = grimaldi.field(scene, points, wavelength=WAVELENGTH, tolerance=tolerance)
    assert acts == [True]
    assert used[-1] is not None
    chosen = np.random.default_rng(4).choice(len(points), 60, replace=False)
    chosen[:4] = [0, 279, len(points) - 280, len(points) - 1]
    line = grimaldi.field(scene, points[chosen], wavelength=WAVELENGTH, tolerance=1e-8, precision="double", fast=False)
    off = abs(ours.U.values[0, 0, chosen] - line.U.values[0, 0])
    assert (off <= ours.error.values[0, 0, chosen]).all()
    assert float(ours.error.max()) <= tolerance


def test_it_leaves_alone_what_it_cannot_do_within_the_tolerance(acts):
    a, z = 100.0, 1e5  # N = 0.1; over the points' square k d⁴/8z³ is 1e-4
    scene = grimaldi.load({"type": "scene", "light": lights(z, 0)["plane"]}, outlines=holes(a)["star"])
    points = grid(20 * a, z)
    ours, line = both(scene, points, 1e-9)
    assert acts == [False]
    np.testing.assert_array_equal(ours.U.values, line.U.values)
    near = grid(3, 30.0)
    grimaldi.field(scene, near, wavelength=WAVELENGTH, tolerance=1e-2)
    assert acts == [False, False]


@pytest.mark.parametrize("shape", ["disc", "square"])
@pytest.mark.parametrize("radius", [2.5e-3, 1e-9])
def test_a_pinhole(shape, radius):
    """Far behind holes much smaller than the wavelength, where any rule would serve: |U| is area / (λ z)."""
    corners = radius * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    hole = PlanarOutline.ellipse(np.diag([radius, radius, 1, 1])) if shape == "disc" else PlanarOutline(corners)
    scene = {"type": "scene", "l": {"type": "coherent_directional", "direction": [0, 0, 1]}}
    area = (np.pi if shape == "disc" else 4) * radius**2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GrimaldiWarning)  # the light is fainter than a tolerance
        U = grimaldi.field(grimaldi.load(scene, outlines=[hole]), [[0, 0, 1e3]], wavelength=5e-4, tolerance=1e-2).U
    assert abs(U.values.item()) == pytest.approx(area / 0.5, abs=1e-6)


def test_off_means_off(acts):
    scene = grimaldi.load({"type": "scene", "light": lights(FAR, 0)["plane"]}, outlines=holes(1e6)["star"])
    grimaldi.field(scene, grid(1e6, FAR), wavelength=WAVELENGTH, fast=False)
    grimaldi.field(scene, grid(1e6, FAR), wavelength=WAVELENGTH, diffraction="none")
    assert acts == []
    with pytest.raises(InputError, match="fast: 'no' is neither True nor False"):
        grimaldi.field(scene, grid(1e6, FAR), wavelength=WAVELENGTH, fast="no")  # pyright: ignore[reportArgumentType]


def test_a_few_planes_each_by_its_own_transform_and_the_rest_along_the_rim(acts):
    scene = grimaldi.load({"type": "scene", "light": lights(FAR, 0)["plane"]}, outlines=holes(1e6)["two holes"])
    points = np.concatenate([grid(1e6, FAR), scattered(1e6, 2 * FAR), grid(1e6, -FAR), grid(1e6, 1e6 * np.sqrt(3))])
    points = np.random.default_rng(3).permutation(points)
    ours, line = both(scene, points, 1e-7)
    assert sorted(acts) == [False, True, True]
    np.testing.assert_allclose(ours.U.values, line.U.values, rtol=0, atol=2e-7)
    acts.clear()
    tilted = grid(1e6, FAR) + np.array([0, 0, 1]) * np.arange(30)[:, None]
    grimaldi.field(scene, tilted, wavelength=WAVELENGTH)
    assert acts == []


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("hole", holes(1))
def test_quadrature_keeps_its_share(hole, tolerance):
    """e^{i g·x} of the steepest phase that a rule is made for, against a rule for four times as much."""
    scene = grimaldi.load({"type": "scene", "light": lights(FAR, 0)["plane"]}, outlines=holes(1.0)[hole])
    slope, direction = 90.0, np.array([0.6, 0.8, 0])

    def transform(by):
        total, area = 0j, 0.0
        for part in quadrature.patches(scene):
            x, w = quadrature.nodes(part, part.rule(by * slope, tolerance))
            total, area = total + w @ np.exp(1j * slope * (x @ direction)), area + abs(part.area).sum()
        return total / area

    assert abs(transform(1) - transform(4)) <= tolerance


@pytest.mark.parametrize("width", [4, 7, 11, 16])
@pytest.mark.parametrize("n", [100, 101])
def test_waves_of_any_length_in_the_band_are_interpolated(width, n):
    band = 0.2
    coarse = transform.Coarse.of(n, band, width)
    assert coarse.spacing > 5
    xi = np.linspace(-band, band, 41)
    far, near = ((np.arange(count) - count // 2)[:, None] for count in (coarse.size, n))
    got = coarse(np.exp(1j * xi * coarse.spacing * far) / coarse.spectrum(xi))
    np.testing.assert_allclose(got, np.exp(1j * xi * near), rtol=0, atol=coarse.error)
    assert coarse.error < 30 * abs(got - np.exp(1j * xi * near)).max() + 1e-13


@pytest.mark.parametrize("eps", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("bands", [(0.1, 0.2), (0.0, 0.3), (1.5, 2.0)])
def test_sums_on_a_lattice_are_the_sums(bands, eps):
    """Against the sums themselves; with all waves at the corners of the band, where they are hardest."""
    rows, columns = 150, 131
    coarse = transform.coarser(rows, columns, bands[0], bands[1], eps)
    assert (coarse is None) == (bands == (1.5, 2.0))
    random = np.random.default_rng(2)
    for at in (random.uniform(-1, 1, (2, 300)), random.choice([-1, 1], (2, 300))):
        a_row, a_point = np.array(bands)[:, None] * at
        c = np.asarray(np.exp(2j * np.pi * random.uniform(size=300)) / 300, complex)
        got = transform.on_lattice(rows, columns, a_row, a_point, c, eps)
        row, column = np.arange(rows) - rows // 2, np.arange(columns) - columns // 2
        exact = np.exp(1j * row[:, None] * a_row) @ (c[:, None] * np.exp(1j * np.outer(a_point, column)))
        np.testing.assert_allclose(got, exact, rtol=0, atol=eps if coarse else fast.EXCESS * eps)


def test_a_lattice_is_known_by_its_rows():
    found = lattice(grid(3.0, 1.0, (4, 7)) @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0])
    assert found is not None
    assert (found.rows, found.columns) == (4, 7)
    for at in (3, 11, 27):
        moved = grid(3.0, 1.0, (4, 7))
        moved[at, 0] += 1e-6
        assert lattice(moved) is None
    large = grid(3.0, 1.0, (300, 257))  # more than are checked at a time
    assert lattice(large) is not None
    large[299 * 257 - 5, 2] += 1e-12
    assert lattice(large) is None
    assert lattice(grid(3.0, 1.0, (2, 5000))) is not None


def test_options_carry_it():
    assert Options().fast
    assert grimaldi.field("knife-edge", [[0, 0, 0]], wavelength="532 nm", fast=False).attrs["fast"] == "false"
