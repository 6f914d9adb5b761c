"""Joins every tube to the tube that it grows from: the nearest thicker one.

Nearest is by the gap between the start of the axis and the other's surface, in start radii; inside
another tube, where the gap is nought, by how deep: generators start a branch on its parent's axis.
Being thicker only weighs in, for generators do make branches thicker than their parents. Two tubes
that start side by side are rather children of a third, or both trunks. The cheapest joins are made
first and none may close a circle. A tube that starts far from all wood is a trunk if it is long,
and grows from the nearest wood if not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.axes import Axes, tree_of
from vegtool.branches.skeleton import Skeleton
from vegtool.branches.tubes import Tubes

Finder = Callable[[FloatArray], np.ndarray]

BLOCK = 4096  # tubes joined at once, which bounds the memory
NEIGHBOURS = 24  # samples looked at in each class of thickness
HOSTS = 8  # of which so many tubes are kept
REACH = 3.0  # start radii: the widest gap that is bridged, or else
REACH_FRACTION = 0.02  # of the plant's radius
BESIDE = 0.5  # what it counts to start beside the host's own start: within its radius there
ASIDE = 2.0  # and so many times the gap
ON_AXIS = 1e-4  # of the host's radius: nearer to its axis, thinness and company count nothing
LOOSE = 0.25  # of the longest trunk: what is shorter is no trunk, but a branch that touches no wood
AT_START = 1e-6  # of the plant's radius: no tube grows from the very start of another


def join_tubes(rings: Skeleton, tubes: Tubes, axes: Axes) -> np.ndarray:
    """(t,) parent tube of each tube, -1 for trunks, without cycles."""
    parent = np.where(tubes.fork >= 0, tubes.ring_tube[tubes.fork], -1)
    orphans = np.flatnonzero(tubes.fork < 0)
    if len(orphans) < 2:
        return parent
    find = _finder(axes)
    blocks = [orphans[i : i + BLOCK] for i in range(0, len(orphans), BLOCK)]
    offers = [_offers(rings, tubes, axes, block, find) for block in blocks]
    child, host, cost, beside = (np.concatenate(column) for column in zip(*offers, strict=True))
    joined = _cheapest_forest(parent, root_tubes(parent), child, host, cost)
    fellow = np.zeros(len(tubes), dtype=bool)  # stands beside the foot of a trunk
    fellow[child[beside & (joined[child] == host) & (joined[host] < 0)]] = True
    return _gather_loose(np.where(fellow, -1, joined), tubes, axes)


def _gather_loose(parent: np.ndarray, tubes: Tubes, axes: Axes) -> np.ndarray:
    """Parents, where trunks that are short for this plant grow from the nearest wood of a tree
    whose trunk is not."""
    root = root_tubes(parent)
    trunk = root == np.arange(len(root))
    short = trunk & (tubes.length < LOOSE * tubes.length[trunk].max())
    samples, segment = axes.samples
    rows = np.flatnonzero(~short[root[axes.tube[segment]]])
    loose = np.flatnonzero(short)
    points = axes.b[tubes.start[loose]]
    gathered = parent.copy()
    gathered[loose] = axes.tube[segment[rows[tree_of(samples[rows]).query(points)[1]]]]
    return gathered


def root_tubes(parent: np.ndarray) -> np.ndarray:
    """(t,) the tube at which the parents of each tube end."""
    root = np.where(parent >= 0, parent, np.arange(len(parent)))
    while True:
        further = root[root]
        if np.array_equal(further, root):
            return np.asarray(root)
        root = further


def _offers(
    rings: Skeleton, tubes: Tubes, axes: Axes, orphans: np.ndarray, find: Finder
) -> tuple[np.ndarray, np.ndarray, FloatArray, np.ndarray]:
    """Possible joins, four arrays (o,): child, host, cost and whether they start side by side; at
    most HOSTS for each child."""
    start = rings.center[tubes.start[orphans]]
    radius = np.maximum(rings.radius[tubes.start[orphans]], np.finfo(float).eps)[:, None]
    segment = find(start)
    distance, thickness, along = axes.measure(start, segment)
    host = axes.tube[segment]
    gap = np.maximum(distance - thickness, 0)
    depth = np.minimum(distance / np.maximum(thickness, np.finfo(float).eps), 1)
    off_axis = depth > ON_AXIS
    thin = np.maximum(1 - thickness / radius, 0) * off_axis
    beside = (along < thickness + ASIDE * gap) & off_axis
    allowed = np.where(beside, gap <= 0, along > AT_START)
    allowed &= gap <= np.maximum(REACH * radius, REACH_FRACTION)
    row, column = np.nonzero(allowed)
    cost = (gap / radius + depth + thin + BESIDE * beside)[row, column]
    child, host, beside = orphans[row], host[row, column], beside[row, column]
    keep = _cheapest_hosts(child, host, cost)
    return child[keep], host[keep], cost[keep], beside[keep]


def _cheapest_hosts(child: np.ndarray, host: np.ndarray, cost: FloatArray) -> np.ndarray:
    """Indices of each child's HOSTS cheapest hosts, each once."""
    order = np.lexsort((cost, host, child))
    pair = np.stack([child[order], host[order]], axis=1)
    order = order[np.append(True, (pair[1:] != pair[:-1]).any(axis=1))[: len(order)]]
    order = order[np.lexsort((host[order], cost[order], child[order]))]
    first = np.searchsorted(child[order], child[order])
    return np.asarray(order[np.arange(len(order)) - first < HOSTS])


def _finder(axes: Axes) -> Finder:
    """A function from points (n, 3) to segments near them (n, k), of every thickness: one search
    per octave of radius, for a thick tube's axis may lie behind many thin ones."""
    samples, segment = axes.samples
    radius = np.maximum(axes.radius_a, axes.radius_b)[segment]
    octave = np.floor(np.log2(np.maximum(radius, 2.0**-20))).astype(np.int64)
    groups = [np.flatnonzero(octave == value) for value in np.unique(octave)]
    trees = [(tree_of(samples[rows]), segment[rows]) for rows in groups]

    def find(points: FloatArray) -> np.ndarray:
        found = []
        for tree, of in trees:
            k = min(NEIGHBOURS, len(of))
            found.append(of[tree.query(points, k=k)[1].reshape(len(points), k)])
        return np.concatenate(found, axis=1)

    return find


def _cheapest_forest(
    parent: np.ndarray, root: np.ndarray, child: np.ndarray, host: np.ndarray, cost: FloatArray
) -> np.ndarray:
    """Parents after the joins, cheapest first, of which none closes a circle."""
    above = root.tolist()  # of each tube some tube above it, finally its root

    def top(tube: int) -> int:
        while above[tube] != tube:
            above[tube] = above[above[tube]]
            tube = above[tube]
        return tube

    joined = parent.copy()
    order = np.lexsort((host, child, cost))
    for a, b in zip(child[order].tolist(), host[order].tolist(), strict=True):
        if joined[a] < 0 and top(b) != a:
            joined[a] = b
            above[a] = b
    return joined
