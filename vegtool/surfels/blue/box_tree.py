"""Farthest-first traversal with a tree of boxes, compiled.

Gonzalez: Clustering to minimize the maximum intercluster distance (1985) has the order. Buckets of
points that remember their largest distance, so that most are left alone, are as in Han et al.:
QuickFPS (2023); here they are few neighbours along a Morton curve, with a tree of boxes above them,
which gives both the farthest point and all whose distance a new one changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.surfels.blue.compiled import compiled

LEAF = 64
"""Points of a leaf."""
FAN = 32
"""Children of a node."""
DIGIT = 11
"""Bits of a key sorted by at a time."""
DIGITS = 5
"""Of a key, at most: 55 bits."""
TAKEN = -1.0
"""Squared distance of what is taken already, or is no point."""


def traverse(points: FloatArray, first: int, count: int) -> IntArray:
    """(count,) int32 of points (n, d), beginning with `first`; then always the farthest from all
    taken. 1 <= count <= n. Of equally far ones, any; those at no distance come last, by number."""
    order = _curve(points)
    levels = [-(-len(points) // LEAF)]
    while levels[-1] > 1:
        levels.append(-(-levels[-1] // FAN))
    starts = np.cumsum([0] + [-(-size // FAN) for size in levels])
    taken = _traverse(points, order, np.array(levels), starts, first, count)
    if len(taken) == count:
        return np.asarray(taken)
    copies = np.ones(len(points), bool)
    copies[taken] = False
    left = np.flatnonzero(copies)[: count - len(taken)]
    return np.concatenate([taken, left.astype(np.int32)])


def _curve(points: FloatArray) -> IntArray:
    """(n,) int32 points along a Morton curve; of the same cell, by number."""
    dimensions = points.shape[1]
    bits = min(DIGIT, DIGITS * DIGIT // dimensions)
    return np.asarray(_sorted(_keys(points, bits), -(-bits * dimensions // DIGIT)))


@compiled
def _keys(points: Any, bits: int) -> Any:
    """(n,) the bits of all coordinates in turn, those the highest first."""
    size, dimensions = points.shape
    low, extent = np.empty(dimensions), 0.0
    for k in range(dimensions):
        least = most = points[0, k]
        for i in range(size):
            least = points[i, k] if points[i, k] < least else least
            most = points[i, k] if points[i, k] > most else most
        low[k], extent = least, max(extent, most - least)
    last = (1 << bits) - 1
    scale = last / extent if extent > 0 else 0.0
    keys = np.empty(size, np.uint64)
    spread = np.zeros(1 << bits, np.uint64)
    for value in range(1 << bits):
        for bit in range(bits):
            spread[value] |= np.uint64((value >> bit) & 1) << np.uint64(bit * dimensions)
    for i in range(size):
        key = np.uint64(0)
        for k in range(dimensions):
            cell = (points[i, k] - low[k]) * scale
            inside = 0 <= cell <= last  # but where numbers overflow, and any order is right
            key |= spread[int(cell) if inside else 0] << np.uint64(k)
        keys[i] = key
    return keys


@compiled
def _sorted(keys: Any, many: int) -> Any:
    """(n,) int32 the order of keys, equal ones by number: digits from the lowest on."""
    size, digits = len(keys), 1 << DIGIT
    order, other = np.empty(size, np.int32), np.empty(size, np.int32)
    for i in range(size):
        order[i] = i
    spare = np.empty(size, np.uint64)
    mask = np.uint64(digits - 1)
    for turn in range(many):
        down = np.uint64(turn * DIGIT)
        place = np.zeros(digits + 1, np.int64)
        for i in range(size):
            place[np.int64((keys[i] >> down) & mask) + 1] += 1
        for i in range(digits):
            place[i + 1] += place[i]
        for i in range(size):
            digit = np.int64((keys[i] >> down) & mask)
            spare[place[digit]] = keys[i]
            other[place[digit]] = order[i]
            place[digit] += 1
        keys, spare = spare, keys
        order, other = other, order
    return order


@compiled
def _outside(low: Any, high: Any, point: Any, squared: Any) -> None:
    """Squared distances (FAN,) of a point (d,) from boxes (d, FAN)."""
    for i in range(FAN):
        squared[i] = 0.0
    for k in range(len(point)):
        place = point[k]
        for i in range(FAN):
            under, over = low[k, i] - place, place - high[k, i]
            out = under if under > over else over
            out = out if out > 0.0 else 0.0
            squared[i] += out * out


@compiled
def _nearer(points: Any, point: Any, near: Any, squared: Any) -> float:
    """Lowers squared distances (LEAF,) of points (d, LEAF) to those from a point
    (d,), where these are less; the largest."""
    for i in range(LEAF):
        squared[i] = 0.0
    for k in range(len(point)):
        place = point[k]
        for i in range(LEAF):
            out = points[k, i] - place
            squared[i] += out * out
    for i in range(LEAF):
        near[i] = near[i] if near[i] < squared[i] else squared[i]
    a = b = c = d = TAKEN  # several, as each waits for the one before
    for i in range(0, LEAF, 4):
        a = near[i] if near[i] > a else a
        b = near[i + 1] if near[i + 1] > b else b
        c = near[i + 2] if near[i + 2] > c else c
        d = near[i + 3] if near[i + 3] > d else d
    a, c = a if a > b else b, c if c > d else d
    return a if a > c else c


@compiled
def _largest(values: Any) -> int:
    best = 0
    for i in range(1, len(values)):
        if values[i] > values[best]:
            best = i
    return best


@compiled
def _traverse(points: Any, order: Any, levels: Any, starts: Any, first: int, count: int) -> Any:
    """(k,) int32 points, k < count where only copies of them are left. levels: nodes of each level,
    leaves first. starts: the first group of FAN nodes of each."""
    size, dimensions = points.shape
    height = len(levels)
    at = np.zeros((levels[0], dimensions, LEAF))
    near = np.full((levels[0], LEAF), TAKEN)
    low = np.full((starts[height], dimensions, FAN), np.inf)
    high = np.full((starts[height], dimensions, FAN), -np.inf)
    top = np.full((starts[height], FAN), TAKEN)
    leaf = place = 0
    for i in range(size):
        near[i // LEAF, i % LEAF] = np.inf
        if order[i] == first:
            leaf, place = i // LEAF, i % LEAF
        for k in range(dimensions):
            at[i // LEAF, k, i % LEAF] = points[order[i], k]
    for node in range(levels[0]):
        filled = min(size - node * LEAF, LEAF)
        for k in range(dimensions):
            least = most = at[node, k, 0]
            for i in range(filled):
                value = at[node, k, i]
                least = value if value < least else least
                most = value if value > most else most
            low[node // FAN, k, node % FAN] = least
            high[node // FAN, k, node % FAN] = most
        top[node // FAN, node % FAN] = np.inf
    for level in range(1, height):
        for group in range(starts[level - 1], starts[level]):
            node = group - starts[level - 1]
            parent, child = starts[level] + node // FAN, node % FAN
            top[parent, child] = np.inf
            for k in range(dimensions):
                for i in range(FAN):
                    low[parent, k, child] = min(low[parent, k, child], low[group, k, i])
                    high[parent, k, child] = max(high[parent, k, child], high[group, k, i])

    taken = np.empty(count, np.int32)
    new = np.empty(dimensions)
    away = np.empty(FAN)
    squared = np.empty(LEAF)
    touched = np.zeros((height, levels[0]), np.int32)
    many = np.zeros(height, np.int64)
    for rank in range(count):
        if rank > 0:
            leaf = 0
            for level in range(height - 2, -1, -1):
                leaf = leaf * FAN + _largest(top[starts[level] + leaf])
            place = _largest(near[leaf])
            if near[leaf, place] <= 0:
                return taken[:rank]
        taken[rank] = order[leaf * LEAF + place]
        near[leaf, place] = TAKEN
        for k in range(dimensions):
            new[k] = at[leaf, k, place]
        touched[height - 1, 0], many[height - 1] = 0, 1
        for level in range(height - 2, -1, -1):
            found = 0
            for i in range(many[level + 1]):
                node = touched[level + 1, i]
                group = starts[level] + node
                tops = top[group]
                _outside(low[group], high[group], new, away)
                for child in range(FAN):
                    if away[child] < tops[child]:
                        touched[level, found] = node * FAN + child
                        found += 1
            many[level] = found
        for i in range(many[0]):
            node = touched[0, i]
            largest = _nearer(at[node], new, near[node], squared)
            top[node // FAN, node % FAN] = largest
        for level in range(1, height - 1):
            for i in range(many[level]):
                node = touched[level, i]
                tops = top[starts[level - 1] + node]
                largest = TAKEN
                for child in range(FAN):
                    largest = tops[child] if tops[child] > largest else largest
                top[starts[level] + node // FAN, node % FAN] = largest
    return taken
