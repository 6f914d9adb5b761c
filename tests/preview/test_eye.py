"""The eye: where it looks, and that matrix, planes and pixels tell the same of what it sees."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import numpy as np
import pytest

from vegtool.arrays import FloatArray
from vegtool.lod import Display
from vegtool.preview.eye import Eye, towards

ORIGIN = np.zeros(3)
SIZES = [(1, 1), (1920, 1080), (16384, 1), (1, 16384)]


def clip(eye: Eye, relative: FloatArray, size: tuple[int, int]) -> FloatArray:
    """(n, 4) points relative to the eye in clip space."""
    with_one = np.concatenate([relative, np.ones((len(relative), 1))], axis=1)
    return np.asarray(with_one @ eye.shot(*size).view_projection.T)


@pytest.mark.parametrize(
    ("yaw", "pitch", "right", "up", "forward"),
    [
        (0, 0, (1, 0, 0), (0, 1, 0), (0, 0, -1)),
        (90, 0, (0, 0, -1), (0, 1, 0), (-1, 0, 0)),  # a quarter to the left of -z
        (0, 90, (1, 0, 0), (0, 0, 1), (0, 1, 0)),  # upwards: above the picture is what is behind
        (0, -90, (1, 0, 0), (0, 0, -1), (0, -1, 0)),
        (-90, 90, (0, 0, 1), (-1, 0, 0), (0, 1, 0)),
    ],
)
def test_axes_are_those_of_the_angles(
    yaw: float, pitch: float, right: FloatArray, up: FloatArray, forward: FloatArray
) -> None:
    eye = Eye(ORIGIN, yaw, pitch)
    back = [-float(v) for v in forward]
    np.testing.assert_allclose(eye.axes, [right, up, back], atol=1e-15)
    np.testing.assert_allclose(eye.forward, forward, atol=1e-15)


@pytest.mark.parametrize("pitch", [-90, -89.999999, -30, 0, 45, 90])
@pytest.mark.parametrize("yaw", [0, 33, -179.9, 1e9])
def test_axes_are_a_rotation_everywhere(yaw: float, pitch: float) -> None:
    axes = Eye(ORIGIN, yaw, pitch).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes[0, 1] == 0, "the horizon is level"


def test_whole_turns_change_nothing() -> None:
    """2^40 turns are a number of degrees that a float holds, and so are they with 30 more."""
    turns = 360.0 * 2**40
    np.testing.assert_array_equal(Eye(ORIGIN, 30 + turns).axes, Eye(ORIGIN, 30).axes)


@pytest.mark.parametrize("yaw", [0, 120, -60])
@pytest.mark.parametrize("pitch", [-89, 0, 60])
@pytest.mark.parametrize("scale", [1e-300, 1, 1e300])
def test_an_eye_looks_towards_what_it_was_told(yaw: float, pitch: float, scale: float) -> None:
    found = towards(scale * Eye(ORIGIN, yaw, pitch).forward)
    assert found == pytest.approx((yaw, pitch))


def test_straight_up_every_yaw_looks_alike() -> None:
    assert towards(np.array([0.0, 2, 0]), 77) == (77, 90)
    assert towards(np.array([0.0, -2, 0]), 77) == (77, -90)
    for bad in (0.0, nan, inf):
        with pytest.raises(ValueError, match="a direction with a length"):
            towards(np.array([bad, 0, 0]))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("far", [1e4, inf])
@pytest.mark.parametrize("fov", [1, 60, 179])
def test_matrix_and_planes_agree_on_what_is_seen(
    size: tuple[int, int], far: float, fov: float
) -> None:
    """Inside of clip space, -w <= x, y, z <= w, is inside of all planes: two ways to the same."""
    eye = Eye(ORIGIN, 40, -90, fov, 0.1, far)
    random = np.random.default_rng(0)
    tangents = np.array([size[0] / size[1], 1.0]) * np.tan(np.radians(fov) / 2)
    depth = 10.0 ** random.uniform(-2, 5, 500)
    beside = random.uniform(-1.5, 1.5, (500, 2)) * tangents * depth[:, None]
    points = np.concatenate([beside, -depth[:, None]], axis=1) @ eye.axes
    at = clip(eye, points, size)
    by_matrix = (np.abs(at[:, :3]) <= at[:, 3:]).all(axis=1)
    planes = eye.planes(*size)
    assert planes.shape == ((5, 4) if far == inf else (6, 4))
    np.testing.assert_allclose(np.linalg.norm(planes[:, :3], axis=1), 1)
    by_planes = (points @ planes[:, :3].T + planes[:, 3] >= 0).all(axis=1)
    np.testing.assert_array_equal(by_matrix, by_planes)
    assert by_planes.any() and not by_planes.all()


def test_near_and_far_are_the_ends_of_clip_space() -> None:
    for far in (100.0, inf):
        at = clip(
            Eye(ORIGIN, near_m=0.5, far_m=far), np.array([[0, 0, -0.5], [0, 0, -99.9999]]), (1, 1)
        )
        depth = at[:, 2] / at[:, 3]
        assert depth[0] == pytest.approx(-1)
        assert depth[1] == pytest.approx(1, abs=1.1e-2)


def test_far_from_the_origin_nothing_is_lost() -> None:
    """The matrix does not know where the eye is: the target is the eye itself."""
    here, there = Eye(ORIGIN, 10, 20), Eye(np.array([4e6, 100, -5e6]), 10, 20)
    np.testing.assert_array_equal(
        here.shot(64, 48).view_projection, there.shot(64, 48).view_projection
    )
    np.testing.assert_array_equal(there.shot(64, 48).target, there.position)
    np.testing.assert_array_equal(here.planes(64, 48), there.planes(64, 48))


def test_pixels_of_a_metre_are_those_of_a_display() -> None:
    eye = Eye(ORIGIN, fov_y_deg=50, near_m=0.25)
    assert eye.pixels_per_metre(10, 720) == Display(50, 720).pixels_per_metre(10)
    assert eye.pixels_per_metre(0, 720) == eye.pixels_per_metre(0.25, 720), "never without end"
    top = clip(eye, np.array([[0, 1.0, -10]]), (720, 720))[0]
    assert top[1] / top[3] * 360 == pytest.approx(eye.pixels_per_metre(10, 720))


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"position": [nan, 0, 0]}, "position"),
        ({"position": [0, 0]}, "position"),
        ({"yaw_deg": nan}, "yaw_deg"),
        ({"yaw_deg": inf}, "yaw_deg"),
        ({"pitch_deg": nan}, "pitch_deg"),
        ({"pitch_deg": 90.0001}, "pitch_deg"),
        ({"fov_y_deg": 180}, "fov_y_deg"),
        ({"fov_y_deg": nan}, "fov_y_deg"),
        ({"near_m": 0}, "near_m"),
        ({"near_m": nan}, "near_m"),
        ({"far_m": 0.1}, "far_m"),
        ({"far_m": nan}, "far_m"),
    ],
)
def test_what_is_no_eye_is_refused(given: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=rf"^Eye\.{named}: "):
        Eye(**{"position": ORIGIN, **given})


def test_a_picture_without_pixels_is_refused() -> None:
    for size in ((0, 5), (5, 0)):
        with pytest.raises(ValueError, match="1 x 1 pixels"):
            Eye(ORIGIN).shot(*size)
        with pytest.raises(ValueError, match="1 x 1 pixels"):
            Eye(ORIGIN).planes(*size)
