"""Points among which distances are measured, and some of them.

Brandt et al. measure distances of positions, so that on what is thin the points of one side keep
those of the other away, a limit that their section 6 states. With the normal as three further
coordinates both sides are surfaces of their own.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.errors import UsageError
from vegtool.seeding import generator


def places(
    positions: FloatArray, normals: FloatArray | None = None, normal_weight: float = 0.0
) -> FloatArray:
    """(n, 3) positions, or (n, 6) with normals, metres.

    positions: (n, 3) metres. normals: (n, 3) unit. normal_weight: metres, what a unit of difference
    of normals counts as: two sides are 2 normal_weight apart. Raises ValueError where arrays are no
    such, and UsageError where the weight is negative or has no normals to weigh.
    """
    positions = checked("positions", positions, (None, 3), np.float64)
    if not 0 <= normal_weight < np.inf:
        raise UsageError(f"normal weight: expected metres, zero or more; got {normal_weight}")
    if normal_weight > 0 and normals is None:
        raise UsageError(f"normal weight: expected normals to weigh by {normal_weight} m; got none")
    if normals is None or normal_weight == 0:
        return positions
    normals = checked("normals", normals, (len(positions), 3), np.float64)
    joined = np.hstack([positions, normals * normal_weight])
    return checked("places", joined, (None, 6), np.float64)


def asked(count: int, there: int) -> int:
    """How many points an order has: as many as asked, or all. Raises UsageError below zero."""
    if count < 0:
        raise UsageError(f"points: expected zero or more; got {count:,}")
    return min(count, there)


def drawn(there: int, many: int, seed: int) -> IntArray:
    """(many,) int32 rising, many <= there: one at random of each of as many runs of candidates.

    Neighbours in a picture are neighbours on the surface, so that this is more even than any at
    random, and faster read.
    """
    starts = np.arange(many + 1) * there // max(many, 1)
    random = generator(seed, "blue candidates").random(many)
    return np.asarray(starts[:-1] + (random * np.diff(starts)).astype(np.int64), np.int32)
