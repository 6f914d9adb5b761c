"""Values of early points as means over what they stand for.

Brandt et al., section 6, have single pixels as surfels, so that the first of an order may be
outliers. Here each of them gets the mean of the candidates that it is the nearest of in the prefix
by which it has come, of prefixes of doubling length.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.surfels.blue.places import drawn, places

LONGEST = 4096
"""Points of the longest prefix of which values are means."""
MEANT = 32
"""Candidates for each point of a prefix, of which values are means."""


def averaged(
    positions: FloatArray,
    values: FloatArray,
    order: IntArray,
    *,
    normals: FloatArray | None = None,
    normal_weight: float = 0.0,
) -> FloatArray:
    """(k, c) values of the points of an order, (k,) int32 of n candidates.

    positions: (n, 3) metres. values: (n, c), of linear colours, say, or of normals, which are to be
    made unit again. normals, normal_weight: as the order was made. Means are over some candidates,
    always the same; a point that none of them is nearest to keeps its value.
    """
    at = places(positions, normals, normal_weight)
    values = checked("values", values, (len(at), None), np.float64)
    order = checked("order", order, (None,), np.int32, below=len(at))
    result = values[order]
    from scipy.spatial import cKDTree

    length = min(LONGEST, 1 << (len(order) - 1).bit_length()) if len(order) else 0
    while length > 0:  # the longest first: early points are in all, and the shortest is to count
        prefix = order[:length]
        some = drawn(len(at), min(MEANT * length, len(at)), length)
        of = cKDTree(at[prefix]).query(at[some])[1]
        many = np.bincount(of, minlength=len(prefix))
        sums = [np.bincount(of, column, len(prefix)) for column in values[some].T]
        meant = many > 0
        result[: len(prefix)][meant] = np.stack(sums, axis=1)[meant] / many[meant, None]
        length //= 2
    return np.asarray(result)
