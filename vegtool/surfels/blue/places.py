"""Points among which distances are measured: positions, and normals as far as a weight says.

The normal as further coordinates is as in Eppstein, Har-Peled, Sidiropoulos: Approximate greedy
clustering and distance selection for graph metrics (2015) any metric is; Brandt et al., section 6,
leave it open.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, checked
from vegtool.errors import UsageError


def places(
    positions: FloatArray, normals: FloatArray | None = None, normal_weight: float = 0.0
) -> FloatArray:
    """(n, 3) positions, or (n, 6) with normals, metres.

    positions: (n, 3) metres. normals: (n, 3) unit. normal_weight: metres, what a unit of difference
    of normals counts as: two sides are 2 normal_weight apart. Raises ValueError where arrays are no
    such, and UsageError where the weight is negative or has no normals to weigh.
    """
    positions = checked("positions", positions, (None, 3), np.float64)
    if not (normal_weight >= 0 and np.isfinite(normal_weight)):
        raise UsageError(f"normal weight: expected metres, zero or more; got {normal_weight}")
    if normal_weight > 0 and normals is None:
        raise UsageError(f"normal weight: expected normals to weigh by {normal_weight} m; got none")
    if normals is None or normal_weight == 0:
        return positions
    normals = checked("normals", normals, (len(positions), 3), np.float64)
    return np.hstack([positions, normals * normal_weight])


def asked(count: int, there: int) -> int:
    """How many points an order has: as many as asked, or all. Raises UsageError below zero."""
    if count < 0:
        raise UsageError(f"points: expected zero or more; got {count:,}")
    return min(count, there)
