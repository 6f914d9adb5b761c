"""Colour and normals carried out from what is covered, under alpha 0 and into the gutter.

Clients filter straight alpha: a black texel under alpha 0 darkens its neighbours, and more so in
every mip. Each uncovered texel takes the nearest covered one of its own picture (exact Euclidean
distance, row by row and then column by column: Saito and Toriwaki 1994), never a neighbour's.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import IntArray

FAR = 1 << 20
"""Texels: beyond any atlas; its square still fits 64 bits."""


def nearest_covered(covered: np.ndarray, rect: IntArray, gutter: int) -> np.ndarray:
    """(h, w) int64: for each texel the flat index of the nearest covered one of its picture.

    covered: (h, w) bool. rect: (n, 4) texels as in Atlas; `gutter` texels around each belong to
    it. A covered texel, one outside all pictures, and one in an empty picture are their own.
    """
    label = owners(covered.shape, rect, gutter)
    distance, source = _along_rows(covered & (label >= 0), label)
    return _along_columns(distance, source, label)


def owners(shape: tuple[int, ...], rect: IntArray, gutter: int) -> IntArray:
    """(h, w) int32: the picture to which each texel belongs, gutter included, or -1."""
    label = np.full(shape, -1, dtype=np.int32)
    low = np.maximum(rect[:, :2] - gutter, 0)
    high = rect[:, :2] + rect[:, 2:] + gutter
    for i, ((x0, y0), (x1, y1)) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        label[y0:y1, x0:x1] = i
    return label


def _along_rows(covered: np.ndarray, label: IntArray) -> tuple[np.ndarray, np.ndarray]:
    """Per texel the distance to the nearest covered one in its row and picture, and its index."""
    height, width = covered.shape
    column = np.broadcast_to(np.arange(width, dtype=np.int32), covered.shape)
    left = np.maximum.accumulate(np.where(covered, column, -1), axis=1)
    right = np.minimum.accumulate(np.where(covered, column, width)[:, ::-1], axis=1)[:, ::-1]

    def checked(at: np.ndarray, found: np.ndarray) -> np.ndarray:
        inside = np.clip(at, 0, width - 1)
        same = found & (np.take_along_axis(label, inside, axis=1) == label)
        return np.where(same, np.abs(at - column), FAR)

    to_left, to_right = checked(left, left >= 0), checked(right, right < width)
    nearest = np.where(to_left <= to_right, left, right)
    distance = np.minimum(to_left, to_right).astype(np.int64)
    rows = np.arange(height, dtype=np.int64)[:, None] * width
    own = rows + column
    return distance, np.where(distance < FAR, rows + nearest, own)


def _along_columns(distance: np.ndarray, source: np.ndarray, label: IntArray) -> np.ndarray:
    """The nearest over all rows of the picture: rows farther away than the best are not asked."""
    height, width = label.shape
    flat_label, row_distance = label.ravel(), distance.ravel() ** 2
    best, nearest = row_distance.copy(), source.ravel().copy()
    active = np.flatnonzero((best > 1) & (flat_label >= 0))
    row_source = nearest.copy()
    for step in range(1, height):
        active = active[best[active] > step * step]
        reached = np.zeros(len(active), dtype=bool)
        for move in (-step, step):
            row = active // width + move
            there = active + move * width
            ok = (row >= 0) & (row < height)
            ok[ok] = flat_label[there[ok]] == flat_label[active[ok]]
            reached |= ok
            here, there = active[ok], there[ok]
            candidate = row_distance[there] + step * step
            closer = candidate < best[here]
            best[here[closer]] = candidate[closer]
            nearest[here[closer]] = row_source[there[closer]]
        active = active[reached]
        if not len(active):
            break
    return nearest.reshape(height, width)
