"""Boxes whose principal axes are open: exact rectangles find the edges that steps stop short of."""

from __future__ import annotations

import numpy as np
import pytest
from box_cases import box_points, one, some_rotation

from vegtool.boxes import fit_boxes
from vegtool.boxes.flush import flush_box


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "half", [(1, 1, 1), (1, 1, 0.1), (1, 0.1, 0.1), (1, 2e-6, 1e-6), (1, 1, 0), (1, 0, 0)]
)
def test_boxes_of_equal_sides_are_found_exactly(half, seed: int) -> None:
    """Eight corners; what is known of a needle's thickness is 1e-16 of its length."""
    points = box_points(half, inside=0) @ some_rotation(seed).T
    box = fit_boxes(points, one(points), 1)
    assert box.half[0] == pytest.approx(half, rel=2e-9, abs=1e-15)


def test_a_box_that_is_the_least_stays() -> None:
    points = box_points((3, 2, 1), inside=50)
    assert np.array_equal(flush_box(points, np.eye(3)), np.eye(3))


def test_no_box_grows() -> None:
    rng = np.random.default_rng(0)
    for seed in range(20):
        points, axes = rng.normal(size=(30, 3)), some_rotation(seed)
        turned = flush_box(points, axes)
        before, after = (np.ptp(points @ a.T, axis=0).prod() for a in (axes, turned))
        assert after <= before
        assert turned @ turned.T == pytest.approx(np.eye(3), abs=1e-12)
