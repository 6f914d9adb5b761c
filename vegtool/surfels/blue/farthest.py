"""The progressive order that we make: the exact greedy permutation of some of the candidates.

Brandt et al., section 3.2, take the best of some 200 random candidates again and again, most of
which are near to what is taken. Here a few for each point are drawn once, and ordered exactly.
"""

from __future__ import annotations

from vegtool.arrays import FloatArray, IntArray
from vegtool.surfels.blue.exact import exact_order
from vegtool.surfels.blue.places import asked, drawn

CANDIDATES = 10
"""For each point asked. With fewer the last points are unevenly spaced; more take longer."""


def farthest_order(
    positions: FloatArray,
    count: int,
    *,
    seed: int = 0,
    normals: FloatArray | None = None,
    normal_weight: float = 0.0,
) -> IntArray:
    """(min(count, n),) int32 candidates of which any prefix is spread evenly, the first at random.

    positions: (n, 3) metres. normals: (n, 3) unit. normal_weight: metres that a unit of difference
    of normals counts as: both sides of what is thin get points as soon as these are less than twice
    as far apart. Zero: positions alone. Raises UsageError for negative numbers, ValueError for
    arrays of another shape.
    """
    there = len(positions)
    some = drawn(there, min(CANDIDATES * asked(count, there), there), seed)
    chosen = exact_order(
        positions[some],
        count,
        seed=seed,
        normals=None if normals is None else normals[some],
        normal_weight=normal_weight,
    )
    return some[chosen]
