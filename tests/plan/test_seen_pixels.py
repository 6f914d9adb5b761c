"""Pixels that are seen of plants: as large as they look, less what is before them."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from vegtool.plan.seen import OPACITY, in_sight
from vegtool.seeding import generator


def disc(radius: float, away: float) -> float:
    """Steradians of a ball."""
    return 2 * pi * (1 - (1 - (radius / away) ** 2) ** 0.5)


def test_a_ball_is_as_large_as_it_looks() -> None:
    middle = np.array([[0.0, 0, -10], [3, 4, 0], [0, 500, 0]])
    radius = np.array([1.0, 2.0, 0.1])
    expected = [disc(1, 10), disc(2, 5), disc(0.1, 500)]
    assert in_sight(middle, radius) == pytest.approx(OPACITY * np.array(expected))


def test_what_is_behind_is_seen_through_what_is_before() -> None:
    """Two of the same size in the picture: of the second, what the first lets through, or more at
    its corners; far ones beside them are not hidden."""
    for scale in (1.0, 0.001):  # larger than a cell of the grid, and smaller
        middle = np.array([[0.0, 0, 10], [0, 0, 20], [20, 0, 0]])
        near, far, beside = in_sight(middle, scale * np.array([2.0, 4.0, 4.0]))
        assert near == pytest.approx(OPACITY * disc(2 * scale, 10))
        assert beside == pytest.approx(near)
        if scale == 1.0:
            assert (1 - OPACITY) * near < far < 0.75 * near


def test_a_wood_hides_what_is_far() -> None:
    """Of 10,000 trees on a square kilometre, all that is seen fills a ring around the horizon once,
    and those beyond 300 m are less of it than those within 50 m."""
    random = generator(0, "wood")
    middle = random.uniform(-500, 500, (10_000, 3)) * [1, 0, 1] + [0, 3, 0]
    away = np.linalg.norm(middle, axis=1)
    found = in_sight(middle, np.full(len(middle), 4.0))
    assert found[away > 300].sum() < 0.1 * found[away < 50].sum()
    assert found.sum() < 2 * pi + pi  # little above the lower half, the eye's own tree apart


def test_turned_scenes_are_seen_alike() -> None:
    """About the axis, by whole cells."""
    random = generator(1, "turned")
    middle = random.uniform(-50, 50, (300, 3))
    turn = 2 * pi * 13 / 256
    c, s = np.cos(turn), np.sin(turn)
    turned = middle @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    one, other = (in_sight(places, np.full(300, 2.0)) for places in (middle, turned))
    assert other.sum() == pytest.approx(one.sum(), rel=1e-2)
