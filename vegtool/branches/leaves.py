"""Hangs every leaf part on the tube that carries it.

A leaf's anchor is the midpoint of one of its edges, the one at which the card is attached. A
generator makes all leaves alike, so it is the same edge in all of them, counted as the file shows
it: the one that is nearest to wood in most. Where several share that (the file's order is lost, or
leaves differ), each leaf takes the nearest of these. A leaf part too large for one branch (a crown
modelled as one blob) goes face by face.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.axes import Axes
from vegtool.branches.order import follow_order
from vegtool.branches.parts import Parts

BLOB = 0.3  # of the plant's radius: a leaf part whose radius is larger goes face by face
OFTEN = 0.5  # of the most frequent one: edges nearest to wood so often may be the attached one
ASKED = 1000  # leaves of each number of faces that are asked which edge that is
MOST_FACES = 24  # of a leaf whose edges are compared with those of others


def hang_leaves(parts: Parts, axes: Axes) -> np.ndarray:
    """(f,) tube of each face of the leaf parts."""
    owner = _owners(parts)
    corners = parts.positions[parts.faces]
    anchors = ((corners + np.roll(corners, -1, axis=1)) / 2).reshape(-1, 3)
    leaf = np.repeat(owner, 3)
    rows = np.flatnonzero(_attached(owner, anchors, axes))
    tube, cost = axes.nearest_tubes(anchors[rows])
    order = np.lexsort((cost, leaf[rows]))
    best = order[np.searchsorted(leaf[rows][order], np.arange(int(owner.max()) + 1))]
    return np.asarray(follow_order(anchors[rows[best]], tube[best], cost[best], axes)[owner])


def _attached(owner: np.ndarray, anchors: FloatArray, axes: Axes) -> np.ndarray:
    """(3f,) bool: edges that may be the attached one, told by leaves of one number of faces."""
    size = np.bincount(owner)
    order = np.argsort(owner, kind="stable")
    nth = np.empty(len(owner), dtype=np.int64)
    nth[order] = np.arange(len(owner)) - np.repeat(np.cumsum(size) - size, size)
    slot = (3 * nth[:, None] + np.arange(3)).ravel()
    faces_of = np.repeat(size[owner], 3)
    may = np.ones(len(anchors), dtype=bool)
    for faces in np.unique(size[size <= MOST_FACES]):
        leaves = np.flatnonzero(size == faces)
        asked = np.zeros(len(size), dtype=bool)
        asked[leaves[:: -(-len(leaves) // ASKED)]] = True
        rows = order[asked[owner[order]]]  # leaf by leaf, each face by face
        edges = (3 * rows[:, None] + np.arange(3)).ravel()
        cost = axes.nearest_tubes(anchors[edges])[1].reshape(-1, 3 * faces)
        wins = np.bincount(cost.argmin(axis=1), minlength=3 * faces)
        rows = np.flatnonzero(faces_of == faces)
        may[rows] = (wins >= OFTEN * wins.max())[slot[rows]]
    return may


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
