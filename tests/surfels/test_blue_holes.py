"""A prefix as long as discs of a pixel need leaves no hole in a smooth surface."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import binary_erosion, label

from vegtool.gl.points import SurfelSetBuffers
from vegtool.lod import Display
from vegtool.measure.pictures import live_surfels
from vegtool.measure.views import around, views
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.covering import inside
from vegtool.surfels.blue.distances import spacing
from vegtool.surfels.blue.farthest import farthest_order

pytestmark = pytest.mark.gl
POINTS = 8000
DIAMETERS = (24, 15, 8)
"""Pixels, where 8,000 points are enough: the shortest prefix has some 500."""


def ball() -> SurfelSet:
    """Colours tell positions, so that the far side is seen through a hole."""
    points = np.random.default_rng(0).normal(size=(20 * POINTS, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    at = points[farthest_order(points, POINTS)]
    return SurfelSet(at, at, (at + 1) / 2, spacing(at), unlit=True, double_sided=False)


def test_no_hole_is_larger_than_a_pixel() -> None:
    surfels = ball()
    prefixes = []
    with SurfelSetBuffers(surfels) as buffers:
        for pixels in DIAMETERS:
            distance = Display().distance_m(pixels / 2)
            for view in views("all", 4):
                camera = around(surfels.position, view.direction, distance, Display())
                picture = live_surfels(buffers, camera)
                y, x = np.mgrid[: camera.height, : camera.width] + 0.5
                off = np.hypot(x - camera.center_px[0], y - camera.center_px[1])
                within = binary_erosion(off < camera.focal_px / (distance**2 - 1) ** 0.5)
                seen = 2 * picture[..., :3] - picture[..., 3:]
                hole = within & ((picture[..., 3] < 0.5) | (seen @ camera.direction < 0))
                found, many = label(hole, np.ones((3, 3)))
                assert within.sum() > 20
                assert all((found == i).sum() <= 1 for i in range(1, many + 1))
            pixel = buffers.pixels(
                camera.eye, np.zeros((1, 3)), np.zeros(1), np.ones(1), camera.focal_px
            )
            prefixes.append(int(surfels.discs(pixel / 2)[0][0]))
    assert POINTS > prefixes[0] > 2 * prefixes[-1] > 200, "prefixes are what is looked at"


def test_all_of_a_ball_is_inside() -> None:
    """Discs are not made smaller there, at whatever scale they are no part of a ball's size."""
    assert inside(ball())[500:].mean() > 0.99
