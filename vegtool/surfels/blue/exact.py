"""The exact greedy permutation of candidates: always the one farthest from all before.

Gonzalez (1985); as Brandt et al., section 3.3, compare with. Any prefix is an r-net, r the least
distance in it: no two points are nearer, and no candidate is farther from all of them.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.seeding import generator
from vegtool.surfels.blue.places import asked, places


def exact_order(
    positions: FloatArray,
    count: int,
    *,
    seed: int = 0,
    normals: FloatArray | None = None,
    normal_weight: float = 0.0,
) -> IntArray:
    """(min(count, n),) int32 candidates, the first one at random, copies of others last.

    positions: (n, 3) metres. normals: (n, 3) unit. normal_weight: metres that a unit of difference
    of normals counts as. Raises UsageError for negative numbers, ValueError for arrays of another
    shape.
    """
    at = places(positions, normals, normal_weight)
    count = asked(count, len(at))
    if count == 0:
        return np.zeros(0, np.int32)
    from vegtool.surfels.blue.box_tree import traverse

    first = int(generator(seed, "first blue surfel").integers(len(at)))
    return traverse(at, first, count)
