"""Two sides a hair apart: the largest hole on a side, with normals among the distances and without.

A limit that Brandt et al. 2019 state in section 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from time import process_time

import numpy as np
from scipy.spatial import cKDTree

from blue.orders import CANDIDATES, MS, SIZES
from vegtool.arrays import FloatArray
from vegtool.surfels.blue.farthest import farthest_order

HAIR_M = 1e-4
WEIGHTS_M = (0.0, 0.005, 0.02, 0.1)
"""Of normals."""
EVERY = 10
"""Candidates of which one is looked at for holes."""


@dataclass(frozen=True, eq=False)
class Sides:
    """Of one seed each: cpu_ms, and hole_m, the largest distance from a candidate to a point of its
    side, of both sides."""

    points: int
    normal_weight_m: float
    cpu_ms: FloatArray
    hole_m: FloatArray


def measured(repeats: int) -> list[Sides]:
    """Of a plate of one metre."""
    rng = np.random.default_rng(0)
    side = np.where(np.arange(CANDIDATES) < CANDIDATES // 2, 1.0, -1.0)
    places = np.column_stack([rng.random((CANDIDATES, 2)), HAIR_M / 2 * side])
    normals = np.outer(side, [0.0, 0.0, 1.0])
    farthest_order(places[:1_000], 10, normals=normals[:1_000], normal_weight=1.0)  # is compiled
    found = []
    for points, weight in product(SIZES, WEIGHTS_M):
        cpu, hole = np.zeros(repeats), np.zeros(repeats)
        for seed in range(repeats):
            began = process_time()
            order = farthest_order(places, points, seed=seed, normals=normals, normal_weight=weight)
            cpu[seed] = process_time() - began
            hole[seed] = max(
                cKDTree(places[order][side[order] == one])
                .query(places[side == one][::EVERY])[0]
                .max()
                for one in (-1, 1)
            )
        found.append(Sides(points, weight, MS * cpu, hole))
    return found
