"""The points of blue_noise.py as tiles see them: several periods, one, or a part of one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.tiles.blue_noise import COUNT, blue_noise, nearest_distances
from vegtool.tiles.placement import LongArray


@dataclass(frozen=True, eq=False)
class Pattern:
    """The points of a tile, in order, whichever tile it is.

    place: (m, 2) periods from the corner of the tile's first period. index: (m,) number of the
    point in its period. period: (m, 2) which of the tile's periods. rank: (m,) 0 to 1.
    slack: (m,) periods, how far the point may be moved.
    """

    place: FloatArray
    index: LongArray
    period: LongArray
    rank: FloatArray
    slack: FloatArray

    def __len__(self) -> int:
        return len(self.rank)


@cache
def least_distance() -> float:
    """Periods: between any two points."""
    return float(nearest_distances(blue_noise()).min())


@cache
def slacks() -> FloatArray:
    """(COUNT,) periods that points may be moved by: half of what their nearest is farther away
    than the least distance. Two points are at least as far apart as the nearest of either, so
    that moved ones still are at the least distance."""
    nearest = nearest_distances(blue_noise())
    return np.asarray((nearest - nearest.min()) / 2)


@cache
def pattern(scale: int, column: int = 0, row: int = 0) -> Pattern:
    """The points of a tile whose side is 2^scale periods; below one period, of the part of it in
    that column and row."""
    points, index = blue_noise(), np.arange(COUNT)
    if scale > 0:
        cells = cells_in_order(scale)
        index = np.repeat(index, len(cells))
        period = np.tile(cells, (COUNT, 1))
    else:
        index = index[(np.floor(points * 2**-scale) == (column, row)).all(axis=1)]
        period = np.zeros((len(index), 2), dtype=np.int64)
    rank = (index + 0.5) / COUNT
    return Pattern(points[index] + period, index, period, rank, slacks()[index])


def cells_in_order(scale: int) -> LongArray:
    """(4^scale, 2) cells of a square of 2^scale x 2^scale, any first of them spread evenly, as in
    ordered dithering (B. Bayer 1973)."""
    cells = np.zeros((1, 2), dtype=np.int64)
    quarters = np.array([[0, 0], [1, 1], [1, 0], [0, 1]])
    for done in range(scale):  # each cell so far in all quarters, then the next cell
        cells = (cells[:, None] + 2**done * quarters).reshape(-1, 2)
    return cells


def part_of_period(scale: int, column: int, row: int) -> tuple[int, int]:
    """Which part of its period the tile in that column and row is."""
    parts = 2 ** max(-scale, 0)
    return column % parts, row % parts


def first_period(scale: int, column: int, row: int) -> tuple[int, int]:
    """The period that a tile is a part of, or the first of those on it."""
    if scale > 0:
        return column << scale, row << scale
    return column >> -scale, row >> -scale
