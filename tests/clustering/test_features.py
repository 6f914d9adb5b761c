"""The plant's own frame, in which features are measured."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.clustering.features import frame

RANDOM = np.random.default_rng(0)
LATTICE = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3)
POINTS = {
    "of no form": RANDOM.normal(size=(50, 3)) * [3, 2, 1] + RANDOM.random((50, 1)) ** 2,
    "equal along all axes": LATTICE,
    "equal along two axes": LATTICE * [1, 3, 1],
    "mirror images": np.concatenate([LATTICE * [3, 2, 1], LATTICE * [-3, -2, -1]]),
}


def turn(seed: int) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize("points", POINTS.values(), ids=POINTS)
@pytest.mark.parametrize("seed", range(3))
def test_turned_points_have_turned_axes(points: np.ndarray, seed: int) -> None:
    weights = np.full(len(points), 1 / len(points))
    here, there = frame(points, weights), frame(points @ turn(seed).T, weights)
    assert there == pytest.approx(here @ turn(seed).T, abs=1e-9)


@pytest.mark.parametrize(
    "points", [np.zeros((4, 3)), np.eye(3)[:1], np.arange(6.0)[:, None] * [1, 2, 2]]
)
def test_points_without_a_frame_get_one(points: np.ndarray) -> None:
    axes = frame(points, np.full(len(points), 1 / len(points)))
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


def test_axes_point_to_where_the_points_are_skewed() -> None:
    """Most lie at 0, one far out along x: the first axis points there, however it is mirrored."""
    points = np.array([[0.0, 0, 0], [0, 0.1, 0], [0, -0.1, 0.1], [5, 0, 0]])
    weights = np.full(4, 0.25)
    assert frame(points, weights)[0, 0] > 0.9
    assert frame(-points, weights)[0, 0] < -0.9
