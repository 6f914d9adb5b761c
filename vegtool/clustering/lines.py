"""Clusters that are lines: moves on a partition in which length counts for little.

A cluster is a mean and a *line* through it, the principal axis of its positions. Distance along the
line counts 1 / elongation as much as distance across, in every step: a point moves to the cluster
whose line is near (`move`); a cluster splits along whatever direction holds most of its error
(`split_wide`), so a wide one becomes two thin ones side by side; and two clusters merge where
together they add the least cost (`merge_collinear`), which favours pieces of the same line.

Two crossed planes show a line: what lies off it is drawn beside its place, by as much as it lies
off; what lies along it is drawn where it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, sqrt

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.clustering.features import Labels, Samples, spread_to
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
from vegtool.progress import Progress, silent

ROUNDS = 4
EXCHANGE = 1.0  # of the count, split and merged again in the first round
POWER = 0.5  # of the mean squared distance from the line: how a cluster's cost grows with it
NEAR = 12  # clusters next to its own that a point may move to, or a cluster merge with


@dataclass(frozen=True, eq=False)
class Lines:
    """The clusters of a partition, as lines.

    center: (k, 9) mean. mass: (k,) weight. moment: (k, 3, 3) weighted scatter of the positions.
    turn: (k,) weighted scatter of the orientations. error: (k,) across the line and, discounted,
    along it.
    """

    center: FloatArray
    mass: FloatArray
    moment: FloatArray
    turn: FloatArray
    error: FloatArray

    @cached_property
    def axes(self) -> FloatArray:
        """(k, 3, 3) rows are the principal axes of the positions, the line first."""
        return np.asarray(np.linalg.eigh(self.moment)[1].transpose(0, 2, 1)[:, ::-1])

    @cached_property
    def cost(self) -> FloatArray:
        """(k,) what it costs that they are no more than lines."""
        return cost(self.error, self.mass)


def settle_lines(
    few: Samples,
    labels: Labels,
    count: int,
    elongation: float,
    group: Labels | None = None,
    progress: Progress = silent,
) -> Labels:
    """Split, merge and move until `count` clusters have little error, each within its group.

    Every round splits the costliest clusters and merges the cheapest pairs, an EXCHANGE of the
    count at first, falling to nothing in the last round; so it always ends.
    group: (n,) of each point; `count` is at least the groups'.
    """
    points, weights = few.points, few.weights
    if not points[:, 3:].any():
        points = points[:, :3]  # no orientation is asked for: half of the work
    gain = 1 - 1 / elongation**2  # share of the squared distance along a line that is free
    labels = split(points, weights, labels, min(count, len(points)))
    rounds = ROUNDS if count <= MANY else 0  # many clusters have few points each
    for remaining in range(rounds, -1, -1):
        labels = move(points, weights, labels, gain, group)
        surplus = ceil(EXCHANGE * count * remaining / ROUNDS)
        labels = split_wide(points, weights, labels, gain, min(count + surplus, len(points)))
        labels = move(points, weights, labels, gain, group)
        labels = merge_collinear(points, weights, labels, gain, count, group)
        progress("lines", 1 - remaining / (rounds + 1))
    return fill(points, weights, labels, count)


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
    return Lines(center, mass, moment, turn, line_error(moment, turn, gain))


def line_error(moment: FloatArray, turn: FloatArray, gain: float) -> FloatArray:
    """Scatter across the line, discounted scatter along it, and scatter of the orientations."""
    along = largest_eigenvalue(moment)
    return np.asarray(np.trace(moment, axis1=1, axis2=2) - gain * along + turn)


def largest_eigenvalue(moment: FloatArray) -> FloatArray:
    """(k,) of symmetric matrices (k, 3, 3).

    Smith, "Eigenvalues of a symmetric 3 x 3 matrix" (1961): a tenth of the time of LAPACK's, and
    exact to 1e-8 of itself where two are equal.
    """
    middle = np.trace(moment, axis1=1, axis2=2) / 3
    offset = moment - middle[:, None, None] * np.eye(3)
    size = np.sqrt(np.einsum("kij,kij->k", offset, offset) / 6)
    offset /= np.where(size > 0, size, 1.0)[:, None, None]
    a, b, c = offset[:, 0].T
    d, e, f = offset[:, 1, 1], offset[:, 1, 2], offset[:, 2, 2]
    half_det = (a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)) / 2
    return np.asarray(middle + 2 * size * np.cos(np.arccos(np.clip(half_det, -1, 1)) / 3))


def cost(error: FloatArray, mass: FloatArray) -> FloatArray:
    """(k,) weight times a slowly growing function of the distance from the line.

    A twig drawn beside its place is wrong, and hardly more so if it is drawn far beside: what
    counts is how much is right. So billboards go where there is much surface on few lines, trunks
    first, instead of where twigs lie widest apart.
    """
    return np.asarray(mass * (np.maximum(error, 0.0) / mass) ** POWER)


def neighbours(center: FloatArray, of_cluster: Labels | None, reach: float) -> Labels:
    """(k, NEAR + 1) nearest clusters of each, itself among them and, where its group has no more,
    in place of those of others."""
    from scipy.spatial import cKDTree

    placed = center if of_cluster is None else set_apart(center, of_cluster, reach)
    near = cKDTree(placed).query(placed, k=min(NEAR + 1, len(center)))[1]
    near = np.asarray(near).reshape(len(center), -1)
    if of_cluster is None:
        return near
    own = np.arange(len(center))[:, None]
    return np.where(of_cluster[near] == of_cluster[own], near, own)


def set_apart(points: FloatArray, group: Labels, reach: float) -> FloatArray:
    """Points with one more coordinate, which keeps groups at least `reach` apart."""
    return np.concatenate([points, reach * group[:, None]], axis=1)


def reach_of(points: FloatArray) -> float:
    """More than the distance between any two points, or their means."""
    return 4.0 * (1.0 + float(np.linalg.norm(points, axis=1).max()))


def move(
    points: FloatArray,
    weights: FloatArray,
    labels: Labels,
    gain: float,
    group: Labels | None = None,
) -> Labels:
    """Every point to the nearest line among its own cluster's and those around it."""
    clusters = lines(points, weights, labels, gain)
    of_cluster = None if group is None else spread_to(labels, group)
    near = neighbours(clusters.center, of_cluster, reach_of(points))
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
        labels = cut(offset, weights, labels, min(count - k, (k + 1) // 2), clusters.cost)
        before, k = k, int(labels.max()) + 1
        if k == before:
            return fill(points, weights, labels, count)
    return labels


def merge_collinear(
    points: FloatArray,
    weights: FloatArray,
    labels: Labels,
    gain: float,
    count: int,
    group: Labels | None = None,
) -> Labels:
    """Down to `count` clusters: the neighbours that add the least cost first."""
    k = int(labels.max()) + 1
    while k > count:
        clusters = lines(points, weights, labels, gain)
        of_cluster = None if group is None else spread_to(labels, group)
        near = neighbours(clusters.center, of_cluster, reach_of(points))
        a, b = np.repeat(np.arange(k), near.shape[1]), near.ravel()
        pair = np.unique(np.minimum(a, b)[a != b] * k + np.maximum(a, b)[a != b])
        a, b = pair // k, pair % k
        between = clusters.center[a] - clusters.center[b]
        share = clusters.mass[a] * clusters.mass[b] / (clusters.mass[a] + clusters.mass[b])
        apart = share[:, None, None] * between[:, :3, None] * between[:, None, :3]
        moment = clusters.moment[a] + clusters.moment[b] + apart
        turn = clusters.turn[a] + clusters.turn[b] + share * (between[:, 3:] ** 2).sum(axis=1)
        together = cost(line_error(moment, turn, gain), clusters.mass[a] + clusters.mass[b])
        added = together - clusters.cost[a] - clusters.cost[b]
        order = np.argsort(added, kind="stable")
        into = disjoint_pairs(a[order], b[order], k, limit=pairs_per_round(k, count))
        labels = compacted(into[labels])
        k = int(labels.max()) + 1
    return labels
