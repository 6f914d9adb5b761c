"""Bounds of displacement: cases worked by hand, and boxes full of points that must keep to them."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plants import plant_of

from vegtool.arrays import FloatArray, IntArray
from vegtool.boxes import BoxOptions, make_billboards
from vegtool.boxes.error import surface_samples
from vegtool.boxes.options import Shape
from vegtool.clustering import ClusterOptions, cluster
from vegtool.growth import sample
from vegtool.lod import Atlas, Billboards, Display, Level
from vegtool.measure.bounds import (
    MIN_DEPTH,
    displacement,
    displacement_bound,
    distance_for_pixels,
    least_distance,
    magnification,
    projection_bound,
    projection_error,
    texel_error,
    texture_size,
)
from vegtool.measure.views import Camera, around, direction, views

X, Y, Z = np.eye(3)
ROUNDING = 1e-12
"""Of metres or pixels, relative to the scenes here, which are about a metre large."""
DISPLAY = Display()
PC = DISPLAY.pixels_per_metre(1.0)


def billboard(
    half: tuple[float, float, float] = (1, 1, 0.5),
    center: FloatArray | float = 0.0,
    u: FloatArray = X,
    v: FloatArray = Y,
) -> Billboards:
    """One, with half extents along u, v and its normal."""
    middle = np.broadcast_to(center, (1, 3))
    return Billboards(middle, u[None], v[None], [half[:2]], [half[2]], [0])


def camera(towards: FloatArray = Z, distance: float = 10.0, target: FloatArray = 0 * X) -> Camera:
    """A metre covers 100 pixels at a metre's distance."""
    return Camera(target, towards / np.linalg.norm(towards), distance, 100.0, 9, 9, (4.0, 4.0), 2.0)


def level(billboards: Billboards, texels: int = 1000) -> Level:
    """Of billboards that have that many texels a side each, all black."""
    p = len(billboards)
    rect = np.tile(np.array([0, 0, texels, texels], np.int32), (p, 1))
    empty = np.zeros((4, 4), np.uint8)
    atlas = Atlas(
        np.stack([empty] * 4, 2), np.stack([empty] * 3, 2), empty.astype(np.uint16), rect, rect
    )
    return Level("billboards", billboards=billboards, atlas=atlas)


def within(billboards: Billboards, count: int = 200, seed: int = 0) -> tuple[FloatArray, IntArray]:
    """Points within each billboard's box, its corners first, and whose they are."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(-1, 1, (count, 3))
    steps[:8] = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    half = np.concatenate([billboards.half_size, billboards.half_depth[:, None]], axis=1)
    axes = np.stack([billboards.u, billboards.v, billboards.normal], axis=1)
    local = np.einsum("npa,pai->npi", steps[:, None] * half, axes)
    shown_by = np.tile(np.arange(len(billboards), dtype=np.int32), count)
    return (billboards.center + local).reshape(-1, 3), shown_by


def turn(rng: np.random.Generator) -> FloatArray:
    """A rotation matrix."""
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def test_seen_head_on_the_paper_finds_no_error_and_the_bound_does() -> None:
    """Its Fig. 3b. The corner of the near face, 9.5 m away, is drawn 10 m away: sqrt 2 m beside the
    axis that is 100 sqrt 2 (1 / 9.5 - 1 / 10) pixels, and the bound is no larger."""
    assert projection_error(billboard(), camera()) == [0]
    exact = 100 * sqrt(2) * (1 / 9.5 - 1 / 10)
    assert projection_bound(billboard(), camera()) == pytest.approx([exact])


def test_seen_from_the_edge_the_whole_depth_shows() -> None:
    """Half a metre, 10 m away: 5 pixels. At the near edge of the plane, 9 m away, it is more."""
    assert projection_error(billboard(), camera(X)) == pytest.approx([100 * 0.5 / 10])
    at_edge = displacement(np.array([[1.0, 0, 0.5]]), np.array([0]), billboard(), camera(X))
    assert at_edge == pytest.approx([100 * 0.5 / 9])
    assert projection_bound(billboard(), camera(X))[0] >= at_edge[0]


def test_at_an_angle_its_sine_counts() -> None:
    seen = camera(np.array([sin(pi / 6), 0, cos(pi / 6)]))
    assert projection_error(billboard(), seen) == pytest.approx([100 * 0.5 * 0.5 / 10])
    turned = replace(billboard(), u=-billboard().u)
    assert projection_error(turned, seen) == pytest.approx([2.5]), "from behind it is the same"


def test_a_texel_covers_what_it_measures() -> None:
    """Four metres and two on eight texels each: half a metre, 10 m away."""
    asked = billboard((2, 1, 0))
    assert texel_error(asked, level(asked, 8).atlas, camera()) == pytest.approx([100 * 0.5 / 10])


def test_displacement_is_what_lies_between_two_pictures() -> None:
    """Against the camera's own projection of both places."""
    rng = np.random.default_rng(5)
    frame = turn(rng)
    asked = billboard((1, 2, 0.5), rng.normal(size=3), frame[0], frame[1])
    points, shown_by = within(asked)
    away = (points - asked.center) @ asked.normal[0]
    drawn = points - away[:, None] * asked.normal
    for view in views("all", 9):
        seen = camera(view.direction, 8.0)
        expected = np.linalg.norm(seen.pixels(points) - seen.pixels(drawn), axis=1)
        assert displacement(points, shown_by, asked, seen) == pytest.approx(expected, abs=1e-9)


def test_valid_share_is_the_share_of_directions_in_which_it_is_valid() -> None:
    """Eq. 7 and 8: at z_min, e_p is at most eps in that share of all directions."""
    asked = billboard((1, 1, 0.5))
    for share in (0.25, 0.5, 0.9):
        distance = float(least_distance(asked, DISPLAY, 2.0, share)[0])
        cameras = [
            Camera(0 * X, v.direction, distance, PC, 9, 9, (0, 0), 1.0) for v in views("all", 2000)
        ]
        valid = [projection_error(asked, seen)[0] <= 2.0 for seen in cameras]
        assert np.mean(valid) == pytest.approx(share, abs=2e-3)
    assert least_distance(asked, DISPLAY, 2.0, 1.0) == pytest.approx([0.5 * PC / 2])


def test_texture_sizes_balance_both_errors_whatever_the_limit() -> None:
    """Eq. 9: at z_min, e_t is eps as well, up to the rounding to whole texels."""
    asked = billboard((30, 10, 0.2))
    width, height = texture_size(asked, 4096)
    assert (width[0], height[0]) == (347, 116), "2 w / (d sqrt 0.75), rounded up"
    for pixels in (0.5, 4.0):
        distance = least_distance(asked, DISPLAY, pixels)[0]
        assert PC * 60 / distance / width[0] == pytest.approx(pixels, rel=0.01)
        assert PC * 20 / distance / height[0] == pytest.approx(pixels, rel=0.01)


def test_flat_line_like_and_point_like_boxes_have_sizes_and_distances() -> None:
    """A flat one counts as a thousandth of its half diagonal thick, and textures have a limit."""
    flat, line, point = billboard((3, 4, 0)), billboard((3, 0, 0)), billboard((0, 0, 0))
    assert least_distance(flat, DISPLAY, 1.0, 1.0) == pytest.approx([5 * MIN_DEPTH * PC])
    assert [int(s[0]) for s in texture_size(flat, 512)] == [512, 512]
    assert [int(s[0]) for s in texture_size(line, 512)] == [512, 1]
    assert [int(s[0]) for s in texture_size(point, 512)] == [1, 1]
    for asked in (flat, line, point):
        for seen in (camera(), camera(X), camera(Z, 0.5), camera(X + Y, 1e-9)):
            assert projection_error(asked, seen) == [0]
            assert projection_bound(asked, seen) == [0], "nothing lies off the plane"
        assert displacement_bound(asked, 0 * X, 1e-9, DISPLAY) == [0]


def test_within_the_box_there_is_no_bound() -> None:
    for seen in (camera(Z, 0.4), camera(X, 0.9), camera(X, 1.0)):
        assert projection_bound(billboard(), seen) == [np.inf]
    assert displacement_bound(billboard(), 0 * X, 1.5, DISPLAY) == [np.inf]
    assert displacement_bound(billboard(), 0 * X, 1.51, DISPLAY) < np.inf


def test_behind_the_eye_there_is_no_bound_either() -> None:
    looking_away = replace(camera(Z, 10.0), target=X - 20 * Z)
    for of in (projection_error, projection_bound):
        assert of(billboard(), looking_away) == [np.inf]
    away = displacement(np.array([[0, 0, 0.5]]), np.array([0]), billboard(), looking_away)
    assert away == [np.inf]


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(-3, 0.5),
    st.tuples(*[st.one_of(st.just(0.0), st.floats(1e-3, 2))] * 3),
)
def test_nothing_in_a_box_is_displaced_by_more_than_the_bounds(
    seed: int, closeness: float, half: tuple[float, float, float]
) -> None:
    """Random boxes, beside the axis too, from far away up to the point where they are touched."""
    rng = np.random.default_rng(seed)
    frame = turn(rng)
    asked = billboard(half, rng.normal(size=3), frame[0], frame[1])
    seen = replace(camera(rng.normal(size=3), 10 ** (0.5 - closeness)), focal_px=PC)
    points, shown_by = within(asked)
    measured = displacement(points, shown_by, asked, seen).max()
    thicker = replace(asked, half_depth=asked.half_depth + ROUNDING)
    assert measured <= projection_bound(thicker, seen)[0] * (1 + ROUNDING)
    everywhere = displacement_bound(thicker, seen.target, seen.distance_m, DISPLAY)[0]
    assert measured <= everywhere * (1 + ROUNDING)


@pytest.mark.parametrize("distance", [1.05, 1.5, 2.0, 5.0, 500.0])
def test_the_bound_over_all_directions_is_reached(distance: float) -> None:
    """A tiny box a metre from the middle, its normal across the ray: the most it is displaced, over
    all directions, is what the bound says. From less than two metres the worst lies to the side:
    metres at the rim of a wide picture are stretched."""
    tiny = 1e-6
    angle = np.linspace(0, np.arccos(1 / distance), 2001)[:-1]  # further round, it is hidden
    place = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    ray = place - distance * Z
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    half, depth = np.full((2000, 2), tiny), np.full(2000, tiny)
    asked = Billboards(place, ray, np.tile(Y, (2000, 1)), half, depth, np.zeros(2000))
    seen = Camera(0 * X, Z, distance, PC, 9, 9, (0, 0), 2.0)
    worst = projection_bound(asked, seen).max()
    bound = displacement_bound(asked, 0 * X, distance, DISPLAY).max()
    assert worst == pytest.approx(bound, rel=1e-3)


def test_scaled_and_moved_scenes_have_the_same_pixels() -> None:
    rng = np.random.default_rng(2)
    frame = turn(rng)
    asked = billboard((1, 2, 0.5), rng.normal(size=3), frame[0], frame[1])
    seen = camera(rng.normal(size=3), 9.0)
    for scale, offset in ((1e-6, 0 * X), (1e6, 0 * X), (1.0, np.array([5e6, -5e6, 3e6]))):
        moved = replace(
            asked,
            center=scale * asked.center + offset,
            half_size=scale * asked.half_size,
            half_depth=scale * asked.half_depth,
        )
        there = replace(seen, target=scale * seen.target + offset, distance_m=scale * 9)
        rounding = 1e-12 + np.finfo(float).eps * np.abs(offset).max()  # over a size of one metre
        for of in (projection_error, projection_bound):
            assert of(moved, there) == pytest.approx(of(asked, seen), rel=10 * rounding)
        everywhere = displacement_bound(moved, there.target, scale * 9, DISPLAY)
        expected = displacement_bound(asked, seen.target, 9, DISPLAY)
        assert everywhere == pytest.approx(expected, rel=10 * rounding)


def test_from_further_away_the_bound_is_lower() -> None:
    steps = np.geomspace(1.5001, 1e6, 400)
    bounds = [displacement_bound(billboard(), 0 * X, d, DISPLAY)[0] for d in steps]
    assert (np.diff(bounds) < 0).all()


@pytest.mark.parametrize("pixels", [0.25, 1.0, 4.0, 300.0, 3000.0])
def test_the_distance_is_the_least_that_keeps_the_limit(pixels: float) -> None:
    """Texels count for both here; 3,000 pixels are met close by, where it is the side of the
    picture that errs."""
    two = Billboards(
        [[0, 0, 0], [0, 1, 0]], [X, X], [Y, Y], [[1, 1], [0.5, 0.5]], [0.5, 0.01], [0, 1]
    )
    asked = level(two, 2)
    distance = distance_for_pixels(asked, 0 * X, DISPLAY, pixels)

    # half extents 1, 1, 0.5, and texels of one metre; half extents 0.5, 0.5, 0.01 a metre above
    size, reach = np.array([1.0, 0.5]), np.array([1.5, sqrt(0.5**2 + 1.5**2 + 0.01**2)])

    def most(at: float) -> float:
        return float((size * magnification(reach, at, DISPLAY)).max())

    assert most(distance) <= pixels * (1 + 1e-9)
    assert most(distance * (1 - 1e-6)) > pixels


def test_distance_of_a_deep_billboard_by_hand() -> None:
    """Two pixels for half a metre: one that far from the nearest corner of the box, 1.5 m out."""
    distance = distance_for_pixels(level(billboard()), 0 * X, DISPLAY, 2.0)
    assert distance == pytest.approx(1.5 + 0.5 * PC / 2)
    shifted = billboard(center=4 * Y)
    assert distance_for_pixels(level(shifted), 4 * Y, DISPLAY, 2.0) == pytest.approx(distance)
    assert distance_for_pixels(level(shifted), 0 * Y, DISPLAY, 2.0) > distance


def test_a_mesh_counts_by_its_geometric_error() -> None:
    mesh = plant_of([[[3.0, 0, 0], [0, 3, 0], [0, 0, 3]]])
    exact = Level("mesh", mesh=mesh, geometric_error_m=(0.0, 0.0))
    assert distance_for_pixels(exact, 0 * X, DISPLAY, 1.0) == 0
    rough = replace(exact, geometric_error_m=(0.1, 0.0))
    assert distance_for_pixels(rough, 0 * X, DISPLAY, 1.0) == pytest.approx(3.1 + 0.1 * PC)
    with pytest.raises(ValueError, match="geometric_error_m"):
        distance_for_pixels(Level("mesh", mesh=mesh), 0 * X, DISPLAY, 1.0)


def test_a_hybrid_counts_by_both_of_its_parts() -> None:
    """The billboard reaches 1.5 m and has a depth of half a metre; the mesh reaches 3 m."""
    wood = replace(plant_of([[[3.0, 0, 0], [0, 3, 0], [0, 0, 3]]]), colors=np.ones((3, 4)))
    made = level(billboard())
    assert made.atlas is not None
    atlas = replace(made.atlas, white=[0, 0, 4, 4])
    mixed = replace(made, kind="hybrid", atlas=atlas, mesh=wood, geometric_error_m=(0.1, 0.0))
    alone = distance_for_pixels(made, 0 * X, DISPLAY, 2.0)
    assert distance_for_pixels(mixed, 0 * X, DISPLAY, 2.0) == pytest.approx(alone)
    rough = replace(mixed, geometric_error_m=(1.0, 0.0))
    assert distance_for_pixels(rough, 0 * X, DISPLAY, 2.0) == pytest.approx(4 + PC / 2)
    with pytest.raises(ValueError, match="geometric_error_m"):
        distance_for_pixels(replace(mixed, geometric_error_m=None), 0 * X, DISPLAY, 2.0)


@pytest.mark.parametrize("shape", ["auto", "crossed"])
def test_a_plant_is_displaced_by_no_more_than_the_bounds(shape: Shape) -> None:
    """Its boxes hold what they show: every plane of crossed ones answers for the whole cluster."""
    plant = sample("broadleaf", 3000)
    labels = cluster(plant, "kmeans", 40, ClusterOptions(), 0)
    billboards = make_billboards(plant, labels, BoxOptions(shape=shape, plane="orientation"))
    face, points = surface_samples(plant, 4000)
    sample_index, shown_by = np.nonzero(labels[face][:, None] == billboards.cluster)
    for view in views("all", 6):
        distance = DISPLAY.distance_m(200 / plant.extent)
        seen = around(plant.positions, view.direction, distance, DISPLAY)
        measured = np.zeros(len(billboards))
        pixels = displacement(points[sample_index], shown_by.astype(np.int32), billboards, seen)
        np.maximum.at(measured, shown_by, pixels)
        assert (measured <= projection_bound(billboards, seen) * (1 + 1e-9)).all()
        everywhere = displacement_bound(billboards, seen.target, distance, DISPLAY)
        assert (measured <= everywhere * (1 + 1e-9)).all()


def test_direction_is_the_camera_the_hand_made_cases_use() -> None:
    """Azimuth 90 degrees looks from +x, as `camera(X)` does."""
    assert direction(90, 0) == pytest.approx(X)
