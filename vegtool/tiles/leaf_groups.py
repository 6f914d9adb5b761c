"""The leaves of a square in groups that are near each other, many and in little time.

As refine/foliage_groups.py for a plant. A square is wide, and its groups lie apart by where they
stand before they do by how they look: leaves are halved by place alone, across the longer side of
their box (Bentley: Multidimensional binary search trees used for associative searching, 1975), and
settle by place, look and colour (Lloyd: Least squares quantization in PCM, 1982) block by block.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.refine.foliage import Leaves
from vegtool.refine.foliage_groups import ORIENTATION, Ints, features_of, labels_of, parted, settled

ROUNDS = 2
"""Of means and moves. With 4 a square of 65,536 triangles errs as much (FLIP)."""
BLOCK = 256
"""Groups that leaves settle among: few enough to stay in a processor's cache."""
ALMOST_ONE = 1 - 2.0**-20
"""The greatest place along a group's box, of which the group's number tells it apart."""


def leaf_groups(leaves: Leaves, count: int, pixel: float, orientation: float = ORIENTATION) -> Ints:
    """(n,) labels 0 to at most count - 1 of n leaves, each of which some leaf has; no more than
    there are leaves. pixel: what one covers, in radii; what is nearer than that is in one place.
    orientation: as of refine/foliage_groups.py."""
    count = min(count, len(leaves))
    weight = leaves.weight
    size = max(float(np.sqrt(weight.sum() / count)), pixel)
    order, first = by_place(leaves.middle, weight, count)
    label = labels_of(order, first)
    ends = np.append(first, len(order))
    result = np.empty_like(label)
    found = 0
    for start in range(0, count, BLOCK):
        stop = min(start + BLOCK, count)
        own = order[ends[start] : ends[stop]]
        look = leaves.normal[own], leaves.shading[own], leaves.color[own]
        features = features_of(leaves.middle[own], *look, size, orientation).astype(np.float32)
        group = settled(features, weight[own], label[own] - start, stop - start, ROUNDS)  # type: ignore[arg-type]
        result[own] = group + found
        found += int(group.max()) + 1
    return result


def by_place(place: FloatArray, weight: FloatArray, count: int) -> tuple[Ints, Ints]:
    """The order (n,) in which points (n, 3) lie group by group, and where each of `count` groups
    begins; as heavy as each other, as nearly as halving can make them."""
    order = np.arange(len(place))
    first, wanted = np.array([0]), np.array([count])
    while (wanted > 1).any():
        points, mass = place[order], weight[order]
        group = np.repeat(np.arange(len(first)), np.diff(first, append=len(order)))
        low = np.minimum.reduceat(points, first)
        side = np.maximum.reduceat(points, first) - low
        axis = side.argmax(axis=1)
        longest = np.maximum(side.max(axis=1), np.finfo(float).tiny)
        along = (points - low[group])[np.arange(len(points)), axis[group]] / longest[group]
        # one key sorts faster than two; halves of a group stay in it
        moved = np.argsort(group + np.minimum(along, ALMOST_ONE), kind="stable")
        total = np.add.reduceat(mass, first)
        first, wanted = parted(mass[moved], total, first, wanted)
        order = order[moved]
    return order, first
