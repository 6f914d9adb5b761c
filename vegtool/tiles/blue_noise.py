"""Points spread evenly, any first part of them too, over a square that repeats without a seam.

Farthest points first: Y. Eldar, M. Lindenbaum, M. Porat and Y. Y. Zeevi, "The farthest point
strategy for progressive image sampling", IEEE Transactions on Image Processing 6(9), 1997, on a
torus, and among a fine grid of candidates, each at a random place in its cell, in place of the
vertices of a Voronoi diagram. Each point is put where it is farthest from all before it. From one
first point that would make a square lattice; the few that are placed at random forbid it (measured
in docs/placement.md).

The order is a rank: a threshold on it thins the set and leaves it even, as in dithering by void and
cluster (R. Ulichney, 1993), stippling with Poisson disks (M. McCool and E. Fiume, "Hierarchical
Poisson disk sampling distributions", Graphics Interface 1992), and J. Kopf, D. Cohen-Or, O. Deussen
and D. Lischinski, "Recursive Wang tiles for real-time blue noise", SIGGRAPH 2006.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.seeding import generator

COUNT = 4096
"""Points in the square."""
SIDE = 512
"""Candidates along a side: 64 for each point."""
BLOCK = 16
"""Candidates along a side of those whose farthest is remembered."""
AT_RANDOM = 8
"""The first points."""
APART = 0.5
"""Of the way of the farthest candidate, which the first points stay apart."""


@cache
def blue_noise() -> FloatArray:
    """(COUNT, 2) in [0, 1), in order; always the same."""
    rng = generator(0, "blue noise")
    points = farthest_points(rng, COUNT)
    points.flags.writeable = False
    return points


def nearest_distances(points: FloatArray) -> FloatArray:
    """(n,) from each point in the unit square to the nearest other one, or its repetition."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points, boxsize=1.0).query(points, k=2)
    return np.asarray(distance[:, 1])


def farthest_points(rng: np.random.Generator, count: int) -> FloatArray:
    """(count, 2) in [0, 1): each farthest from those before it, on the torus."""
    grid = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij"))
    candidates = (grid + rng.random((2, SIDE, SIDE))) / SIDE
    squared = np.full((SIDE, SIDE), 1.0)  # to the nearest point so far; at most 1/2
    blocks = SIDE // BLOCK
    by_block = squared.reshape(blocks, BLOCK, blocks, BLOCK).transpose(0, 2, 1, 3)
    farthest = by_block.max(axis=(2, 3))  # in each block: so that 4096 times few are looked at
    points = np.empty((count, 2))
    place = tuple(rng.integers(SIDE, size=2))
    for number in range(count):
        point = points[number] = candidates[:, place[0], place[1]]
        reach = int(np.ceil(np.sqrt(farthest.max()) * SIDE)) + 1  # beyond, nothing comes nearer
        near = [_around(centre, reach, SIDE) for centre in place]
        touched = [np.unique(rows // BLOCK) for rows in near]
        window = np.ix_(*near)
        away = np.abs(np.stack([axis[window] for axis in candidates]) - point[:, None, None])
        away = np.minimum(away, 1 - away)
        squared[window] = np.minimum(squared[window], (away**2).sum(axis=0))
        farthest[np.ix_(*touched)] = by_block[np.ix_(*touched)].max(axis=(2, 3))
        if number + 1 < AT_RANDOM:
            place = _at_random(rng, squared)
        else:
            block = np.unravel_index(farthest.argmax(), farthest.shape)
            inner = np.unravel_index(by_block[block].argmax(), (BLOCK, BLOCK))
            place = tuple(int(b * BLOCK + i) for b, i in zip(block, inner, strict=True))
    return points


def _around(centre: int, reach: int, side: int) -> np.ndarray:
    """Indices within reach of one, on a ring."""
    if 2 * reach + 1 >= side:
        return np.arange(side)
    return np.arange(centre - reach, centre + reach + 1) % side


def _at_random(rng: np.random.Generator, squared: FloatArray) -> tuple[int, int]:
    """Any candidate that is not too near to a point."""
    allowed = np.flatnonzero(squared > APART**2 * squared.max())
    place = np.unravel_index(allowed[rng.integers(len(allowed))], squared.shape)
    return int(place[0]), int(place[1])
