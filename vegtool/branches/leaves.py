"""Hangs every leaf part on the tube that carries it.

A leaf's anchor is the midpoint of one of its edges, the one at which the card is attached: of all
of them, the one nearest to wood. A leaf part too large for one branch (a crown modelled as one
blob) goes face by face.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.axes import Axes, tree_of
from vegtool.branches.parts import Parts

NEIGHBOURS = 3  # axis samples looked at for each anchor
BLOB = 0.3  # of the plant's radius: a leaf part whose radius is larger goes face by face
DEPTH = 0.1  # inside wood, a tenth of the distance to the axis counts


def hang_leaves(parts: Parts, axes: Axes) -> np.ndarray:
    """(f,) tube of each face of the leaf parts."""
    owner = _owners(parts)
    corners = parts.positions[parts.faces]
    anchors = (corners + np.roll(corners, -1, axis=1)).reshape(-1, 3) / 2
    tube, cost = nearest_tubes(anchors, axes)
    count = int(owner.max()) + 1
    of = np.repeat(owner, 3)
    order = np.lexsort((cost, of))
    best = order[np.searchsorted(of[order], np.arange(count))]
    return np.asarray(tube[best][owner])


def nearest_tubes(points: FloatArray, axes: Axes) -> tuple[np.ndarray, FloatArray]:
    """(n,) the tube nearest to each point, and the cost of it: the gap to the surface."""
    samples, segment_of = axes.samples
    k = min(NEIGHBOURS, len(samples))
    near = tree_of(samples).query(points, k=k)[1].reshape(len(points), k)
    segment = segment_of[near]
    distance, radius, _ = axes.measure(points, segment)
    cost = np.maximum(distance - radius, 0) + DEPTH * distance
    best = cost.argmin(axis=1)
    row = np.arange(len(points))
    return axes.tube[segment[row, best]], cost[row, best]


def _owners(parts: Parts) -> np.ndarray:
    """(f,) dense labels of what goes together: a part, or a single face of a blob."""
    low = np.full((parts.count, 3), np.inf)
    high = np.full((parts.count, 3), -np.inf)
    np.minimum.at(low, parts.vertex_part, parts.positions)
    np.maximum.at(high, parts.vertex_part, parts.positions)
    blob = np.linalg.norm(high - low, axis=1) / 2 > BLOB
    label = np.where(
        blob[parts.face_part], parts.count + np.arange(len(parts.faces)), parts.face_part
    )
    return np.asarray(np.unique(label, return_inverse=True)[1])
