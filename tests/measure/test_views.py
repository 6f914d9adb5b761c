"""Cameras: what lies where in the picture."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.errors import UsageError
from vegtool.lod import Display
from vegtool.measure.options import ELEVATIONS
from vegtool.measure.views import (
    MARGIN,
    Camera,
    around,
    direction,
    framed,
    views,
)


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


@pytest.mark.parametrize("azimuth, elevation", [(0, 0), (40, -35), (10, 90), (250, 60)])
def test_the_crop_around_a_plant_is_tight_and_what_the_display_shows(
    azimuth: float, elevation: float
) -> None:
    """Each side of the crop lies MARGIN to MARGIN + 1 pixels outside the outermost point, and two
    crops of the same view show a point at the same place of the whole image."""
    points = np.random.default_rng(1).uniform([4, 0, -1], [6, 9, 1], (200, 3))
    camera = around(points, direction(azimuth, elevation), 40.0, Display())
    seen_at = seen(camera, points - camera.target)
    np.testing.assert_allclose(seen_at, camera.pixels(points), atol=1e-9)
    for low, high, size in zip(
        seen_at.min(0), seen_at.max(0), (camera.width, camera.height), strict=True
    ):
        assert MARGIN <= low <= MARGIN + 1
        assert MARGIN <= size - high <= MARGIN + 1
    # the first points alone span the same bounds, so the target is the same; the crop is not
    ends = points[np.r_[points.argmin(0), points.argmax(0)]]
    other = around(ends, camera.direction, 40.0, Display())
    apart = camera.pixels(points) - other.pixels(points)
    np.testing.assert_allclose(apart, np.tile(np.rint(apart[0]), (200, 1)), atol=1e-9)


def test_moved_points_give_the_same_crop() -> None:
    points = np.random.default_rng(2).uniform(-1, 1, (50, 3))
    here, there = (around(p, direction(5, 5), 9.0, Display()) for p in (points, points + 5e6))
    assert (here.width, here.height) == (there.width, there.height)
    np.testing.assert_allclose(here.center_px, there.center_px)


def test_an_eye_inside_the_plant_is_refused() -> None:
    points = np.array([[-1.0, -1, -1], [1, 1, 1]])
    with pytest.raises(UsageError, match="outside the plant"):
        around(points, direction(0, 0), 1.5, Display())


@pytest.mark.parametrize("kind", ELEVATIONS)
def test_views_are_evenly_spread_over_their_band(kind: str) -> None:
    """Equal shares of the band's area hold equal numbers of directions, and neighbours are no
    closer than 60 % of what a hexagonal grid of as many would have."""
    directions = np.array([v.direction for v in views(kind, 60)])
    low, high = np.sin(np.radians(ELEVATIONS[kind]))
    assert (np.histogram(directions[:, 1], 6, (low, high))[0] == 10).all()
    cosines = directions @ directions.T - 2 * np.eye(60)
    nearest = np.arccos(cosines.max(axis=1)).min()
    hexagonal = np.sqrt(2 / np.sqrt(3) * 2 * np.pi * (high - low) / 60)
    assert nearest > 0.6 * hexagonal


def test_each_view_has_a_sun_above_the_horizon_and_another_phase_has_others() -> None:
    first, second = views("all", 12), views("all", 12, 0.5)
    for view in first + second:
        assert 15 <= np.degrees(np.arcsin(view.sun[1])) <= 75
        for vector in (view.direction, view.sun):
            assert np.linalg.norm(vector) == pytest.approx(1)
    for attribute in ("direction", "sun"):
        a, b = (np.array([getattr(v, attribute) for v in s]) for s in (first, second))
        assert np.degrees(np.arccos((a @ b.T).max())) > 3


@pytest.mark.parametrize("kind, count", [("sideways", 3), ("all", 0)])
def test_views_that_make_no_sense_are_refused(kind: str, count: int) -> None:
    with pytest.raises(UsageError, match="expected"):
        views(kind, count)
