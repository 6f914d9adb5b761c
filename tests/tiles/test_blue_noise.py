"""The pattern: farthest points first, even in every first part, without a seam or a lattice."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tile_cases import least_distance, torus_distances

from vegtool.seeding import generator
from vegtool.tiles import blue_noise as module
from vegtool.tiles.blue_noise import COUNT, blue_noise, farthest_points, nearest_distances
from vegtool.tiles.pattern import cells_in_order, pattern, slacks
from vegtool.tiles.pattern import least_distance as pattern_distance


def hexagonal(count: int) -> float:
    """The greatest least distance of that many points on a unit torus."""
    return float(np.sqrt(2 / np.sqrt(3) / count))


def test_each_point_is_as_far_from_those_before_as_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """On few candidates, all of which the oracle looks at, for each of 60 points."""
    side, random = 24, 3
    for name, value in (("SIDE", side), ("BLOCK", 8), ("AT_RANDOM", random)):
        monkeypatch.setattr(module, name, value)
    points = farthest_points(generator(5, "case"), 60)
    rng = generator(5, "case")
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    candidates = ((grid + rng.random((2, side, side))) / side).reshape(2, -1).T
    nearest = torus_distances(candidates, points[0])
    for number, point in enumerate(points[1:], start=1):
        away = torus_distances(points[:number], point).min()
        if number >= random:
            assert away == pytest.approx(nearest.max(), abs=1e-12)
        else:
            assert away >= 0.5 * nearest.max()
        nearest = np.minimum(nearest, torus_distances(candidates, point))


def test_every_first_part_is_spread_evenly() -> None:
    """Points at random are a fiftieth of the greatest distance apart at 1024, and farthest points
    0.7 of it; it is 1 for a hexagonal lattice alone."""
    points = blue_noise()
    for count in (64, 100, 256, 700, 1024, 2048, 3000, COUNT):
        nearest = nearest_distances(points[:count])
        assert nearest.min() > 0.7 * hexagonal(count)
        assert nearest.mean() > 0.8 * hexagonal(count)
        if count <= 256:  # the shortest way round is among the nine repetitions
            steps = np.stack(np.meshgrid((0, 1, 2), (0, 1, 2)), axis=-1).reshape(-1, 1, 2)
            block = (points[:count] + steps).reshape(-1, 2)
            assert least_distance(block) == pytest.approx(nearest.min(), abs=1e-12)


def test_there_is_no_lattice() -> None:
    """In the power spectrum a lattice of n points has peaks of n; a random set has about 1."""
    points = blue_noise()
    waves = np.arange(-90, 91)
    x, y = (np.exp(-2j * np.pi * np.outer(waves, axis)) for axis in points.T)
    power = np.abs(x @ y.T) ** 2 / COUNT
    power[90, 90] = 0
    assert power.max() < 0.01 * COUNT
    far = np.hypot(*np.meshgrid(waves, waves)) < 20
    assert power[far].mean() < 0.2, "evenly spread: little power in long waves"


def test_it_is_always_the_same() -> None:
    again = farthest_points(generator(0, "blue noise"), 200)
    assert np.array_equal(again, blue_noise()[:200])
    assert blue_noise() is blue_noise() and not blue_noise().flags.writeable


def test_moved_points_keep_their_distance() -> None:
    """Each by all of its slack, towards its nearest: the worst that can be."""
    points = blue_noise()
    steps = np.stack(np.meshgrid((0, 1, -1), (0, 1, -1)), axis=-1).reshape(-1, 1, 2)
    block = (points + steps).reshape(-1, 2)
    distance, nearest = cKDTree(block).query(points, k=2)
    towards = (block[nearest[:, 1]] - points) / distance[:, 1:]
    moved = points + slacks()[:, None] * towards
    assert nearest_distances(moved % 1.0).min() > pattern_distance() * (1 - 1e-9)
    assert slacks().min() >= 0 and slacks().mean() > 0.05 * pattern_distance()


@pytest.mark.parametrize("scale", [0, -1, -3])
def test_parts_of_a_period_are_all_of_it_once(scale: int) -> None:
    parts = 2**-scale
    found = [pattern(scale, x, z) for x in range(parts) for z in range(parts)]
    assert sorted(np.concatenate([part.index for part in found])) == list(range(COUNT))
    for number, part in enumerate(found):
        x, z = divmod(number, parts)
        assert (np.floor(part.place * parts) == (x, z)).all()
        assert (np.diff(part.rank) > 0).all()


def test_several_periods_take_turns() -> None:
    """Of a tile of 4 x 4 periods, the first 16 points are the first one of each."""
    whole = pattern(2)
    assert len(whole) == 16 * COUNT
    assert set(whole.index[:16]) == {0} and len(np.unique(whole.period[:16], axis=0)) == 16
    assert whole.place - whole.period == pytest.approx(blue_noise()[whole.index], abs=1e-12)


def test_cells_come_from_all_quarters_in_turn() -> None:
    for scale in (1, 2, 3):
        cells = cells_in_order(scale)
        assert len(np.unique(cells, axis=0)) == 4**scale
        for first in range(0, len(cells), 4):
            quarter = cells[first : first + 4] // 2 ** (scale - 1)
            assert len(np.unique(quarter, axis=0)) == 4
