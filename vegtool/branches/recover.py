"""Branches from bare geometry: triangle order, connectivity, texture seams and materials.

Colditz et al. 2005, "Real-time Rendering of Complex Photorealistic Landscapes Using Hybrid
Level-of-Detail Approaches", section 2, take the branches from the file's order and tell wood from
leaves by texture. Few files keep that order, so here geometry speaks first: wood falls into parts
(parts.py), parts into rings (skeleton.py), rings into tubes (tubes.py); tubes grow from tubes
(join.py) and carry leaves (leaves.py). Nothing depends on place, size or direction of the plant.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.axes import axes_of
from vegtool.branches.join import join_tubes
from vegtool.branches.leaves import hang_leaves
from vegtool.branches.parts import Parts, connected_parts
from vegtool.branches.skeleton import skeleton
from vegtool.branches.tubes import cut_tubes
from vegtool.plant import Branches, Plant
from vegtool.progress import Progress, silent

_recovered: WeakKeyDictionary[Plant, Branches] = WeakKeyDictionary()
"""Of plants that are still in use: every level of a chain asks."""


def branches_of(plant: Plant, progress: Progress = silent) -> Branches:
    """What the file declares of its branches, else what can be recovered, once for each plant."""
    if plant.branches is not None:
        return plant.branches
    if plant not in _recovered:
        _recovered[plant] = recover_branches(plant, progress)
    return _recovered[plant]


def recover_branches(plant: Plant, progress: Progress = silent) -> Branches:
    """The branches of a plant from its geometry alone; what the file declares is not looked at.

    Works on every plant: one without wood has a bare trunk and a branch for each connected part.
    """
    positions = _unit_positions(plant)
    leaf = plant.face_is_leaf
    progress("branches", 0.0)
    if leaf.all():
        return _without_wood(connected_parts(positions, plant.faces.astype(np.int64)))
    wood = connected_parts(positions, plant.faces[~leaf].astype(np.int64))
    rings = skeleton(wood)
    tubes = cut_tubes(rings)
    axes = axes_of(rings, tubes)
    progress("branches", 0.3)
    parent = join_tubes(rings, tubes, axes)
    progress("branches", 0.5)
    face_tube = np.empty(len(leaf), dtype=np.int64)
    ring = rings.vertex_ring[wood.faces]
    outermost = rings.hop[ring].argmax(axis=1)
    face_tube[~leaf] = tubes.ring_tube[ring[np.arange(len(ring)), outermost]]
    if leaf.any():
        leaves = connected_parts(positions, plant.faces[leaf].astype(np.int64))
        face_tube[leaf] = hang_leaves(leaves, axes)
    progress("branches", 1.0)
    return _branches(face_tube, parent)


def _unit_positions(plant: Plant) -> FloatArray:
    """Positions about the mean corner, the farthest at distance 1, however the plant is turned."""
    low, high = plant.bounds
    extent = float((high - low).max()) or 1.0  # small numbers first, before any squares
    local = (np.clip(plant.positions, low, high) - (low + high) / 2) / extent
    used = local[plant.faces].reshape(-1, 3)
    center = used.mean(axis=0)
    radius = float(np.sqrt(((used - center) ** 2).sum(axis=1).max())) or 1.0
    return np.asarray(np.clip((local - center) / radius, -1, 1))


def _branches(face_tube: np.ndarray, parent: np.ndarray) -> Branches:
    """Branches ordered by level, then as the file first shows them."""
    level = np.zeros(len(parent), dtype=np.int64)
    ancestor = parent.copy()
    while (ancestor >= 0).any():
        level += ancestor >= 0
        ancestor = np.where(ancestor >= 0, parent[ancestor], -1)
    order = np.lexsort((np.arange(len(parent)), level))
    rank = np.empty(len(parent), dtype=np.int32)
    rank[order] = np.arange(len(parent))
    new_parent = np.where(parent[order] >= 0, rank[parent[order]], -1).astype(np.int32)
    return Branches(rank[face_tube], new_parent, level[order].astype(np.int32), "recovered")


def _without_wood(parts: Parts) -> Branches:
    """A trunk that nobody sees and, where the leaves fall apart, a branch for each part."""
    trunk = np.array([-1], dtype=np.int32)
    if parts.count > 1:
        parent = np.append(trunk, np.zeros(parts.count, dtype=np.int32))
        return Branches((parts.face_part + 1).astype(np.int32), parent, parent + 1, "recovered")
    return Branches(parts.face_part.astype(np.int32), trunk, trunk + 1, "recovered")
