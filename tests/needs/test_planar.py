"""Distances in the plane, and parts of a circle, against dense samples of both."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.needs.arcs import PARTS, STEP, covered, smallest
from vegtool.needs.planar import gaps, reaches, within
from vegtool.seeding import generator


def test_rectangles_and_segments() -> None:
    """Bounds hold for all samples of both, and some samples come near them."""
    random = generator(0, "planar")
    low = random.uniform(-5, 5, (12, 2))
    high = low + random.uniform(0, 4, (12, 2))
    start, end = random.uniform(-8, 8, (2, 20, 2))
    end[0], end[1, 0], end[2, 1] = start[0], start[1, 0], start[2, 1]  # a point, and along axes
    share = np.linspace(0, 1, 21)
    square = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
    line = start[:, None] + share[:, None] * (end - start)[:, None]
    near, far = gaps(low, high, start, end), reaches(low, high, start, end)
    for i in range(len(low)):
        points = low[i] + square * (high[i] - low[i])
        away = np.linalg.norm(line[:, :, None] - points, axis=3).reshape(len(line), -1)
        assert (away.min(axis=1) >= near[i] - 1e-9).all()
        assert (away.max(axis=1) <= far[i] + 1e-9).all()
        assert away.min(axis=1) == pytest.approx(near[i], abs=0.5)
        assert away.max(axis=1) == pytest.approx(far[i], abs=1e-9)  # at corners and ends
    assert gaps(low, low, start, end) == pytest.approx(gaps(low, low.copy(), start, end))


def test_points_in_a_polygon() -> None:
    """An L: its notch is outside."""
    corners = np.array([[0, 0], [4, 0], [4, 2], [2, 2], [2, 4], [0, 4]], np.float64)
    points = np.array([[1, 1], [3, 1], [1, 3], [3, 3], [-1, 1], [5, 1]], np.float64)
    assert within(points, corners).tolist() == [True, True, True, False, False, False]
    assert within(points, corners[::-1]).tolist() == within(points, corners).tolist()


def test_arcs() -> None:
    """Two of 10 degrees, 30 apart across zero: 40 degrees hold both."""
    start, extent = np.radians([350.0, 20.0]), np.radians([10.0, 10.0])
    first, size = smallest(covered(start, extent))
    assert np.degrees(first) == pytest.approx(350, abs=0.1)
    assert np.degrees(size) == pytest.approx(40, abs=0.2)
    assert smallest(covered(np.zeros(1), np.full(1, 7.0))) == (0.0, 2 * np.pi)
    assert smallest(np.zeros(PARTS, np.bool_)) == (0.0, 0.0)
    turns = np.array([-1e-18, 2 * np.pi, 4 * np.pi])
    assert smallest(covered(turns, np.zeros(3)))[1] <= 2 * STEP


def test_arcs_hold_what_they_are_made_of() -> None:
    random = generator(0, "arcs")
    for _ in range(200):
        start, extent = random.uniform(-9, 9, 3), random.uniform(0, 1.5, 3)
        first, size = smallest(covered(start, extent))
        share = np.linspace(0, 1, 20)[:, None]
        assert ((start + share * extent - first + 1e-9) % (2 * np.pi) <= size + 2e-9).all()
