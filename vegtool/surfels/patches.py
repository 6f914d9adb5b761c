"""Things beside each other joined to clusters of about a size: triangles to patches, patches to
groups.

Neighbours merge in pairs that prefer each other, most border in common for their size first, until
no two fit into one. Then what is small, having no neighbours, is gathered by where it lies.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.surfels.sheets import Labels, Triangles, edge_keys, following, pairs_of, runs

PATCH = 14
"""Most triangles of a patch; the mean is about 10."""

GROUP = 80
"""Most triangles of a group."""

BENT = 0.05
"""Cosine of the angle between triangles: an edge with a sharper bend counts no less."""


def patches_of(triangles: Triangles, positions: FloatArray, apart: Labels) -> Labels:
    """(n,) the patch of each triangle, flat rather than bent. None has two that differ in `apart`,
    (n,)."""
    one, other, length = neighbours(triangles, positions)
    a, b, c = (positions[triangles.faces[:, i]] for i in range(3))
    normal = unit(np.cross(b - a, c - a))
    alike = np.maximum(np.einsum("ni,ni->n", normal[one], normal[other]), BENT)
    same = apart[one] == apart[other]
    size = np.ones(len(triangles), np.int64)
    piece = clustered(size, (one[same], other[same]), (length * alike)[same], PATCH)
    where = np.empty(int(piece.max()) + 1, np.int64)
    where[piece] = apart
    return gathered(_means((a + b + c) / 3, piece), np.bincount(piece), where, PATCH)[piece]


def groups_of(triangles: Triangles, positions: FloatArray, patch: Labels) -> Labels:
    """(n,) the group of each triangle: whole patches, of triangles (n,)."""
    one, other, _ = neighbours(triangles, positions)
    across = patch[one] != patch[other]
    pairs = patch[one[across]], patch[other[across]]
    piece = clustered(np.bincount(patch), pairs, np.ones(len(pairs[0])), GROUP)[patch]
    means = _means(positions[triangles.faces].mean(axis=1), piece)
    size = np.bincount(piece)
    return gathered(means, size, np.zeros(len(size), np.int64), GROUP)[piece]


def neighbours(triangles: Triangles, positions: FloatArray) -> tuple[Labels, Labels, FloatArray]:
    """(p,), (p,) triangles that have an edge in common; (p,) its length."""
    start = triangles.faces.ravel()
    end = start[following(np.arange(len(start)))]
    one, other = pairs_of(edge_keys(start, end))
    length = np.linalg.norm(positions[start[one]] - positions[end[one]], axis=1)
    return one // 3, other // 3, length


def clustered(size: Labels, pairs: tuple[Labels, Labels], border: FloatArray, most: int) -> Labels:
    """(n,) the cluster of each of n things of sizes (n,): connected ones, of at most `most` in all.

    pairs: (p,), (p,) neighbours. border: (p,) how much these have in common, > 0.
    """
    label, size = np.arange(len(size)), size.copy()
    a, b = np.minimum(*pairs), np.maximum(*pairs)
    while True:
        fits = (a != b) & (size[a] + size[b] <= most)
        key, index = np.unique(edge_keys(a[fits], b[fits]), return_inverse=True)
        if not len(key):
            return np.unique(label, return_inverse=True)[1]
        a, b = key >> 31, key & ((1 << 31) - 1)
        border = np.asarray(np.bincount(index, border[fits]), np.float64)
        rank = np.empty(len(key), np.int64)
        rank[np.argsort(-border / (size[a] + size[b]), kind="stable")] = np.arange(len(key))
        best = np.full(len(size), len(key))
        np.minimum.at(best, a, rank)
        np.minimum.at(best, b, rank)
        mutual = (best[a] == rank) & (best[b] == rank)
        into = np.arange(len(size))
        into[b[mutual]] = a[mutual]
        size[a[mutual]] += size[b[mutual]]
        label, a, b = into[label], into[a], into[b]


def gathered(points: FloatArray, size: Labels, apart: Labels, most: int) -> Labels:
    """(n,) clusters of things at points (n, d), of sizes (n,): of at most `most` in all, unless one
    alone is larger. None has two that differ in `apart`, (n,).

    Halved by size across the longest side of their bounds, again and again.
    """
    part = np.unique(apart, return_inverse=True)[1]
    while True:
        large = (np.bincount(part, size) > most) & (np.bincount(part) > 1)
        rows = np.flatnonzero(large[part])
        if not len(rows):
            return part
        rows = rows[np.argsort(part[rows], kind="stable")]
        first = runs(part[rows])
        run = np.repeat(np.arange(len(first)), np.diff(first, append=len(rows)))
        low, high = (f.reduceat(points[rows], first) for f in (np.minimum, np.maximum))
        along = points[rows, (high - low).argmax(axis=1)[run]]
        rows = rows[np.lexsort((along, run))]
        total, before = np.cumsum(size[rows]), np.cumsum(size[rows]) - size[rows]
        middle = (total + before) / 2 - before[first][run]
        upper = middle > np.add.reduceat(size[rows], first)[run] / 2
        upper[first], upper[np.append(first[1:], len(rows)) - 1] = False, True
        part = 2 * part
        part[rows] += upper
        part = np.unique(part, return_inverse=True)[1]


def _means(values: FloatArray, label: Labels) -> FloatArray:
    """(l, d) of values (n, d) by label (n,)."""
    total = np.stack([np.bincount(label, column) for column in values.T], axis=1)
    return np.asarray(total / np.bincount(label)[:, None])
