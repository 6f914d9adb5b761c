"""Plants of a tile in an order whose every first part is spread evenly, tall ones first.

Farthest points first (Eldar et al. 1997) would be best, and costs the square of their number. Here
the points of blue_noise.py, which are in that order already, choose plants: each of the first 1, 2,
4, 8, ... points takes the plant nearest to it, in the part of the tile that is nearer to it than to
the others of them, unless a plant there has been chosen before. Beyond 4096 points the square of
them is repeated, smaller, 4 and 16 times. What is left then stands closer than a 256th of the tile,
and keeps its order. How even that is, and what else was tried: docs/placement.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import log2

import numpy as np

from vegtool.arrays import FloatArray, IntArray, SingleArray
from vegtool.tiles.blue_noise import COUNT, blue_noise
from vegtool.tiles.pattern import cells_in_order
from vegtool.tiles.placement import LongArray

LEVELS = (*((2**k, 0) for k in range(int(log2(COUNT)) + 1)), (COUNT, 1), (COUNT, 2))
"""How many of the points choose, and how often their square is halved."""
SIDE = 512
"""Pixels along the side of the picture that says which point is nearest: six between points."""
BATCH = 2**16
"""Plants at a time, in whole tiles."""
MOST_CELLS = 2**22
"""Parts of tiles at a time; where tiles are so many that it takes more, the rest is not spread."""
LATER = 2**62
"""The turn of those that were not chosen."""


def spread_order(place: FloatArray, tile: LongArray, height: FloatArray) -> LongArray:
    """(n,) the order of plants: by tile, in each by `height_class`, in these spread evenly.

    place: (n, 2) 0 to 1 along the sides of a plant's tile. tile: (n,) any numbers, ascending.
    height: (n,) metres.
    """
    turn = np.full(len(tile), LATER)
    classes = height_class(height)
    for batch in _batches(tile):
        turn[batch] = _turns(place[batch], tile[batch], classes[batch])
    return np.lexsort((turn, -classes, tile))


def height_class(height: FloatArray) -> IntArray:
    """(n,) int32: octaves of a height, so that 8 to 16 m are one class, and come before 4 to 8."""
    return np.floor(np.log2(height)).astype(np.int32)


def _batches(tile: LongArray) -> Iterator[slice]:
    """Parts of about BATCH plants that end where a tile does."""
    start = 0
    while start < len(tile):
        last = tile[min(start + BATCH, len(tile)) - 1]
        stop = int(np.searchsorted(tile, last, side="right"))
        yield slice(start, stop)
        start = stop


def _turns(place: FloatArray, tile: LongArray, classes: IntArray) -> LongArray:
    """(n,) when plants are chosen, among those of their tile and class."""
    turn = np.full(len(place), LATER)
    chosen = np.zeros(len(place), dtype=bool)
    _, tile = np.unique(tile, return_inverse=True)
    found: list[tuple[LongArray, SingleArray]] = []  # of each level, the same for all classes
    for one in np.unique(classes)[::-1]:
        left = np.flatnonzero(classes == one)
        for level, (points, halvings) in enumerate(LEVELS):
            active, cells = np.unique(tile[left]), points * 4**halvings
            if len(active) * cells > MOST_CELLS:
                break
            if len(found) == level:
                found.append(_cells(place, points, halvings))
            cell, away = found[level]
            slot = np.full(tile[-1] + 1, -1)
            slot[active] = np.arange(len(active))
            taken = np.zeros(len(active) * cells, dtype=bool)
            others = np.flatnonzero(chosen & (slot[tile] >= 0))
            taken[slot[tile[others]] * cells + cell[others]] = True
            key = slot[tile[left]] * cells + cell[left]
            free = ~taken[key]
            first = left[free][_nearest(key[free], away[left[free]], len(taken))]
            turn[first] = (level << 32) + cell[first]
            chosen[first] = True
            left = left[~chosen[left]]
            if not len(left):
                break
    return turn


def _cells(place: FloatArray, points: int, halvings: int) -> tuple[LongArray, SingleArray]:
    """Of plants, (n,) each: the number of the cell of its tile that it is in, in the order in which
    cells choose, and how far it is from the cell's point, squared."""
    square = place * 2.0**halvings
    corner = square.astype(np.int64)
    square -= corner
    pixel = (square * SIDE).astype(np.int64)
    point = _nearest_points(points)[pixel[:, 0], pixel[:, 1]].astype(np.int64)
    away = square - blue_noise()[point]
    part = _part_turns(halvings)[corner[:, 0], corner[:, 1]]
    squared = away[:, 0] ** 2 + away[:, 1] ** 2
    return point * 4**halvings + part, squared.astype(np.float32)


def _nearest(cell: LongArray, away: SingleArray, count: int) -> LongArray:
    """In each cell, of 0..count-1, the first of those that are the least away."""
    least = np.full(count, np.inf, dtype=np.float32)
    np.minimum.at(least, cell, away)
    best = np.flatnonzero(away == least[cell])
    _, first = np.unique(cell[best], return_index=True)
    return np.asarray(best[first])


@cache
def _nearest_points(count: int) -> IntArray:
    """(SIDE, SIDE) int32: which of the first `count` points is nearest to a pixel of the tile; not
    across its border, as there the neighbour's points choose among its plants."""
    from scipy.ndimage import distance_transform_edt

    pixel = (blue_noise()[:count] * SIDE).astype(np.int64)
    empty = np.ones((SIDE, SIDE), dtype=bool)
    empty[tuple(pixel.T)] = False
    number = np.empty((SIDE, SIDE), dtype=np.int32)
    number[tuple(pixel.T)] = np.arange(count)
    nearest = distance_transform_edt(empty, return_distances=False, return_indices=True)
    return np.asarray(number[tuple(nearest)])


@cache
def _part_turns(halvings: int) -> LongArray:
    """(2^h, 2^h): when each part of a tile comes."""
    turns = np.empty((2**halvings, 2**halvings), dtype=np.int64)
    turns[tuple(cells_in_order(halvings).T)] = np.arange(4**halvings)
    return turns
