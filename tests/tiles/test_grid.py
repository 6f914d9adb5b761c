"""Bilinear samples: beside one point at a time, and bounds beside many points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vegtool.tiles.grid import Grid

GRIDS = st.tuples(st.integers(2, 5), st.integers(2, 5)).flatmap(
    lambda shape: arrays(np.float32, shape, elements=st.floats(-100, 100, width=32))
)


def plain(grid: Grid, x: float, z: float) -> float:
    """One point, in words: the two rows about it, each between its two columns."""
    rows, columns = grid.values.shape
    u = min(max((x / grid.extent[0] + 0.5) * (columns - 1), 0.0), columns - 1.0)
    v = min(max((z / grid.extent[1] + 0.5) * (rows - 1), 0.0), rows - 1.0)
    i, j = min(int(u), columns - 2), min(int(v), rows - 2)
    row = [
        (1 - (u - i)) * float(grid.values[k, i]) + (u - i) * float(grid.values[k, i + 1])
        for k in (j, j + 1)
    ]
    return (1 - (v - j)) * row[0] + (v - j) * row[1]


@settings(max_examples=40, deadline=None)
@given(GRIDS, st.integers(0, 2**32))
def test_points_and_bounds(values: np.ndarray, seed: int) -> None:
    grid = Grid(values, np.array([30.0, 50.0]))
    rng = np.random.default_rng(seed)
    points = rng.uniform(-40, 40, (20, 2))
    found = grid.at(points)
    assert found == pytest.approx([plain(grid, x, z) for x, z in points], abs=1e-4)
    x, z = (np.sort(rng.uniform(-half, half, (3, 2)), axis=1) for half in (15, 25))
    low, high = grid.extremes(x, z)
    for a, b in np.ndindex(3, 3):
        inside = rng.uniform((x[a, 0], z[b, 0]), (x[a, 1], z[b, 1]), (30, 2))
        heights = grid.at(inside)
        assert low[b, a] - 1e-4 <= heights.min() and heights.max() <= high[b, a] + 1e-4
    low, high = grid.extremes(np.array([[-15.0, 15.0]]), np.array([[-25.0, 25.0]]))
    assert (low, high) == (values.min(), values.max()), "all of it: all samples and no others"


def test_corners_sides_and_beyond() -> None:
    """The first row is the northern one, at -z; the first column the western one, at -x."""
    grid = Grid(np.array([[0, 1, 2], [10, 11, 12]], np.float32), np.array([20.0, 8.0]))
    assert grid.step.tolist() == [10, 8]
    corners = np.array([[-10, -4], [10, -4], [-10, 4], [10, 4]], np.float64)
    assert grid.at(corners).tolist() == [0, 2, 10, 12]
    assert grid.at(3 * corners).tolist() == [0, 2, 10, 12], "beyond: as on the border"
    assert grid.at(np.zeros((1, 2))).tolist() == [6]


def test_the_gradient_is_that_of_the_plane() -> None:
    x, z = np.meshgrid(np.linspace(-10, 10, 5), np.linspace(-6, 6, 4))
    grid = Grid(0.5 * x - 2 * z, np.array([20.0, 12.0]))
    points = np.random.default_rng(0).uniform(-6, 6, (10, 2))
    assert grid.gradient(points) == pytest.approx(np.tile([0.5, -2], (10, 1)), abs=1e-6)


def test_the_gradient_is_the_change_over_a_short_way() -> None:
    grid = Grid(np.random.default_rng(1).normal(size=(4, 5)), np.array([4.0, 3.0]))
    points = np.random.default_rng(2).uniform(-1.4, 1.4, (50, 2))
    points = points[(np.abs(points % 1.0 - 0.5) < 0.49).all(axis=1)]  # off the seams of cells
    for axis in (0, 1):
        step = 1e-6 * np.eye(2)[axis]
        change = (grid.at(points + step) - grid.at(points - step)) / 2e-6
        assert grid.gradient(points)[:, axis] == pytest.approx(change, abs=1e-4)


def test_one_row_is_no_grid() -> None:
    with pytest.raises(ValueError, match="at least 2 x 2"):
        Grid(np.zeros((1, 5)), np.ones(2))
