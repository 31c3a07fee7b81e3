"""Planar outlines: what they take, how they keep it, and what they refuse."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import grimaldi
from grimaldi import PlanarOutline
from grimaldi.errors import InputError, NotYet

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def area(loop):
    """Signed, positive where the loop runs counterclockwise."""
    x, y = loop.T
    return 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))


@pytest.mark.parametrize("turn", [1, -1])
def test_loops_run_by_their_nesting_whatever_way_they_are_given(turn):
    outline = PlanarOutline([SQUARE[::turn], 0.5 * SQUARE[::turn], 0.25 * SQUARE[::turn], SQUARE + 5])
    assert [area(loop) for loop in outline.loops] == [4.0, -1.0, 0.25, 4.0]


def test_world_loops_are_exact_in_float64():
    to_world = np.array([[0, 0, 1, 1e6], [3, 0, 0, 2.000000001], [0, 2, 0, 3], [0, 0, 0, 1.0]])
    outline = PlanarOutline(SQUARE * 1.000000001, to_world)
    expected = np.stack([np.full(4, 1e6), 3 * SQUARE[:, 0], 2 * SQUARE[:, 1]], axis=1)
    expected[:, 1:] = expected[:, 1:] * 1.000000001 + [2.000000001, 3]
    (loop,) = outline.world_loops()
    np.testing.assert_allclose(loop, expected, rtol=1e-15)
    np.testing.assert_array_equal(outline.normal, [1, 0, 0])
    np.testing.assert_array_equal(outline.origin, to_world[:3, 3])


@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_mono"])
def test_a_mitsuba_transform_serves_as_to_world(variant):
    transform = getattr(mi, variant).Transform4f().translate([1, 2, 3])
    np.testing.assert_array_equal(PlanarOutline(SQUARE, transform).origin, [1, 2, 3])


def test_an_ellipse_is_kept_as_such():
    outline = PlanarOutline.ellipse(np.diag([2.0, 3.0, 1.0, 1.0]), hole=False)
    assert outline.is_ellipse
    assert not outline.hole
    assert outline.loops == ()
    (loop,) = outline.world_loops(segments=100)
    assert loop.shape == (100, 3)
    np.testing.assert_allclose((loop[:, 0] / 2) ** 2 + (loop[:, 1] / 3) ** 2, 1, rtol=1e-14)
    assert not PlanarOutline(SQUARE).is_ellipse


def test_repeated_corners_and_a_repeated_first_one_change_nothing():
    outline = PlanarOutline(SQUARE[[0, 1, 1, 2, 3, 0]])
    assert len(outline.loops[0]) == 4
    assert area(outline.loops[0]) == 4


@pytest.mark.parametrize(
    "text",
    [
        "# x, y\n-1,-1\n1,-1\n1,1\n-1,1\n\n\n4,4\n6,4\n6,6\n4,6\n",
        "-1 -1\n1 -1\n1 1\n-1 1\nnan nan\n4;4\n6; 4\n6;6\n4\t6",
    ],
)
def test_csv(tmp_path: Path, text):
    (tmp_path / "two.csv").write_text(text)
    first, second = PlanarOutline(tmp_path / "two.csv").loops
    np.testing.assert_array_equal(first, SQUARE)
    np.testing.assert_array_equal(second, SQUARE + 5)


@pytest.mark.parametrize(
    "array", [np.stack([SQUARE, SQUARE + 5]), np.concatenate([SQUARE, [[np.nan, np.nan]], SQUARE + 5])]
)
def test_npy(tmp_path: Path, array):
    np.save(tmp_path / "two.npy", array)
    first, second = PlanarOutline(str(tmp_path / "two.npy")).loops
    np.testing.assert_array_equal(first, SQUARE)
    np.testing.assert_array_equal(second, SQUARE + 5)


@pytest.mark.parametrize(
    ("loops", "says"),
    [
        ([[0, 0], [1, 1]], "loop 1: has 2 different corners"),
        ([[0, 0], [1, 1], [0, 0]], "loop 1: has 2 different corners"),
        ([[0, 0], [1, 1], [3, 3]], "loop 1: has no area"),
        ([[0, 0], [1, np.inf], [1, 0]], "loop 1: corner 2 is not finite"),
        ([[0, 0], [1, np.nan], [1, 0]], "loop 1: corner 2 is not finite"),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], r"loop 1: crosses or touches itself at \(1, 1\)"),
        ([SQUARE, SQUARE + 0.5], "loops 1 and 2 cross or touch"),
        ([SQUARE, SQUARE + [2, 0]], "loops 1 and 2 cross or touch"),
        ([], r"loops of shape \(0,\)"),
        ([[1, 2, 3]], r"loops of shape \(1, 3\)"),
        (None, "give .* corners"),
        ("outline.svg", "outline.svg: outlines are read from .csv and .npy"),
        ("absent.csv", "absent.csv: cannot be read"),
    ],
)
def test_wrong_loops_are_named(loops, says):
    with pytest.raises(InputError, match=says) as error:
        PlanarOutline(loops)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.csv", b"0,0\n1,0\n1,a\n", "a.csv, line 3: '1,a' is not two numbers"),
        ("a.csv", b"0,0,0\n", "a.csv, line 1: '0,0,0' is not two numbers"),
        ("a.csv", b"", "a.csv: has no loops"),
        ("a.csv", b"\xff\xfe", "a.csv: is no .csv file"),
        ("a.npy", b"", "a.npy: is no .npy file"),
        ("a.npy", b"\x93NUMPY\x01\x00", "a.npy: is no .npy file"),
    ],
)
def test_wrong_files_are_named(tmp_path: Path, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says):
        PlanarOutline(tmp_path / name)


@pytest.mark.parametrize("to_world", [np.zeros((4, 4)), np.eye(3), np.diag([1, 0, 1, 1]), np.eye(4) * np.nan, "x"])
def test_wrong_to_world_is_named(to_world):
    with pytest.raises(InputError, match=r"to_world is (singular|no affine map)"):
        PlanarOutline(SQUARE, to_world)


def test_a_mask_among_bodies_is_refused_not_ignored():
    """Its shadow would be computed, but not the ball's."""
    square = np.array([[-5, -5], [5, -5], [5, 5], [-5, 5]], float)
    place = np.eye(4)
    place[2, 3] = 50
    scene = {
        "type": "scene",
        "light": {"type": "coherent_directional", "direction": [0, 0, -1]},
        "ball": {"type": "sphere", "center": [40, 0, 20], "radius": 10},
    }
    with pytest.raises(NotYet, match="ball"):
        grimaldi.load(scene, outlines=[grimaldi.PlanarOutline(square, place, hole=False)])
