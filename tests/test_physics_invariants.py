"""What no choice of coordinates, units or vertex order may change."""

import numpy as np
import oracle
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from optics import affine, factor, shape
from scipy.spatial.transform import Rotation

import grimaldi

CORNERS = np.array([[-10, -9], [11, -8], [2, 1], [9, 12], [-12, 10]], float)
LAMP = np.array([3.0, -2, -40])
POINTS = np.array([[0, 0, 60], [15, -4, 60], [-30, 5, 20], [40, 2, 90]], float)
TOLERANCE = 1e-6

# no shrinking: each example is a computation of its own
few = settings(max_examples=6, deadline=None, derandomize=True, phases=[Phase.generate])
angles = st.floats(-3.0, 3.0)
lengths = st.floats(-50.0, 50.0)


def rigid(turn, move):
    return affine(1.0, at=move, turn=Rotation.from_rotvec(turn).as_matrix())


def moved(x, matrix):
    return np.asarray(x) @ matrix[:3, :3].T + matrix[:3, 3]


def planar(matrix=None, *, hole=True, loop=CORNERS, wavelength=1.0):
    """M behind the outline, with light and receivers moved along with `matrix`."""
    to_world = np.eye(4) if matrix is None else matrix
    outline = grimaldi.PlanarOutline(loop, to_world, hole=hole)
    return factor(
        oracle.Spherical(moved(LAMP, to_world)),
        moved(POINTS, to_world),
        outlines=[outline],
        wavelength=wavelength,
        tolerance=TOLERANCE,
        precision="double",
    )


def reference(hole=True):
    corners = np.concatenate([CORNERS, np.zeros((len(CORNERS), 1))], axis=1)
    m = oracle.edge_factor(oracle.Spherical(LAMP), POINTS, oracle.polygon_edge(corners), 1)
    return m if hole else 1 - m


@few
@given(st.tuples(angles, angles, angles), st.tuples(lengths, lengths, lengths), st.booleans())
def test_rigid_motion(turn, move, hole):
    computed = planar(rigid(turn, move), hole=hole)
    np.testing.assert_allclose(computed, reference(hole), rtol=0, atol=2 * TOLERANCE)


@few
@given(st.floats(-6, 6), st.booleans())
def test_scaling_all_lengths_and_the_wavelength(exponent, hole):
    scale = 10**exponent
    computed = planar(affine(scale), hole=hole, wavelength=scale)
    np.testing.assert_allclose(computed, reference(hole), rtol=0, atol=2 * TOLERANCE)


@few
@given(st.integers(0, 4), st.booleans(), st.booleans())
def test_order_of_the_corners(first, backwards, hole):
    loop = np.roll(CORNERS, first, axis=0)[:: -1 if backwards else 1]
    np.testing.assert_allclose(planar(hole=hole, loop=loop), reference(hole), rtol=0, atol=2 * TOLERANCE)


@few
@given(st.sampled_from([(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1)]), st.booleans())
def test_a_mirrored_frame(mirror, hole):
    # The same corners in the world, written in a mirrored frame.
    outline = grimaldi.PlanarOutline(CORNERS * mirror[:2], affine(mirror), hole=hole)
    computed = factor(oracle.Spherical(LAMP), POINTS, outlines=[outline], tolerance=TOLERANCE, precision="double")
    np.testing.assert_allclose(computed, reference(hole), rtol=0, atol=2 * TOLERANCE)


@few
@given(st.tuples(angles, angles, angles), st.tuples(lengths, lengths, lengths), st.floats(-3, 3))
def test_rigid_motion_and_scaling_of_a_body(turn, move, exponent):
    # Mitsuba keeps shapes in Float32: a position of 100 is known to 4e-6, a phase of kθ 4e-6 = 1e-5.
    scale = 10**exponent
    matrix = affine(scale) @ rigid(turn, move)
    body = shape("cube", matrix @ affine((8, 6, 2)))
    light = oracle.Spherical(moved(LAMP, matrix))
    computed = factor(light, moved(POINTS, matrix), body, wavelength=scale, tolerance=1e-4)
    plain = factor(oracle.Spherical(LAMP), POINTS, shape("cube", affine((8, 6, 2))), tolerance=1e-4)
    assert abs(plain - 1).max() > 0.3
    np.testing.assert_allclose(computed, plain, rtol=0, atol=1e-3)


@few
@given(st.floats(0.1, 1e3), st.floats(-3, 3), st.floats(0.05, 20))
def test_the_factor_knows_nothing_of_the_sources_strength(amplitude, phase, wavelength):
    def scene(**strength):
        light = {"type": "coherent_point", "position": list(LAMP), **strength}
        return {"type": "scene", "light": light, "body": shape("disk", affine(8))}

    options = {"wavelength": wavelength, "tolerance": 1e-3}
    plain = grimaldi.field(scene(), POINTS, **options)
    strong = grimaldi.field(scene(amplitude=amplitude, phase=phase), POINTS, **options)
    expected = amplitude * np.exp(1j * phase) * plain.U
    np.testing.assert_allclose(strong.U, expected, rtol=1e-9)
    np.testing.assert_allclose(strong.error, amplitude * plain.error, rtol=1e-9)
