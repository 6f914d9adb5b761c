"""Planes that suit the directions of faces, and the rectangle of least area."""

from __future__ import annotations

import numpy as np
import pytest
from box_cases import card, some_rotation
from hypothesis import given, settings
from hypothesis import strategies as st

from vegtool.arrays import FloatArray
from vegtool.boxes import fit_boxes, oriented_planes
from vegtool.boxes.rectangle import convex_hull, least_rectangle, outer_points

X, Y, Z = np.eye(3)


def area_along(points: FloatArray, direction: FloatArray) -> float:
    """Area of the rectangle with a side along a unit direction, measured plainly."""
    across = np.array([-direction[1], direction[0]])
    return float(np.ptp(direction @ points) * np.ptp(across @ points))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([3, 5, 20, 400]))
def test_no_turned_rectangle_is_smaller(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(2, count)) * rng.uniform(0.1, 1, (2, 1))
    side, low, high = least_rectangle(points)
    least = (high - low).prod()
    assert least == pytest.approx(area_along(points, side))
    for angle in np.linspace(0, np.pi / 2, 180):
        assert least <= area_along(points, np.array([np.cos(angle), np.sin(angle)])) * (1 + 1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_dropping_inner_points_keeps_the_hull(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(2, 300))
    kept = outer_points(points)
    assert kept.shape[1] < 100
    assert np.array_equal(convex_hull(kept), convex_hull(points))


@pytest.mark.parametrize("count", [1, 2, 100])
def test_rectangles_of_points_and_lines(count: int) -> None:
    side, low, high = least_rectangle(np.ones((2, count)))
    assert side.tolist() == [1, 0] and low.tolist() == high.tolist() == [1, 1]
    if count > 1:
        line = np.array([[3.0], [4.0]]) * np.linspace(1, 2, count)
        assert np.abs(least_rectangle(line)[0]) == pytest.approx([0.6, 0.8])


def test_parallel_cards_in_a_row_are_shown_from_their_front() -> None:
    """Ten cards behind each other: thin across the row, but all of them look along it."""
    cards = np.concatenate([card(Z * 0.3 * i, X, Y) for i in range(10)])
    boxes = oriented_planes(cards, np.zeros(20, dtype=np.int32), 1)
    assert np.abs(boxes.axes[0, 2]) == pytest.approx(Z, abs=1e-9)
    assert boxes.half[0] == pytest.approx([1, 1, 1.35])
    assert boxes.center[0] == pytest.approx([0, 0, 1.35])


def test_cards_of_all_directions_are_shown_across_their_thin_side() -> None:
    sides = [(X, Y), (Y, Z), (Z, X)]
    places = [5 * X, -5 * X, 5 * Z, -5 * Z]
    cards = np.concatenate([card(place, u, v) for place in places for u, v in sides])
    boxes = oriented_planes(cards, np.zeros(len(cards), dtype=np.int32), 1)
    assert np.abs(boxes.axes[0, 2]) == pytest.approx(Y, abs=1e-9)


def test_subdivision_changes_nothing() -> None:
    """The moments are those of the surface, not of the triangles' centroids."""
    whole = np.concatenate([card(Z, X * 3, Y), card(-Z, X + Y, Z * 0.3 + Y)])
    a, b, c = whole[:, 0], whole[:, 1], whole[:, 2]
    middle = (a + b + c) / 3
    split = np.concatenate(
        [np.stack(t, 1) for t in ((a, b, middle), (b, c, middle), (c, a, middle))]
    )
    one = oriented_planes(whole, np.zeros(4, dtype=np.int32), 1)
    other = oriented_planes(split, np.zeros(12, dtype=np.int32), 1)
    assert np.abs(one.axes[0, 2] @ other.axes[0, 2]) == pytest.approx(1)


def test_turned_and_moved_faces_have_turned_and_moved_planes() -> None:
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(50, 3, 3)) * [3, 2, 0.5]
    labels = rng.integers(0, 4, 50).astype(np.int32)
    turn, shift = some_rotation(), np.array([5e6, -5e6, 5e6])
    here = oriented_planes(corners, labels, 4)
    there = oriented_planes(corners @ turn.T + shift, labels, 4)
    assert there.half == pytest.approx(here.half, rel=1e-5)
    assert there.center == pytest.approx(here.center @ turn.T + shift, abs=1e-5)
    cosine = np.einsum("ki,ki->k", there.axes[:, 2], here.axes[:, 2] @ turn.T)
    assert np.abs(cosine) == pytest.approx(1)
    assert np.allclose(np.linalg.det(there.axes), 1)


@pytest.mark.parametrize("noise", [0.0, 1e-12])
def test_of_two_crossed_cards_the_first_has_the_plane(noise: float) -> None:
    """Both planes are equally good, and so is every one between them; rounding must not choose."""
    corners = np.concatenate([card(Y, X, Z), card(Y, X, Y)]) @ some_rotation().T
    corners += noise * np.random.default_rng(0).normal(size=corners.shape)
    boxes = oriented_planes(corners, np.zeros(4, dtype=np.int32), 1)
    assert np.abs(boxes.axes[0, 2] @ (some_rotation() @ Y)) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_faces_without_area_have_planes(scale: float) -> None:
    line = np.array([[[0.0, 0, 0], [1, 1, 1], [2, 2, 2]]]) * scale
    point = np.ones((40, 3, 3)) * scale
    corners = np.concatenate([line, point])
    boxes = oriented_planes(corners, np.repeat([0, 1], [1, 40]).astype(np.int32), 3)
    assert boxes.half[0] / scale == pytest.approx([3**0.5, 0, 0], abs=1e-9)
    assert (boxes.half[1:] == 0).all()
    assert np.allclose(np.linalg.det(boxes.axes), 1)


def test_flat_cluster_gets_the_same_plane_from_both_fits() -> None:
    corners = card(Y, X * 3, Z)
    labels = np.zeros(2, dtype=np.int32)
    about = oriented_planes(corners, labels, 1)
    least = fit_boxes(corners.reshape(-1, 3), np.repeat(labels, 3), 1)
    assert about.half == pytest.approx(least.half, abs=0.02)
    assert np.abs(about.axes[0, 2] @ least.axes[0, 2]) == pytest.approx(1, abs=1e-4)
