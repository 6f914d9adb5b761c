"""Surfel billboards in pairs, and these in pairs again: a binary hierarchy.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4.3. Near neighbours are merged whose box is the flattest and best covered: the weight is f1 f2 (eq.
13 to 15). What a pair's box is around are the billboards `depth` steps below, or the triangles of
the base where there are fewer, so that all of it takes linear time; how it lies is known exactly,
since moments of surfaces add up.

The paper takes one pair at a time, the best of all. What has just been made then is often half of
the next best pair, and grows by one of the base at a time. Here, as in locally-ordered clustering
(Walter et al. 2008), all pairs merge at once that are the best for both of their two. That made
billboards several times flatter (docs/methods/surfel_billboards.md), and draws the cover of all new
pairs of a round with one read-back.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.gl.cells import covered
from vegtool.progress import Progress, silent
from vegtool.surfels.box import Moments, SurfelBoxes, boxes_round, moments_of

TOGETHER = 4096
"""Pairs that are looked at together: more take memory, and no less time."""
TINY = 1e-9
"""Of the greatest half size: less is none."""
UNSEEN = 1e-12
"""Cover of what is missed by all samples, so that of such pairs the flattest are best."""

Longs = npt.NDArray[np.int64]


def merged(
    corners: FloatArray, first: npt.NDArray[np.integer], neighbours: int = 8, depth: int = 5,
    progress: Progress = silent,
) -> IntArray:  # fmt: skip
    """(b - 1, 2) int32 the two children of each billboard made of b of the base, in the order in
    which they were merged: the first is number b, the last the root.

    corners: (t, 3, 3) triangles, billboard by billboard. first: (b,) the first triangle of each,
    none of which is empty. Raises CapabilityError where nothing can draw.
    """
    work = Merging(corners, first, depth)
    left, total = np.arange(work.base), 2 * work.base - 1
    keys, weights = np.empty(0, dtype=np.int64), np.empty(0)
    while len(left) > 1:
        near = nearest_pairs(work.center[left], neighbours)
        key = np.unique(left[near[:, 0]] * total + left[near[:, 1]])
        known = np.isin(key, keys, assume_unique=True)
        weight = np.empty(len(key))
        weight[known] = weights[np.searchsorted(keys, key[known])]
        pairs = np.stack([key // total, key % total], axis=1)
        weight[~known] = work.weights(pairs[~known])
        keys, weights = key, weight
        best = pairs[best_for_both(pairs, weight, total)]
        made = work.merge(best)
        left = np.concatenate([np.setdiff1d(left, best), made])
        progress("hierarchy", len(work.children) / max(work.base - 1, 1))
    return np.array(work.children, dtype=np.int32).reshape(-1, 2)


def nearest_pairs(center: FloatArray, neighbours: int) -> Longs:
    """(p, 2) rows of each of (n, 3) and of those nearest to it, the lesser first."""
    from scipy.spatial import cKDTree

    count = len(center)
    most = min(neighbours + 1, count)
    near = cKDTree(center).query(center, most)[1].reshape(count, most)
    pairs = np.sort(np.stack([np.repeat(np.arange(count), most), near.ravel()], axis=1), axis=1)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    if len(pairs):
        return np.asarray(pairs, dtype=np.int64)
    return np.array([[0, 1]])  # all in one place, where each may find itself alone


def best_for_both(pairs: Longs, weight: FloatArray, total: int) -> Longs:
    """(m,) those of the pairs (p, 2), of numbers below `total`, that no other is better than for
    either of the two; the best first. Of equals the first is better."""
    rank = np.empty(len(pairs), dtype=np.int64)
    order = np.argsort(-weight, kind="stable")
    rank[order] = np.arange(len(pairs))
    best = np.full(total, len(pairs))
    for one in pairs.T:
        np.minimum.at(best, one, rank)
    found = np.flatnonzero((best[pairs] == rank[:, None]).all(axis=1))
    return np.asarray(found[np.argsort(rank[found])])


class Merging:
    """Billboards as they are merged: what they are made of and how they lie."""

    def __init__(self, corners: FloatArray, first: npt.NDArray[np.integer], depth: int) -> None:
        self.base, self.depth = len(first), depth
        total = 2 * self.base - 1
        own = moments_of(corners, first)
        self.moments = Moments(
            np.ones(total), np.zeros((total, 3)), np.zeros((total, 3)), np.zeros((total, 3, 3))
        )
        self.center = np.zeros((total, 3))
        self.pieces: list[FloatArray] = np.split(corners, first[1:])
        self.quads: list[FloatArray] = []
        self.children: list[tuple[int, int]] = []
        boxes = boxes_round(own, corners.reshape(-1, 3), 3 * np.asarray(first))
        self._keep(np.arange(self.base), own, boxes)

    def weights(self, pairs: Longs) -> FloatArray:
        """(p,) f1 f2 (eq. 15) of pairs (p, 2)."""
        found = np.empty(len(pairs))
        for at in range(0, len(pairs), TOGETHER):
            some = slice(at, at + TOGETHER)
            boxes, corners, first = self.boxes(pairs[some])
            cover = coverage(boxes, corners, first)
            found[some] = flatness(boxes) * np.maximum(cover, UNSEEN)
        return found

    def boxes(self, pairs: Longs) -> tuple[SurfelBoxes, FloatArray, Longs]:
        """The boxes of pairs, the triangles (t, 3, 3) that they are around, the first of each."""
        parts = [self.pieces[one] for one in pairs.ravel().tolist()]
        size = np.array([len(part) for part in parts]).reshape(-1, 2).sum(axis=1)
        corners, first = np.concatenate(parts), np.cumsum(size) - size
        moments = self._joined(pairs)
        return boxes_round(moments, corners.reshape(-1, 3), 3 * first), corners, first

    def merge(self, pairs: Longs) -> Longs:
        """Make a billboard of each pair; (m,) their numbers."""
        new = self.base + len(self.children) + np.arange(len(pairs))
        for at in range(0, len(pairs), TOGETHER):
            some = slice(at, at + TOGETHER)
            self._keep(new[some], self._joined(pairs[some]), self.boxes(pairs[some])[0])
        self.children += [(int(a), int(b)) for a, b in pairs]
        self.pieces += [np.concatenate(self.below(one, self.depth)) for one in new.tolist()]
        return new

    def below(self, one: int, steps: int) -> list[FloatArray]:
        """The triangles of the billboards so many steps below, or of the base's surface where that
        is nearer."""
        if one < self.base:
            return [self.pieces[one]]
        if steps == 0:
            return [self.quads[one]]
        a, b = self.children[one - self.base]
        return self.below(a, steps - 1) + self.below(b, steps - 1)

    def _joined(self, pairs: Longs) -> Moments:
        return self.moments.of(pairs[:, 0]).with_(self.moments.of(pairs[:, 1]))

    def _keep(self, rows: Longs, moments: Moments, boxes: SurfelBoxes) -> None:
        own = self.moments
        own.weight[rows], own.facing[rows] = moments.weight, moments.facing
        own.mean[rows], own.spread[rows] = moments.mean, moments.spread
        self.center[rows] = boxes.center
        quads = boxes.quads()
        self.quads += list(np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1))


def flatness(boxes: SurfelBoxes) -> FloatArray:
    """f1 (eq. 13): 1 for what is flat, 0 for a cube."""
    w, h, d = boxes.half.T
    side = np.sqrt(w) * np.sqrt(np.maximum(h, TINY * w))
    return np.asarray(1 - np.divide(d, side, out=np.zeros_like(d), where=side > 0))


def coverage(boxes: SurfelBoxes, corners: FloatArray, first: Longs) -> FloatArray:
    """f2 (eq. 14): the share of each box's plane that its triangles cover, as seen along n."""
    count = len(first)
    cell = np.repeat(np.arange(count), np.diff(np.append(first, len(corners))))
    along = np.einsum("tci,tji->tcj", corners - boxes.center[cell, None], boxes.axes[cell, :2])
    half = np.maximum(boxes.half[:, :2], np.finfo(float).tiny)
    half = np.maximum(half, TINY * half[:, :1])
    return covered(along / half[cell, None], cell, count)
