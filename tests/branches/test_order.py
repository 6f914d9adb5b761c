"""The file's order as a hint."""

from __future__ import annotations

import numpy as np

from vegtool.branches.axes import Axes
from vegtool.branches.order import NEIGHBOURS, follow_order

SIDE_BY_SIDE = Axes(  # two axes, a tenth apart
    np.array([[0, 0, 0], [0, 0.1, 0]], dtype=float),
    np.array([[1, 0, 0], [1, 0.1, 0]], dtype=float),
    np.full(2, 0.01),
    np.full(2, 0.01),
    np.arange(2),
    np.zeros(2),
)


def hang(heights: list[float]) -> list[int]:
    """Leaves in a row along the axes, at those heights above the first of them."""
    x = np.linspace(0.1, 0.9, len(heights))
    anchors = np.stack([x, np.array(heights), np.zeros(len(x))], axis=1)
    tube, cost = SIDE_BY_SIDE.nearest_tubes(anchors)
    return follow_order(anchors, tube, cost, SIDE_BY_SIDE).tolist()


def test_a_leaf_between_two_branches_goes_with_its_neighbours():
    row = [0.02] * 8 + [0.055] + [0.02] * 8
    assert hang(row) == [0] * 17


def test_leaves_that_touch_their_branch_stay():
    row = [0.0] * 8 + [0.1] + [0.0] * 8
    assert hang(row) == [0] * 8 + [1] + [0] * 8


def test_the_border_between_two_branches_stays():
    row = [0.02] * 9 + [0.08] * 9
    assert hang(row) == [0] * 9 + [1] * 9


def test_without_order_or_with_few_leaves_nothing_is_changed():
    assert hang([0.02, 0.08] * 10) == [0, 1] * 10
    few = [0.02] * (NEIGHBOURS - 1) + [0.055]
    assert hang(few) == [0] * (NEIGHBOURS - 1) + [1]
