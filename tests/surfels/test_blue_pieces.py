"""Long things in pieces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from surfel_sets import ball

from vegtool.seeding import generator
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.distances import nearest, spacing
from vegtool.surfels.blue.exact import exact_order
from vegtool.surfels.blue.pieces import FEWEST, LONGEST, pieces


def wall(length: float, count: int) -> SurfelSet:
    """Of a height of one, and no depth, in exact order."""
    points = generator(0, "wall").random((8 * count, 3)) * (length, 1.0, 0.0)
    position = points[exact_order(points, count)]
    normal = np.tile([0.0, 0.0, 1.0], (count, 1))
    return SurfelSet(position, normal, np.ones_like(position), spacing(position))


def test_what_is_not_long_stays_as_it_is() -> None:
    one = ball(3 * FEWEST)
    assert pieces(one) == (one,)
    few = wall(20.0, FEWEST)
    assert pieces(few) == (few,), "too few to cut"


def test_pieces_are_all_of_it_and_none_is_long() -> None:
    one = wall(16.0, 12 * FEWEST)
    parts = pieces(one)
    assert len(parts) == 8
    together = np.concatenate([part.position for part in parts])
    assert np.array_equal(np.unique(together, axis=0), np.unique(one.position, axis=0))
    for part in parts:
        size = np.sort(np.diff(part.bounds, axis=0)[0])
        assert size[2] <= LONGEST * size[1]


def test_every_prefix_of_a_piece_is_spread_as_evenly() -> None:
    """Of an exact order, no two points of a prefix are nearer than the whole's prefix had them."""
    one = wall(8.0, 6 * FEWEST)
    for part in pieces(one):
        share = len(part) / len(one)
        for prefix in (100, 500, len(part)):
            whole = nearest(one.position[: round(1.1 * prefix / share)]).min()
            assert nearest(part.position[:prefix]).min() >= whole
        assert part.spacing.total == len(part)


def test_a_long_wall_needs_fewer_surfels_in_pieces() -> None:
    """Seen along it, from one metre: the nearest piece needs all, each next one fewer."""
    one = wall(64.0, 40 * FEWEST)
    parts = pieces(one)

    def needed(some: SurfelSet) -> int:
        away = max(float(some.bounds[0, 0]), 0.0) + 1.0
        return int(some.discs(np.array([0.01 * away]))[0][0])

    assert sum(needed(part) for part in parts) < 0.25 * needed(one)


def test_pieces_keep_what_surfels_are_like() -> None:
    one = replace(wall(8.0, 4 * FEWEST), unlit=True)
    assert all(part.unlit for part in pieces(one))
