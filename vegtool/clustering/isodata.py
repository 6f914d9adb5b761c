"""ISODATA for long and thin clusters.

After Ball and Hall, "ISODATA, a novel method of data analysis and pattern classification" (1965),
in the variant that Colditz et al. (2005, section 2) name but do not spell out: "clusters are
dynamically split or merged due to their size. We modified this approach in order to get mostly
long and thin clusters instead of the compact forms." Our reading:

A cluster is a mean and a *line* through it, the principal axis of its positions. Distance along the
line counts 1 / elongation as much as distance across, in every step: a point moves to the cluster
whose line is near (`move`); a cluster splits along whatever direction holds most of its error
(`split_wide`), so a wide one becomes two thin ones side by side; and two clusters merge where
together they add the least error (`merge_collinear`), which favours pieces of the same line.

Ball and Hall's thresholds on size become ranks, since the count is given: every round splits the
costliest clusters and merges the cheapest pairs, an `EXCHANGE` of the count at first, falling to
nothing in the last round. So it always ends, however split and merge may undo each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.clustering import ClusterOptions
from vegtool.clustering.features import Labels, coarse, samples
from vegtool.clustering.partition import (
    MANY,
    compacted,
    cut,
    disjoint_pairs,
    fill,
    means,
    pairs_per_round,
    split,
)
from vegtool.plant import Plant
from vegtool.progress import Progress

ROUNDS = 4
EXCHANGE = 1.0  # of the count, split and merged again in the first round
NEAR = 12  # clusters next to its own that a point may move to, or a cluster merge with


@dataclass(frozen=True, eq=False)
class Lines:
    """The clusters of a partition, as lines.

    center: (k, 9) mean. mass: (k,) weight. moment: (k, 3, 3) weighted scatter of the positions.
    turn: (k,) weighted scatter of the orientations. axes: (k, 3, 3) rows are the principal axes of
    the positions, the line first. error: (k,) across the line and, discounted, along it.
    """

    center: FloatArray
    mass: FloatArray
    moment: FloatArray
    turn: FloatArray
    axes: FloatArray
    error: FloatArray


def isodata(
    plant: Plant, count: int, options: ClusterOptions, seed: int, progress: Progress
) -> IntArray:
    """(f,) int32 labels of at most `count` long and thin clusters. No random choice is made."""
    # lengths along a line shrink, hence positions on the whole: orientation shrinks with them
    scale = options.orientation_scale(count) / options.elongation ** (1 / 3)
    fine = samples(plant, scale, count)
    few = coarse(fine, count)
    points, weights = few.points, few.weights
    gain = 1 - 1 / options.elongation**2  # share of the squared distance along a line that is free
    labels = split(points, weights, np.zeros(len(points), dtype=np.int64), count)
    rounds = ROUNDS if count <= MANY else 0  # many clusters have few points each
    for remaining in range(rounds, -1, -1):
        labels = move(points, weights, labels, gain)
        surplus = ceil(EXCHANGE * count * remaining / ROUNDS)
        labels = split_wide(points, weights, labels, gain, min(count + surplus, len(points)))
        labels = move(points, weights, labels, gain)
        labels = merge_collinear(points, weights, labels, gain, count)
        progress("isodata", 1 - remaining / (rounds + 1))
    labels = fill(points, weights, labels, count)
    return np.asarray(labels[few.of_face], dtype=np.int32)


def lines(points: FloatArray, weights: FloatArray, labels: Labels, gain: float) -> Lines:
    """The lines of the clusters."""
    center, mass = means(points, weights, labels)
    offset = points - center[labels]
    moment = np.empty((len(mass), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            scatter = np.bincount(labels, weights * offset[:, i] * offset[:, j])
            moment[:, i, j] = moment[:, j, i] = scatter
    turn = np.bincount(labels, weights * (offset[:, 3:] ** 2).sum(axis=1)).astype(np.float64)
    axes = np.linalg.eigh(moment)[1].transpose(0, 2, 1)[:, ::-1]
    return Lines(center, mass, moment, turn, axes, line_error(moment, turn, gain))


def line_error(moment: FloatArray, turn: FloatArray, gain: float) -> FloatArray:
    """Scatter across the line, discounted scatter along it, and scatter of the orientations."""
    longest = np.linalg.eigvalsh(moment)[:, -1]
    return np.asarray(np.trace(moment, axis1=1, axis2=2) - gain * longest + turn)


def neighbours(center: FloatArray) -> Labels:
    """(k, NEAR + 1) nearest clusters of each, itself among them."""
    from scipy.spatial import cKDTree

    near = cKDTree(center).query(center, k=min(NEAR + 1, len(center)))[1]
    return np.asarray(near).reshape(len(center), -1)


def move(points: FloatArray, weights: FloatArray, labels: Labels, gain: float) -> Labels:
    """Every point to the nearest line among its own cluster's and those around it."""
    clusters = lines(points, weights, labels, gain)
    near = neighbours(clusters.center)
    best, least = labels, np.full(len(points), np.inf)
    for candidate in near.T:
        to = candidate[labels]
        offset = points - clusters.center[to]
        along = np.einsum("ni,ni->n", offset[:, :3], clusters.axes[to, 0])
        squared = np.einsum("ni,ni->n", offset, offset) - gain * along**2
        closer = squared < least
        best, least = np.where(closer, to, best), np.where(closer, squared, least)
    return compacted(best)


def split_wide(
    points: FloatArray, weights: FloatArray, labels: Labels, gain: float, count: int
) -> Labels:
    """Up to `count` clusters: the costliest cut where they are widest, length discounted."""
    k = int(labels.max()) + 1
    while k < count:
        clusters = lines(points, weights, labels, gain)
        offset = points - clusters.center[labels]
        offset[:, :3] = np.einsum("nij,nj->ni", clusters.axes[labels], offset[:, :3])
        offset[:, 0] *= sqrt(1 - gain)
        labels = cut(offset, weights, labels, min(count - k, (k + 1) // 2))
        before, k = k, int(labels.max()) + 1
        if k == before:
            return fill(points, weights, labels, count)
    return labels


def merge_collinear(
    points: FloatArray, weights: FloatArray, labels: Labels, gain: float, count: int
) -> Labels:
    """Down to `count` clusters: the neighbours that add the least error first."""
    k = int(labels.max()) + 1
    while k > count:
        clusters = lines(points, weights, labels, gain)
        near = neighbours(clusters.center)
        a, b = np.repeat(np.arange(k), near.shape[1]), near.ravel()
        pair = np.unique(np.minimum(a, b)[a != b] * k + np.maximum(a, b)[a != b])
        a, b = pair // k, pair % k
        between = clusters.center[a] - clusters.center[b]
        share = clusters.mass[a] * clusters.mass[b] / (clusters.mass[a] + clusters.mass[b])
        apart = share[:, None, None] * between[:, :3, None] * between[:, None, :3]
        moment = clusters.moment[a] + clusters.moment[b] + apart
        turn = clusters.turn[a] + clusters.turn[b] + share * (between[:, 3:] ** 2).sum(axis=1)
        added = line_error(moment, turn, gain) - clusters.error[a] - clusters.error[b]
        order = np.argsort(added, kind="stable")
        into = disjoint_pairs(a[order], b[order], k, limit=pairs_per_round(k, count))
        labels = compacted(into[labels])
        k = int(labels.max()) + 1
    return labels
