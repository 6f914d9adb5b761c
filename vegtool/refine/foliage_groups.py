"""Leaves in groups that are near each other, look one way and have one colour.

Groups are halved until there are as many as are wanted, across the direction in which they spread
most, at that leaf which parts their weight as their numbers of groups (cf. Wu: Color quantization
by dynamic programming and principal analysis, 1992). Then every leaf goes to the group whose mean
is nearest, in turn with the means (Lloyd: Least squares quantization in PCM, 1982).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, unit

Ints = npt.NDArray[np.int64]

ORIENTATION = 2.0
"""Sides of a group's own square for which leaves may lie apart if they look the same way, rather
than at right angles. Of 1, 2, 3 and 5 it gave the least FLIP of four plants, or nearly."""
COLOR = 0.5
"""The same for black beside white."""
ROUNDS = 4
"""Of means and moves."""
TURNS = 2
"""Steps towards the direction of greatest spread, from the axis with the greatest one."""


def mean_of(values: FloatArray, weight: FloatArray, group: Ints, count: int) -> FloatArray:
    """(count, d) weighted means of values (n, d); 0 for groups without any."""
    total = np.bincount(group, weight, count)
    columns = [np.bincount(group, weight * column, count) for column in values.T]
    return np.stack(columns, axis=1) / np.where(total > 0, total, 1.0)[:, None]


def grouped(
    middle: FloatArray,
    normal: FloatArray,
    shading: FloatArray,
    color: FloatArray,
    weight: FloatArray,
    count: int,
    pixel: float,
) -> Ints:
    """(n,) labels 0 to count - 1 of n leaves, n >= count, each of which some leaf has.

    middle, normal, shading, color: (n, 3). A leaf that lies the other way round, both its
    normals turned, looks the same: the tensor of both does not tell. weight: (n,) area, in
    square units of the middles. pixel: what one covers, in their units; what is nearer than that
    is in one place.
    """
    size = max(float(np.sqrt(weight.sum() / count)), pixel)
    features = features_of(middle, normal, shading, color, size)
    return settled(features, weight, split(features, weight, count), count)


def features_of(
    middle: FloatArray,
    normal: FloatArray,
    shading: FloatArray,
    color: FloatArray,
    size: float,
    orientation: float = ORIENTATION,
) -> FloatArray:
    """(n, 15) what leaves are grouped by, all (n, 3); size: side of the square that a group covers,
    or of a pixel where that is larger."""
    looks = (normal[:, :, None] * shading[:, None]).reshape(-1, 9)
    return np.concatenate([middle, orientation * size * looks, COLOR * size * color], axis=1)


def split(features: FloatArray, weight: FloatArray, count: int) -> Ints:
    """(n,) groups by halving."""
    order = np.arange(len(weight))
    first, wanted = np.array([0]), np.array([count])
    while (wanted > 1).any():
        moved, first, wanted = halved(features[order], weight[order], first, wanted)
        order = order[moved]
    return labels_of(order, first)


def labels_of(order: Ints, first: Ints) -> Ints:
    """(n,) groups of which each begins at `first`, (k,), of the order (n,)."""
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.repeat(np.arange(len(first)), np.diff(first, append=len(order)))
    return group


def halved(
    features: FloatArray, weight: FloatArray, first: Ints, wanted: Ints
) -> tuple[Ints, Ints, Ints]:
    """Groups in two where several are wanted: the order (n,) in which halves lie one after the
    other, as groups do now, where each begins, and how many it is to become.

    first: (k,) where groups begin. wanted: (k,) how many each is to become, no more than it has
    leaves.
    """
    size = np.diff(first, append=len(weight))
    group = np.repeat(np.arange(len(first)), size)
    total = np.add.reduceat(weight, first)
    mean = np.add.reduceat(weight[:, None] * features, first) / total[:, None]
    away = features - mean[group]
    along = np.einsum("nd,nd->n", away, widest(away, weight, first, group)[group])
    order = np.lexsort((along, group))
    return order, *parted(weight[order], total, first, wanted)


def parted(mass: FloatArray, total: FloatArray, first: Ints, wanted: Ints) -> tuple[Ints, Ints]:
    """Where halves of groups begin, and how many groups each is to become.

    mass: (n,) weights of leaves, those of a group in the order in which they are parted. total:
    (k,) of each group. first, wanted: (k,) as of `halved`.
    """
    size = np.diff(first, append=len(mass))
    group = np.repeat(np.arange(len(first)), size)
    reached = np.cumsum(mass)
    before = np.append(0.0, reached)[first]
    share = (reached - mass / 2 - before[group]) / total[group]
    low, nth = wanted // 2, np.arange(len(group)) - first[group]
    # neither half gets fewer leaves than groups are wanted of it
    lower = (share < (low / wanted)[group]) & (nth < (size - wanted + low)[group])
    cut = np.where(wanted > 1, np.maximum(np.add.reduceat(lower, first, dtype=np.int64), low), 0)
    begin = np.stack([first, first + cut], axis=1)
    halves = np.stack([low, wanted - low], axis=1)
    return begin[halves > 0], halves[halves > 0]


def widest(away: FloatArray, weight: FloatArray, first: Ints, group: Ints) -> FloatArray:
    """(k, d) about the unit direction in which what is away from its group's mean, (n, d), spreads
    most: TURNS steps of power iteration."""
    axis = np.add.reduceat(weight[:, None] * away**2, first).argmax(axis=1)
    direction = np.eye(away.shape[1])[axis]
    for _ in range(TURNS):
        pull = weight * np.einsum("nd,nd->n", away, direction[group])
        sums = np.add.reduceat(pull[:, None] * away, first)
        direction = np.where(np.any(sums, axis=1, keepdims=True), unit(sums), direction)
    return np.asarray(direction)


def settled(
    features: FloatArray, weight: FloatArray, group: Ints, count: int, rounds: int = ROUNDS
) -> Ints:
    """Groups (n,) made such that nearly every leaf is nearest to its own group's mean."""
    from scipy.spatial import cKDTree

    for _ in range(rounds if count < len(group) else 0):
        near = cKDTree(mean_of(features, weight, group, count)).query(features)[1]
        group = refilled(features, weight, np.unique(near, return_inverse=True)[1], count)
        if int(group.max()) + 1 < count:
            return group
    return group


def refilled(features: FloatArray, weight: FloatArray, group: Ints, count: int) -> Ints:
    """As many groups as there should be: those that spread most are halved, where some are lost."""
    found = int(group.max()) + 1
    if found == count:
        return group
    away = features - mean_of(features, weight, group, found)[group]
    spread = np.bincount(group, weight * np.einsum("nd,nd->n", away, away), found)
    several = np.bincount(group) > 1
    worst = np.argsort(np.where(several, -spread, 1.0), kind="stable")[: count - found]
    wanted = np.ones(found, dtype=np.int64)
    wanted[worst[several[worst]]] = 2
    order = np.argsort(group, kind="stable")
    first = np.searchsorted(group[order], np.arange(found))
    moved, first, _ = halved(features[order], weight[order], first, wanted)
    return labels_of(order[moved], first)
