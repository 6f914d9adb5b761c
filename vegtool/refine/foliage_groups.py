"""Leaves in groups of equal weight that are near each other, look one way and have one colour.

Groups are halved until there are as many as are wanted, across the direction in which they spread
most, at that leaf which parts their weight as their numbers of groups (cf. Wu: Color quantization
by dynamic programming and principal analysis, 1992).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray

Ints = npt.NDArray[np.int64]

ORIENTATION = 0.5
COLOR = 0.5


def mean_of(values: FloatArray, weight: FloatArray, group: Ints, count: int) -> FloatArray:
    """(count, d) weighted means of values (n, d); 0 for groups without any."""
    total = np.bincount(group, weight, count)
    sums = np.stack([np.bincount(group, weight * column, count) for column in values.T], axis=1)
    return np.asarray(sums / np.where(total > 0, total, 1.0)[:, None])


def grouped(
    middle: FloatArray, normal: FloatArray, color: FloatArray, weight: FloatArray, count: int
) -> Ints:
    """(n,) labels 0 to count - 1 of n leaves, n >= count."""
    size = np.sqrt(weight.sum() / count)
    root2 = np.sqrt(2)
    x, y, z = normal.T
    tensor = np.stack([x * x, y * y, z * z, root2 * x * y, root2 * x * z, root2 * y * z], axis=1)
    feature = np.concatenate([middle, ORIENTATION * size * tensor, COLOR * size * color], axis=1)
    group = np.zeros(len(weight), dtype=np.int64)
    wanted = np.array([count])
    while (wanted > 1).any():
        group, wanted = _halved(feature, weight, group, wanted)
    return group


def _halved(
    feature: FloatArray, weight: FloatArray, group: Ints, wanted: Ints
) -> tuple[Ints, Ints]:
    """The groups of which several are wanted in two, as equal as can be."""
    count = len(wanted)
    away = feature - mean_of(feature, weight, group, count)[group]
    axis = mean_of(away**2, weight, group, count)
    along = np.eye(feature.shape[1])[axis.argmax(axis=1)]
    for _ in range(2):
        part = (away * along[group]).sum(axis=1)
        sums = np.stack([np.bincount(group, weight * part * c, count) for c in away.T], axis=1)
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        along = np.where(length > 0, sums / np.where(length > 0, length, 1.0), along)
    part = (away * along[group]).sum(axis=1)
    order = np.lexsort((part, group))
    g = group[order]
    size = np.bincount(group, minlength=count)
    first = np.cumsum(size) - size
    reached = np.cumsum(weight[order])
    before = np.append(0.0, reached)[first]
    total = np.bincount(group, weight, count)
    share = (reached - weight[order] / 2 - before[g]) / total[g]
    low = wanted // 2
    nth = np.arange(len(g)) - first[g]
    # neither half may have fewer leaves than groups are wanted of it
    upper = (share >= (low / wanted)[g]) & (nth >= low[g])
    upper |= nth >= (size - (wanted - low))[g]
    upper &= (wanted > 1)[g]
    new_index = np.cumsum(np.where(wanted > 1, 2, 1)) - np.where(wanted > 1, 2, 1)
    result = np.empty_like(group)
    result[order] = new_index[g] + upper
    both = np.stack([low, wanted - low], axis=1)
    flat = np.where((wanted > 1)[:, None], both, np.stack([wanted, -np.ones_like(wanted)], axis=1))
    flat = flat.ravel()
    return result, flat[flat >= 0]
