"""Tubes: chains of rings. Where the rings of one part fork, the heavier arm goes on.

A spur shorter than the wood there is thick is no branch but a bump, and stays with its tube.
Two tubes may also meet end to end and share a ring, as where a generator ends a trunk in a branch
of its own: both are swept with steps and taper of their own, so a joint shows as a ring where one
even run ends and another begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.skeleton import Skeleton

SPUR = 2.0  # radii: a side arm shorter than this belongs to the tube it stands on
EVEN = 1e-4  # steps of one sweep are equal to within this fraction, tapers to this slope,
NOISE = 10.0  # or to within so many times their median change, where positions are rounded
CURVED = 4e-3  # where the median is larger, tubes follow uneven curves and show no joints
JUMP = 0.05  # steps or tapers of two sweeps differ by more


@dataclass(frozen=True, eq=False)
class Tubes:
    """Chains of rings, t of them, ordered as the file first shows them.

    ring_tube: (r,). start: (t,) first ring. fork: (t,) the ring of the same part that the tube
    forks from, or -1 where it starts a part of its own. length: (t,) from start to its far end.
    along: (r,) from the tube's start to the ring.
    """

    ring_tube: np.ndarray
    start: np.ndarray
    fork: np.ndarray
    length: FloatArray
    along: FloatArray

    def __len__(self) -> int:
        return len(self.start)


def cut_tubes(rings: Skeleton) -> Tubes:
    """The tubes of a skeleton."""
    count = len(rings.parent)
    has_parent = rings.parent >= 0
    up = np.where(has_parent, rings.parent, np.arange(count))
    step = np.linalg.norm(rings.center - rings.center[up], axis=1)
    by_hop = np.argsort(rings.hop, kind="stable")
    bounds = np.searchsorted(rings.hop[by_hop], np.arange(rings.hop.max() + 2))
    layers = [by_hop[bounds[i] : bounds[i + 1]] for i in range(len(bounds) - 1)]

    # from the tips to the starts: the longest way to a tip, and the wood that hangs on a ring
    reach = np.zeros(count)
    mass = step * np.maximum(rings.radius, rings.radius[up]) + np.finfo(float).eps
    for layer in reversed(layers[1:]):
        rows = layer[has_parent[layer]]
        np.maximum.at(reach, up[rows], reach[rows] + step[rows])
        np.add.at(mass, up[rows], mass[rows])

    rows = np.flatnonzero(has_parent)
    order = rows[np.lexsort((-rows, mass[rows], up[rows]))]
    heaviest = np.full(count, -1)
    heaviest[up[order]] = order  # the last one written, the heaviest
    stays = has_parent & (heaviest[up] == np.arange(count))
    stays &= ~_joints(rings, np.where(stays, up, -1), step)
    stays |= has_parent & (reach + step < SPUR * rings.radius[up])

    head = np.where(stays, up, np.arange(count))
    along = np.zeros(count)
    for layer in layers[1:]:
        head[layer] = head[head[layer]]
        along[layer] = np.where(stays[layer], along[up[layer]] + step[layer], 0.0)
    start, ring_tube = np.unique(head, return_inverse=True)
    first_vertex = np.full(count, len(rings.vertex_ring))
    np.minimum.at(first_vertex, rings.vertex_ring, np.arange(len(rings.vertex_ring)))
    shown = np.lexsort((first_vertex[start], rings.part[start]))
    rank = np.empty(len(start), dtype=np.int64)
    rank[shown] = np.arange(len(start))
    start = start[shown]
    return Tubes(rank[ring_tube], start, rings.parent[start], reach[start], along)


def _joints(rings: Skeleton, up: np.ndarray, step: FloatArray) -> np.ndarray:
    """(r,) bool: rings with which a new sweep begins. `up` is the ring before along the tube."""
    count = len(up)
    one = up
    two = np.where(one >= 0, up[one], -1)
    three = np.where(two >= 0, up[two], -1)
    # ring `after` <- here <- one <- two <- three: two steps before the joint `one`, two after it
    after = np.full(count, -1)
    rows = np.flatnonzero(up >= 0)
    after[up[rows]] = rows
    here = np.flatnonzero((three >= 0) & (after >= 0))
    chain = np.stack([three[here], two[here], one[here], here, after[here]])
    length = step[chain[1:]]
    slope = np.diff(rings.radius[chain], axis=0) / np.maximum(length, np.finfo(float).tiny)
    longer = np.maximum(np.maximum(length[1:], length[:-1]), np.finfo(float).tiny)
    # (2, 3, n): change of step and of taper; before, at and after the joint
    change = np.abs([np.diff(length, axis=0) / longer, np.diff(slope, axis=0)])
    noise = np.median(change, axis=(1, 2)) if len(here) else np.zeros(2)
    if noise[0] > CURVED:
        return np.zeros(count, dtype=bool)
    even = np.maximum(EVEN, NOISE * noise)[:, None]
    runs = (change[:, 0] <= even) & (change[:, 2] <= even)
    jumps = change[:, 1] > np.maximum(JUMP, 2 * even)
    joint = np.zeros(count, dtype=bool)
    joint[here[runs.all(axis=0) & jumps.any(axis=0)]] = True
    return joint
