"""Moves on a partition of weighted points: split, merge, move to the nearest mean, fill up.

Error means the weighted sum of squared distances to the cluster's mean. Points are pairwise
different, labels compact. Sums run by bincount, in the order of the points: the result does not
depend on threads.

Sources: splitting after Su and Dy, "In search of deterministic methods for initializing K-means"
(2007, Var-Part), but many clusters per round; merging after Ward, "Hierarchical grouping to
optimize an objective function" (1963), among near neighbours; moving after Lloyd (1982).
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.clustering.features import Labels

NEIGHBOURS = 8  # means next to a mean that it may merge with
MANY = 4096  # clusters: beyond, each has few points, and two rounds of anything are enough


def means(points: FloatArray, weights: FloatArray, labels: Labels) -> tuple[FloatArray, FloatArray]:
    """(k, d) mean and (k,) weight of every cluster."""
    mass: FloatArray = np.bincount(labels, weights).astype(np.float64)
    sums = [np.bincount(labels, weights * column) for column in points.T]
    return np.stack(sums, axis=1) / mass[:, None], mass


def error(points: FloatArray, weights: FloatArray, labels: Labels) -> float:
    """Weighted sum of squared distances of the points to their cluster's mean (inertia)."""
    center, _ = means(points, weights, labels)
    return float(weights @ ((points - center[labels]) ** 2).sum(axis=1))


def split(points: FloatArray, weights: FloatArray, labels: Labels, count: int) -> Labels:
    """Split until there are `count` clusters, those with the largest error first.

    Each is cut at its mean, across the axis along which it varies most; a round cuts the worst
    half of the clusters at once.
    """
    k = int(labels.max()) + 1
    while k < count:
        center, _ = means(points, weights, labels)
        labels = cut(points - center[labels], weights, labels, min(count - k, (k + 1) // 2))
        before, k = k, int(labels.max()) + 1
        if k == before:  # the worst clusters are single points, or all but
            return fill(points, weights, labels, count)
    return labels


def cut(
    offset: FloatArray,
    weights: FloatArray,
    labels: Labels,
    worst: int,
    cost: FloatArray | None = None,
) -> Labels:
    """Cut the `worst` clusters with the largest error, or `cost` (k,), in two, each at its mean.

    offset: (n, d) points relative to their cluster's mean, in any frame of the cluster's; the cut
    lies across the axis along which the cluster varies most.
    """
    k = int(labels.max()) + 1
    variance = np.stack([np.bincount(labels, weights * column**2) for column in offset.T], axis=1)
    cost = variance.sum(axis=1) if cost is None else cost
    chosen = np.argsort(-cost, kind="stable")[:worst]
    new = np.full(k, -1)
    new[chosen] = k + np.arange(len(chosen))
    side = offset[np.arange(len(offset)), variance.argmax(axis=1)[labels]] > 0
    return compacted(np.where(side & (new[labels] >= 0), new[labels], labels))


def merge(points: FloatArray, weights: FloatArray, labels: Labels, count: int) -> Labels:
    """Merge until there are `count` clusters: the neighbours that add the least error first.

    A round merges disjoint pairs (`pairs_per_round`) and then looks again.
    """
    from scipy.spatial import cKDTree

    k = int(labels.max()) + 1
    while k > count:
        center, mass = means(points, weights, labels)
        distance, near = cKDTree(center).query(center, k=min(NEIGHBOURS + 1, k))
        a = np.repeat(np.arange(k), near.shape[1])  # itself too, which disjoint_pairs skips
        b, squared = near.ravel(), distance.ravel() ** 2
        added = squared * mass[a] * mass[b] / (mass[a] + mass[b])
        order = np.argsort(added, kind="stable")
        into = disjoint_pairs(a[order], b[order], k, limit=pairs_per_round(k, count))
        labels = compacted(into[labels])
        k = int(labels.max()) + 1
    return labels


def rounds_for(count: int, rounds: int) -> int:
    """`rounds`, but at most two for MANY clusters."""
    return rounds if count <= MANY else min(rounds, 2)


def pairs_per_round(k: int, count: int) -> int:
    """Half of the surplus; all of it where that is a few among many, which hardly interact."""
    surplus = k - count
    return surplus if surplus <= count // 64 else (surplus + 1) // 2


def disjoint_pairs(a: Labels, b: Labels, k: int, limit: int) -> Labels:
    """(k,) which cluster each merges into: the first `limit` pairs that share no cluster."""
    into = np.arange(k)
    free = np.ones(k, dtype=bool)
    taken = 0
    for i, j in zip(a.tolist(), b.tolist(), strict=True):
        if i != j and free[i] and free[j]:
            free[i] = free[j] = False
            into[max(i, j)] = min(i, j)
            taken += 1
            if taken == limit:
                break
    return into


def lloyd(
    points: FloatArray, weights: FloatArray, labels: Labels, rounds: int, count: int
) -> Labels:
    """Move every point to the nearest mean, `rounds` times or until nothing moves.

    Clusters that run empty are filled again, so that `count` remain.
    """
    for _ in range(rounds):
        center, _ = means(points, weights, labels)
        moved = fill(points, weights, compacted(nearest(points, center)), count)
        if np.array_equal(moved, labels):
            break
        labels = moved
    return labels


def nearest(points: FloatArray, center: FloatArray) -> Labels:
    """(n,) index of the nearest centre."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(center).query(points)[1])


def fill(points: FloatArray, weights: FloatArray, labels: Labels, count: int) -> Labels:
    """Up to `count` clusters: the costliest point of each of the costliest becomes its own."""
    k = int(labels.max()) + 1
    count = min(count, len(points))
    while k < count:
        center, _ = means(points, weights, labels)
        cost = weights * ((points - center[labels]) ** 2).sum(axis=1)
        cost[np.bincount(labels)[labels] == 1] = -1.0  # a single point stays
        order = np.lexsort((-cost, labels))
        worst = order[np.r_[True, np.diff(labels[order]) != 0]]  # one point per cluster
        worst = worst[cost[worst] >= 0]
        worst = worst[np.argsort(-cost[worst], kind="stable")][: count - k]
        labels = labels.copy()
        labels[worst] = k + np.arange(len(worst))
        k += len(worst)
    return labels


def compacted(labels: Labels) -> Labels:
    """The same partition with labels 0..k-1, in the order of the old ones."""
    used = np.bincount(labels) > 0
    return np.asarray((np.cumsum(used) - 1)[labels])
