"""Cameras: what lies where in the picture."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.lod import Display
from vegtool.measure.views import Camera, direction, framed


def seen(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Pixels (x right, y down) of points given relative to the target."""
    clip = np.c_[points, np.ones(len(points))] @ camera.view_projection().T
    ndc = clip[:, :3] / clip[:, 3:]
    assert (np.abs(ndc[:, 2]) <= 1).all(), "within the clipping planes"
    return (ndc[:, :2] * [1, -1] + 1) / 2 * [camera.width, camera.height]


@pytest.mark.parametrize("azimuth", [0, 77, 200])
@pytest.mark.parametrize("elevation", [-90, -20, 0, 45, 90])
def test_the_target_is_in_the_middle_and_up_is_up(azimuth: float, elevation: float) -> None:
    camera = framed(np.zeros(3), 5.0, direction(azimuth, elevation), 60.0, Display())
    middle, above = seen(camera, np.array([[0, 0, 0], [0, 1.0, 0]]))
    np.testing.assert_allclose(middle, [camera.width / 2, camera.height / 2])
    if abs(elevation) < 90:
        assert above[1] < middle[1]
        assert above[0] == pytest.approx(middle[0])


def test_a_metre_covers_what_the_display_says() -> None:
    """The crop keeps the scale of the full image: 1080 pixels over 2 tan 30 deg times 50 m."""
    display = Display(60.0, 1080)
    camera = framed(np.zeros(3), 3.0, direction(30, 0), 50.0, display)
    right = np.cross([0, 1, 0], camera.direction)
    a, b = seen(camera, np.stack([-0.5 * right, 0.5 * right]))
    assert np.linalg.norm(b - a) == pytest.approx(1080 / (2 * np.tan(np.pi / 6) * 50))


@pytest.mark.parametrize("distance", [12.0, 30.0, 3000.0])
def test_the_whole_sphere_is_in_the_frame(distance: float) -> None:
    camera = framed(np.zeros(3), 10.0, direction(10, 20), distance, Display())
    points = np.random.default_rng(0).normal(size=(500, 3))
    points *= 10 / np.linalg.norm(points, axis=1, keepdims=True)
    pixels = seen(camera, points)
    assert (pixels >= 0).all()
    assert (pixels <= camera.width).all()
