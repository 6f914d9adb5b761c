"""Soft shadows in arrays, of a square above ground; its depth maps are made by arithmetic."""

from __future__ import annotations

from math import radians, tan

import numpy as np
import pytest

from vegtool.arrays import FloatArray, unit
from vegtool.lighting.light import SUN_DEG, Sun
from vegtool.lighting.shadow import SUNS, SunDepths, disc, projections, sun_visible
from vegtool.seeding import generator

UP = np.array([0.0, 1, 0])


def under_a_square(
    height: float, toward: FloatArray, side: int = 1024, suns: int = SUNS, radius: float = 3.0
) -> SunDepths:
    """What the sun sees of the square |x|, |z| <= 0.5 at that height, and of nothing else.

    Each texel's ray is met with the plane: no rasteriser.
    """
    center = np.array([0.0, height / 2, 0.0])
    half = np.hypot(radius, height / 2)
    projection = projections(disc(toward, suns), float(half))
    at = (np.arange(side) + 0.5) / side
    x, y = np.meshgrid(at, at)
    near = np.stack([x, y, np.zeros_like(x), np.ones_like(x)], axis=-1)
    depth = np.ones((suns, side, side), np.float32)
    for plane, matrix in zip(depth, projection, strict=True):
        back = np.linalg.inv(matrix)
        start = (near @ back.T)[..., :3] + center
        step = back[:3, 2]  # along the ray, from depth 0 to 1
        z = (height - start[..., 1]) / step[1]
        hit = start + z[..., None] * step
        inside = (np.abs(hit[..., [0, 2]]) <= 0.5).all(axis=-1)
        plane[inside] = z[inside]
    return SunDepths(depth, projection, center, toward, float(2 * half / side))


def on_ground(x: FloatArray, z: float = 0.0) -> FloatArray:
    return np.stack([x, np.zeros_like(x), np.full_like(x, z)], axis=1)


def seen_by(maps: SunDepths, places: FloatArray, side: FloatArray = UP) -> FloatArray:
    return sun_visible(places, np.tile(side, (len(places), 1)), maps)


@pytest.mark.parametrize("azimuth", [0.0, 70.0])
@pytest.mark.parametrize("elevation", [90.0, 50.0])
def test_under_an_opaque_square_is_dark_and_beside_it_is_lit(
    azimuth: float, elevation: float
) -> None:
    toward = Sun(azimuth, elevation).direction
    maps = under_a_square(1.0, toward)
    shift = -toward / toward[1]  # where the sun throws it
    for x, z, expected in ((0, 0, 0), (0.4, -0.4, 0), (0.7, 0, 1), (0, -0.7, 1), (-2, 2, 1)):
        place = on_ground(np.array([float(x)]), z) + shift * [1.0, 0, 1.0]
        assert seen_by(maps, place) == pytest.approx(expected, abs=1e-12), (x, z)


def across_the_edge(maps: SunDepths) -> tuple[FloatArray, FloatArray]:
    """Places from the middle of the square's shadow outward, and what they see of the sun."""
    x = np.linspace(0, 1.5, 6001)
    return x, seen_by(maps, on_ground(x))


def width_of(x: FloatArray, seen: FloatArray) -> float:
    """Of where some of the sun is seen and some is not."""
    return float(np.ptp(x[(seen > 1e-9) & (seen < 1 - 1e-9)]))


@pytest.mark.parametrize("height", [5.0, 10.0, 20.0])
def test_a_penumbra_is_as_wide_as_the_sun_is_at_that_distance(height: float) -> None:
    """0.53 degrees. The sun is seen by half where the edge stands before its middle, so that on the
    whole the shadow is as wide as the square. Interpolation adds a texel."""
    maps = under_a_square(height, UP, side=512, suns=64)
    x, seen = across_the_edge(maps)
    assert seen[[0, -1]] == pytest.approx([0, 1])
    assert (np.diff(seen) > -1e-9).all()
    expected = height * tan(radians(SUN_DEG))
    assert abs(width_of(x, seen) - expected) < 1.5 * maps.texel_m
    assert (1 - seen).sum() * x[1] == pytest.approx(0.5, abs=0.2 * maps.texel_m)


@pytest.mark.parametrize("height", [5.0, 20.0])
def test_few_points_of_the_sun_make_it_as_wide_as_they_lie_apart(height: float) -> None:
    maps = under_a_square(height, UP)
    x, seen = across_the_edge(maps)
    points = disc(UP)
    expected = height * float(np.ptp(points[:, 0] / points[:, 1]))
    assert abs(width_of(x, seen) - expected) < 1.1 * maps.texel_m
    assert (1 - seen).sum() * x[1] == pytest.approx(0.5, abs=0.5 * maps.texel_m)


def test_one_point_of_the_sun_throws_a_sharp_shadow() -> None:
    """A texel of the map is all its edge is wide."""
    maps = under_a_square(20.0, UP, suns=1)
    assert width_of(*across_the_edge(maps)) <= maps.texel_m


def test_nothing_shadows_itself_on_either_side() -> None:
    """Places on the square, moved off it towards the sun, whichever way its normal is said."""
    toward = Sun(20.0, 35.0).direction
    maps = under_a_square(1.0, toward, side=256)
    x = np.linspace(-0.49, 0.49, 99)
    places = on_ground(x) + UP
    assert seen_by(maps, places) == pytest.approx(1)
    np.testing.assert_array_equal(seen_by(maps, places), seen_by(maps, places, -UP))


def test_what_lies_outside_of_a_map_is_lit() -> None:
    maps = under_a_square(1.0, UP, side=64)
    far = np.array([[50.0, 0, 0], [-50, 0, 0], [0, 0, 50], [0, 0, -50], [0, 0.2, 1e6]])
    assert seen_by(maps, far) == pytest.approx(1)
    full = SunDepths(
        np.zeros_like(maps.depth), maps.projection, maps.center, maps.direction, maps.texel_m
    )
    assert seen_by(full, far) == pytest.approx(1), "even where all of the map is hidden"
    assert (seen_by(full, on_ground(np.zeros(1))) == 0).all()


@pytest.mark.parametrize("count", [1, 2, 8, 33])
@pytest.mark.parametrize("toward", [UP, -UP, np.eye(3)[0], Sun(33, 40).direction])
def test_points_lie_on_the_suns_disc_and_all_over_it(count: int, toward: FloatArray) -> None:
    """Within half of 0.53 degrees; evenly, so that their mean is near the middle, and their mean
    square distance from it half of the edge's."""
    points = disc(toward, count)
    assert points.shape == (count, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0)
    if count == 1:
        np.testing.assert_array_equal(points[0], toward)
        return
    edge = tan(radians(SUN_DEG / 2))
    off = np.linalg.norm(np.cross(points, toward), axis=1) / (points @ toward)
    assert off.max() < edge
    assert np.square(off).mean() == pytest.approx(edge**2 / 2)
    assert np.linalg.norm(points.mean(axis=0) - toward) < 0.6 * edge / count**0.5
    assert len(np.unique(points.round(9), axis=0)) == count


def test_a_projection_puts_a_ball_into_its_map_with_the_sun_at_depth_nothing() -> None:
    toward = unit(generator(0, "suns").normal(size=(5, 3)))
    radius = 7.5
    ball = unit(generator(1, "ball").normal(size=(400, 3)))
    for direction, matrix in zip(toward, projections(toward, radius), strict=True):

        def at(points: FloatArray, matrix: FloatArray = matrix) -> FloatArray:
            return points @ matrix[:3, :3].T + matrix[:3, 3]

        np.testing.assert_allclose(at(np.zeros(3)), 0.5)
        assert at(radius * direction)[2] == pytest.approx(0, abs=1e-12)
        assert at(-radius * direction)[2] == pytest.approx(1)
        placed = at(radius * ball)
        assert placed.min() > -1e-12 and placed.max() < 1 + 1e-12
        moved = at(radius * ball + 0.3 * direction)
        np.testing.assert_allclose(moved[:, :2], placed[:, :2], atol=1e-12)
        np.testing.assert_allclose(placed[:, 2] - moved[:, 2], 0.3 / (2 * radius))
        apart = np.linalg.norm(placed - placed[0], axis=1)
        expected = np.linalg.norm(ball - ball[0], axis=1) / 2
        np.testing.assert_allclose(apart, expected, atol=1e-12)
        np.testing.assert_array_equal(matrix[3], [0, 0, 0, 1])


def test_behind_all_that_is_in_a_map_only_what_hides_counts() -> None:
    """Ground farther away than the map is deep is not dark for that."""
    maps = under_a_square(1.0, UP, side=128)
    deep = np.array([[0.0, -20.0, 0.0], [1.5, -20.0, 0.0]])
    assert seen_by(maps, deep) == pytest.approx([0, 1])
