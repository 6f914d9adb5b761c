"""The order of plants that are there: even in every first part, the tall ones first."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from vegtool.tiles import order as module
from vegtool.tiles.order import height_class, spread_order


def nearest(points: np.ndarray) -> np.ndarray:
    distance, _ = cKDTree(points).query(points, k=2)
    return np.asarray(distance[:, 1])


def farthest_first(points: np.ndarray, count: int) -> list[int]:
    """The oracle: each plant farthest from those before, all of them looked at."""
    squared = ((points - points[0]) ** 2).sum(axis=1)
    order = [0]
    while len(order) < count:
        order.append(int(squared.argmax()))
        squared = np.minimum(squared, ((points - points[order[-1]]) ** 2).sum(axis=1))
    return order


def in_order(points: np.ndarray, height: float | np.ndarray = 10.0) -> np.ndarray:
    tall = np.broadcast_to(np.asarray(height, np.float64), len(points))
    return spread_order(points, np.zeros(len(points), np.int64), tall)


def woods() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    around = rng.random((40, 2))[rng.integers(40, size=4000)]
    rows = np.stack(np.meshgrid(np.arange(60), np.arange(60)), axis=-1).reshape(-1, 2)
    return {
        "anywhere": rng.random((4000, 2)),
        "in groups": np.clip(around + 0.04 * rng.normal(size=(4000, 2)), 0, 0.999),
        "in rows": (rows + 0.5 + 0.2 * (rng.random((3600, 2)) - 0.5)) / 60,
    }


@pytest.mark.parametrize("name", list(woods()))
def test_first_parts_are_nearly_as_even_as_can_be(name: str) -> None:
    """The mean distance to the nearest, beside farthest points first and an order at random."""
    points = woods()[name]
    order = in_order(points)
    assert sorted(order) == list(range(len(points)))
    best = farthest_first(points, 1000)
    for count in (100, 400, 1000):
        found, most = nearest(points[order[:count]]), nearest(points[best[:count]])
        least = nearest(points[np.random.default_rng(1).permutation(len(points))[:count]])
        assert found.mean() > 0.8 * most.mean() > least.mean()
        assert np.quantile(found, 0.05) > 1.05 * np.quantile(least, 0.05)


def test_tall_ones_come_first_in_octaves() -> None:
    rng = np.random.default_rng(0)
    points, height = rng.random((500, 2)), rng.uniform(1, 31, 500)
    classes = height_class(height[in_order(points, height)])
    assert (np.diff(classes) <= 0).all()
    assert set(classes) == {0, 1, 2, 3, 4}
    assert height_class(np.array([7.99, 8.0, 15.9, 0.3])).tolist() == [2, 3, 3, -2]


def test_low_ones_fill_the_gaps_of_tall_ones() -> None:
    """Trees on the left half: of the shrubs all over, the first ones stand on the right."""
    rng = np.random.default_rng(3)
    trees, shrubs = rng.random((400, 2)) * (0.5, 1), rng.random((800, 2))
    points, height = np.concatenate([trees, shrubs]), np.repeat([20.0, 1.5], [400, 800])
    order = in_order(points, height)
    assert (order[:400] < 400).all()
    assert (points[order[400:550], 0] > 0.5).mean() > 0.8


def test_each_tile_is_ordered_as_if_alone() -> None:
    """Whatever other tiles there are, and however they are put together."""
    rng = np.random.default_rng(4)
    points, tile = rng.random((900, 2)), np.sort(rng.integers(0, 7, 900)) * 1000
    height = rng.uniform(1, 30, 900)
    together = spread_order(points, tile, height)
    for one in np.unique(tile):
        here = np.flatnonzero(tile == one)
        assert np.array_equal(
            together[tile[together] == one], here[in_order(points[here], height[here])]
        )
    assert (np.diff(tile[together]) >= 0).all()


def test_batches_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    points, tile = rng.random((900, 2)), np.sort(rng.integers(0, 40, 900))
    whole = spread_order(points, tile, np.full(900, 5.0))
    monkeypatch.setattr(module, "BATCH", 50)
    assert np.array_equal(spread_order(points, tile, np.full(900, 5.0)), whole)


def test_plants_in_one_place_keep_their_order() -> None:
    points = np.tile([[0.3, 0.7]], (50, 1))
    assert in_order(points).tolist() == list(range(50))
    assert in_order(np.empty((0, 2))).tolist() == []


def test_nothing_that_is_given_changes() -> None:
    rng = np.random.default_rng(6)
    given = rng.random((200, 2)), np.sort(rng.integers(0, 3, 200)), rng.uniform(1, 30, 200)
    before = [array.copy() for array in given]
    spread_order(*given)
    assert all(np.array_equal(*pair) for pair in zip(given, before, strict=True))


def test_too_many_cells_end_the_search_and_nothing_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_CELLS", 16)
    points = np.random.default_rng(0).random((300, 2))
    assert sorted(in_order(points)) == list(range(300))
