"""Values of points as means over what they stand for.

Brandt et al., section 6, have single pixels as surfels, so that the first of an order may be
outliers. Here each of them gets the mean of the candidates that it is the nearest of in the prefix
by which it has come, of prefixes of doubling length.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.surfels.blue.distances import spacing
from vegtool.surfels.blue.places import drawn, places

MEANT = 8
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
    made unit again. normals: (n, 3) unit. normal_weight: what a unit of difference of normals
    counts as, in distances between the points of a prefix. Means are over some candidates, always
    the same; a point that none of them is nearest to keeps its value.
    """
    positions = checked("positions", positions, (None, 3), np.float64)
    values = checked("values", values, (len(positions), None), np.float64)
    order = checked("order", order, (None,), np.int32, below=len(positions))
    result = values[order]
    from scipy.spatial import cKDTree

    apart = spacing(positions[order])
    length = 1 << (len(order) - 1).bit_length() if len(order) else 0
    while length > 0:  # the longest first: early points are in all, and the shortest is to count
        prefix = order[:length]
        some = drawn(len(positions), min(MEANT * length, len(positions)), length)
        weight = normal_weight * apart.radius(len(prefix))
        at, asked = (
            places(positions[rows], None if normals is None else normals[rows], weight)
            for rows in (prefix, some)
        )
        of = cKDTree(at).query(asked)[1]
        many = np.bincount(of, minlength=len(prefix))
        sums = [np.bincount(of, column, len(prefix)) for column in values[some].T]
        meant = many > 0
        result[: len(prefix)][meant] = np.stack(sums, axis=1)[meant] / many[meant, None]
        length //= 2
    return np.asarray(result)
