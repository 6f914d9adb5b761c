"""Clusters along the branches: Colditz, Coconu, Deussen and Hege (2005), section 2.

"In dependence to the desired total number of billboards a branching level is determined which is
completely covered by a set of billboards including all subbranches." So: the deepest level at which
one cluster per branch fits the count; a branch of that level brings all its descendants, and one
above it its own faces (`covered_level`).

That is `strict_level`, and it leaves the rest of the count unused. Otherwise the level is one that
is covered with PER_BRANCH clusters for each branch, and those that cost most are cut into lines
(`lines.py`) until the count is reached, never joining parts of two branches: "the clusters can be
oriented along the branches". Where no branching level is covered, the trunks' own wood still has
clusters of its own: mixed with what grows around it, it would be drawn on planes that stand across
it, in pieces.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import IntArray
from vegtool.clustering import ClusterOptions
from vegtool.clustering.features import coarse, samples, spread_to
from vegtool.clustering.lines import settle_lines
from vegtool.clustering.partition import compacted, merge
from vegtool.plant import Branches, Plant
from vegtool.progress import Progress

PER_BRANCH = 4  # clusters per branch, on average
PER_TRUNK = 2  # the same where trunks are told from what grows on them


def branches(
    plant: Plant, count: int, options: ClusterOptions, seed: int, progress: Progress
) -> IntArray:
    """(f,) int32 labels of at most `count` clusters, none across two branches if count allows."""
    from vegtool.branches import branches_of

    known = branches_of(plant)
    each = 1 if options.strict_level else PER_BRANCH
    level = covered_level(known, count // each)
    owner = known.ancestor_at(level)[known.face_branch].astype(np.int64)
    if level == 0 and not options.strict_level:
        own_wood = (known.level[known.face_branch] == 0) & ~plant.face_is_leaf
        apart = 2 * owner + own_wood
        owner = apart if len(np.unique(apart)) <= count // PER_TRUNK else owner
    group = compacted(owner)
    covered = int(group.max()) + 1
    if covered == count or (covered < count and options.strict_level):
        return group.astype(np.int32)
    few = coarse(samples(plant, options.line_scale(count), count, group), count, group)
    of_point = spread_to(few.of_face, group)
    if covered > count:  # more trunks than clusters
        labels = merge(few.points, few.weights, of_point, count)
    else:
        labels = settle_lines(few, of_point, count, options.elongation, of_point, progress)
    return labels[few.of_face].astype(np.int32)


def covered_level(known: Branches, count: int) -> int:
    """The deepest level at which one cluster per branch fits `count`; 0 if none does.

    A branch of that level brings all its descendants, one above it its own faces.
    """
    for level in range(int(known.level.max(initial=0)), 0, -1):
        if len(np.unique(known.ancestor_at(level)[known.face_branch])) <= count:
            return level
    return 0
