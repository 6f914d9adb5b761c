"""The number of billboards stays within the budget, and uses it, in few clusterings."""

from __future__ import annotations

import numpy as np
import pytest
from box_cases import box_points
from plants import plant_of

from vegtool.arrays import IntArray
from vegtool.boxes import BoxOptions, fit_budget
from vegtool.boxes.budget import MAX_CALLS, lowered
from vegtool.errors import UsageError
from vegtool.plant import Plant


def twigs() -> Plant:
    """Small triangles all over a block."""
    points = box_points((4, 2, 2), inside=2000)
    return plant_of(points[:, None] + 0.05 * np.random.default_rng(0).normal(size=(1, 3, 3)))


class Slices:
    """A clustering by slices along x, of equal counts, that records what it is asked."""

    def __init__(self, plant: Plant, most: int = 10**9) -> None:
        self.rank = np.argsort(np.argsort(plant.face_centroids[:, 0]))
        self.asked: list[int] = []
        self.most = most

    def __call__(self, count: int) -> IntArray:
        self.asked.append(count)
        count = min(count, self.most)
        return (self.rank * count // len(self.rank)).astype(np.int32)


@pytest.mark.parametrize("budget", [1, 2, 3, 7, 22, 67, 200])
@pytest.mark.parametrize("shape", ["auto", "single", "crossed"])
@pytest.mark.parametrize("fit", ["volume", "orientation"])
def test_budget_is_kept_and_used(budget: int, shape, fit) -> None:
    plant = twigs()
    slices = Slices(plant)
    labels, billboards = fit_budget(plant, slices, budget, BoxOptions(shape=shape, plane=fit))
    assert len(slices.asked) <= MAX_CALLS
    assert len(billboards) <= budget
    assert len(billboards) >= min(0.9 * budget, budget - 2)
    assert np.array_equal(np.unique(billboards.cluster), np.unique(labels))
    if shape == "crossed" and budget > 7:
        assert (np.bincount(billboards.cluster) >= 2).all()


def test_single_planes_need_one_clustering() -> None:
    plant = twigs()
    slices = Slices(plant)
    _, billboards = fit_budget(plant, slices, 50, BoxOptions(shape="single"))
    assert slices.asked == [50] and len(billboards) == 50


def test_a_clustering_that_cannot_give_more_is_accepted() -> None:
    plant = twigs()
    slices = Slices(plant, most=5)
    _, billboards = fit_budget(plant, slices, 100, BoxOptions())
    assert len(np.unique(billboards.cluster)) == 5 and len(slices.asked) <= MAX_CALLS


def test_the_flattest_are_lowered_first_and_no_more_than_needed() -> None:
    planes = np.array([3, 3, 1, 3])
    form = np.array([0.5, 0.3, 0.0, 0.4])
    assert lowered(planes, 1, form, 10).tolist() == [3, 3, 1, 3]
    assert lowered(planes, 1, form, 9).tolist() == [3, 1, 1, 3]
    assert lowered(planes, 1, form, 7).tolist() == [3, 1, 1, 1]
    assert lowered(planes, 2, form, 9).tolist() == [3, 2, 1, 3]


def test_no_budget_is_an_error() -> None:
    plant = twigs()
    with pytest.raises(UsageError, match="at least 1"):
        fit_budget(plant, Slices(plant), 0)
