"""Clusters along the branches: Colditz, Coconu, Deussen and Hege (2005), section 2.

"In dependence to the desired total number of billboards a branching level is determined which is
completely covered by a set of billboards including all subbranches." So: the deepest level at which
one cluster per branch fits the count; a branch of that level brings all its descendants, and one
above it its own faces (`covered_level`).

The next level seldom fits exactly, and the paper leaves the rest of the count unused
(`strict_level`). Here it is spent, so that methods compare at equal budget: the clusters with the
largest error are opened into their sub-branches first (`open_branches`), then cut by k-means inside
the cluster, which never joins parts of two of them (`kmeans.settle`).
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.clustering import ClusterOptions
from vegtool.clustering.features import coarse, face_features, face_weights, samples, spread_to
from vegtool.clustering.kmeans import CELLS, settle
from vegtool.clustering.partition import compacted, merge
from vegtool.plant import Branches, Plant
from vegtool.progress import Progress


def branches(
    plant: Plant, count: int, options: ClusterOptions, seed: int, progress: Progress
) -> IntArray:
    """(f,) int32 labels of at most `count` clusters, none across two branches if count allows."""
    from vegtool.branches import branches_of

    known = plant.branches or branches_of(plant)
    level = covered_level(known, count)
    if not options.strict_level:
        owner = open_branches(plant, known, level, count, options.orientation_weight)
    else:
        owner = known.ancestor_at(level)
    group = compacted(owner[known.face_branch].astype(np.int64))
    covered = int(group.max()) + 1
    if covered == count or (covered < count and options.strict_level):
        return group.astype(np.int32)
    fine = samples(plant, options.orientation_weight, count, group)
    few = coarse(fine, max(CELLS, 8 * count), group)
    of_point = spread_to(few.of_face, group)
    if covered > count:  # more trunks than clusters
        labels = merge(few.points, few.weights, of_point, count)
    else:
        labels = settle(few, of_point, count, of_point)
    return labels[few.of_face].astype(np.int32)


def covered_level(known: Branches, count: int) -> int:
    """The deepest level at which one cluster per branch fits `count`; 0 if none does.

    A branch of that level brings all its descendants, one above it its own faces.
    """
    for level in range(int(known.level.max(initial=0)), 0, -1):
        if len(np.unique(known.ancestor_at(level)[known.face_branch])) <= count:
            return level
    return 0


def open_branches(
    plant: Plant, known: Branches, level: int, count: int, orientation_weight: float
) -> IntArray:
    """(b,) branch whose cluster each branch belongs to, as `ancestor_at(level)`, then opened.

    The cluster with the largest error becomes its branch's own faces and one cluster per child;
    and so on, until the next one would exceed `count`.
    """
    owner = known.ancestor_at(level)
    used = np.bincount(known.face_branch, minlength=len(known)) > 0
    error, faces = subtree_error(plant, known, orientation_weight)
    children: list[list[int]] = [[] for _ in range(len(known))]
    for branch in np.flatnonzero((faces > 0) & (known.parent >= 0)).tolist():
        children[known.parent[branch]].append(branch)
    left = count - len(np.unique(owner[known.face_branch]))
    queue = [(-float(error[b]), b) for b in np.flatnonzero(known.level == level).tolist()]
    queue = [(e, b) for e, b in queue if children[b]]
    heapify(queue)
    while queue:
        _, branch = heappop(queue)
        left -= len(children[branch]) - 1 + int(used[branch])
        if left < 0:
            break
        inside = (owner == branch) & (known.level > known.level[branch])
        owner = np.where(inside, known.ancestor_at(int(known.level[branch]) + 1), owner)
        for child in children[branch]:
            if children[child]:
                heappush(queue, (-float(error[child]), child))
    return owner


def subtree_error(
    plant: Plant, known: Branches, orientation_weight: float
) -> tuple[FloatArray, IntArray]:
    """(b,) error of the cluster that each branch makes with all its descendants, and its faces."""
    points = face_features(plant, orientation_weight)
    weights = face_weights(plant)
    columns = [weights, *(weights * c for c in points.T), weights * (points**2).sum(axis=1)]
    columns.append(np.ones(len(points)))
    sums = np.stack([np.bincount(known.face_branch, c, len(known)) for c in columns], axis=1)
    for level in range(int(known.level.max(initial=0)), 0, -1):
        here = known.level == level
        np.add.at(sums, known.parent[here], sums[here])
    mass = np.where(sums[:, 0] > 0, sums[:, 0], 1.0)
    return sums[:, -2] - (sums[:, 1:-2] ** 2).sum(axis=1) / mass, sums[:, -1].astype(np.int32)
