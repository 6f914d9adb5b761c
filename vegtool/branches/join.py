"""Joins every tube to the tube that it grows from: the nearest thicker one.

Nearest is by the gap between the start of the axis and the other's surface, in start radii;
inside another tube, where the gap is nought, by how deep: generators start a branch on its
parent's axis. A tube that starts far from all wood, or beside another's foot, is a trunk.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.axes import Axes, tree_of
from vegtool.branches.skeleton import Skeleton
from vegtool.branches.tubes import Tubes

NEIGHBOURS = 24  # samples looked at in each class of thickness
THINNER = 0.8  # a parent is at least so thick where the branch begins, in the branch's radii
REACH = 3.0  # start radii: wider gaps are bridged only within REACH_FRACTION
REACH_FRACTION = 0.05  # of the plant's radius


def join_tubes(rings: Skeleton, tubes: Tubes, axes: Axes) -> np.ndarray:
    """(t,) parent tube of each tube, -1 for trunks. Never a cycle: parents rank before children
    by thickness at the start."""
    parent = np.where(tubes.fork >= 0, tubes.ring_tube[tubes.fork], -1)
    orphans = np.flatnonzero(tubes.fork < 0)
    if len(orphans) < 2:
        return parent
    root = root_tubes(parent)
    rank = np.empty(len(tubes), dtype=np.int64)
    thickness = rings.radius[tubes.start]
    rank[np.lexsort((np.arange(len(tubes)), -tubes.length, -thickness))] = np.arange(len(tubes))
    start = rings.center[tubes.start[orphans]]
    radius = np.maximum(thickness[orphans], np.finfo(float).eps)

    segment = _near_segments(start, axes)
    distance, there, along = axes.measure(start, segment)
    host = axes.tube[segment]
    allowed = rank[root[host]] < rank[orphans, None]
    gap = np.maximum(distance - there, 0)
    depth = np.minimum(distance / np.maximum(there, np.finfo(float).eps), 1)
    thin = np.maximum(THINNER - there / radius[:, None], 0)
    foot = (along <= 0) & (tubes.fork[host] < 0) & (distance > there)
    allowed &= ~foot
    allowed &= gap <= np.maximum(REACH * radius, REACH_FRACTION)[:, None]
    cost = np.where(allowed, gap / radius[:, None] + depth + thin, np.inf)
    best = cost.argmin(axis=1)
    row = np.arange(len(orphans))
    found = np.isfinite(cost[row, best])
    parent[orphans[found]] = host[row, best][found]
    return parent


def root_tubes(parent: np.ndarray) -> np.ndarray:
    """(t,) the tube at which the parents of each tube end."""
    root = np.where(parent >= 0, parent, np.arange(len(parent)))
    while True:
        further = root[root]
        if np.array_equal(further, root):
            return np.asarray(root)
        root = further


def _near_segments(points: FloatArray, axes: Axes) -> np.ndarray:
    """(n, k) segments near the points, of every thickness: one search per octave of radius, for
    a thick tube's axis may lie behind many thin ones."""
    samples, segment = axes.samples
    radius = np.maximum(axes.radius_a, axes.radius_b)[segment]
    octave = np.floor(np.log2(np.maximum(radius, 2.0**-20))).astype(np.int64)
    found = []
    for value in np.unique(octave):
        rows = np.flatnonzero(octave == value)
        k = min(NEIGHBOURS, len(rows))
        near = tree_of(samples[rows]).query(points, k=k)[1].reshape(len(points), k)
        found.append(segment[rows[near]])
    return np.concatenate(found, axis=1)
