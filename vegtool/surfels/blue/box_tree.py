"""Farthest-first traversal with a tree of boxes, compiled.

Gonzalez: Clustering to minimize the maximum intercluster distance (1985) has the order. Buckets of
points that remember their largest distance, so that most are left alone, are as in Han et al.:
QuickFPS (2023); here they are few neighbours along a Morton curve, with a tree of boxes above them,
eight to a node, which gives both the farthest point and all whose distance a new one changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.surfels.blue.compiled import compiled

LEAF = 32
"""Points of a leaf."""
FAN = 8
"""Children of a node."""
DIGIT = 11
"""Bits of a key sorted by at a time."""
KEY = 5 * DIGIT
"""Bits of a key."""
TAKEN = -1.0
"""Squared distance of what is taken already, or is no point."""

Keys = npt.NDArray[np.uint64]
Rows = npt.NDArray[np.int64]


def traverse(points: FloatArray, first: int, count: int) -> IntArray:
    """(count,) int32 of points (n, d), beginning with `first`; then always the farthest of those
    taken. 1 <= count <= n. Of equally far ones, any; those at no distance come last, by number."""
    order = _curve(points)
    levels = [-(-len(points) // LEAF)]
    while levels[-1] > 1:
        levels.append(-(-levels[-1] // FAN))
    starts = np.cumsum([0] + [-(-size // FAN) * FAN for size in levels])
    return np.asarray(_traverse(points, order, np.array(levels), starts, first, count))


def _curve(points: FloatArray) -> IntArray:
    """(n,) int32 points along a Morton curve; of the same cell, by number."""
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max())
    bits = KEY // points.shape[1]
    scale = (2**bits - 1) / extent if extent > 0 else 0.0
    return np.asarray(_sorted(_keys(points, low, scale, bits)))


@compiled
def _keys(points: Any, low: Any, scale: float, bits: int) -> Any:
    """(n,) the bits of all coordinates in turn, those of highest weight first."""
    size, dimensions = points.shape
    keys = np.zeros(size, np.uint64)
    spread = np.zeros(256, np.uint64)
    for value in range(256):
        for bit in range(8):
            spread[value] |= np.uint64(((value >> bit) & 1)) << np.uint64(bit * dimensions)
    step = np.uint64(8 * dimensions)
    for i in range(size):
        key = np.uint64(0)
        for k in range(dimensions):
            cell = np.uint64((points[i, k] - low[k]) * scale)
            part = np.uint64(0)
            shift = np.uint64(k)
            for _ in range(0, bits, 8):
                part |= spread[cell & np.uint64(255)] << shift
                cell >>= np.uint64(8)
                shift += step
            key |= part
        keys[i] = key
    return keys


@compiled
def _sorted(keys: Any) -> Any:
    """(n,) int32 the order of keys, equal ones by number: digits from the lowest on."""
    size, digits = len(keys), 1 << DIGIT
    order, other = np.arange(size).astype(np.int32), np.empty(size, np.int32)
    spare = np.empty(size, np.uint64)
    mask = np.uint64(digits - 1)
    for shift in range(0, KEY, DIGIT):
        down = np.uint64(shift)
        place = np.zeros(digits + 1, np.int64)
        for i in range(size):
            place[np.int64((keys[i] >> down) & mask) + 1] += 1
        for digit in range(digits):
            place[digit + 1] += place[digit]
        for i in range(size):
            digit = np.int64((keys[i] >> down) & mask)
            spare[place[digit]] = keys[i]
            other[place[digit]] = order[i]
            place[digit] += 1
        keys, spare = spare, keys
        order, other = other, order
    return order


@compiled
def _traverse(points: Any, order: Any, levels: Any, starts: Any, first: int, count: int) -> Any:
    size, dimensions = points.shape
    height = len(levels)
    leaves = starts[1]
    at = np.zeros((dimensions, leaves * LEAF))
    near = np.full(leaves * LEAF, TAKEN)
    low = np.full((dimensions, starts[height]), np.inf)
    high = np.full((dimensions, starts[height]), -np.inf)
    top = np.full(starts[height], TAKEN)
    slot = 0
    for i in range(size):
        near[i] = np.inf
        if order[i] == first:
            slot = i
        for k in range(dimensions):
            value = points[order[i], k]
            at[k, i] = value
            low[k, i // LEAF] = min(low[k, i // LEAF], value)
            high[k, i // LEAF] = max(high[k, i // LEAF], value)
    top[: levels[0]] = np.inf
    for level in range(1, height):
        top[starts[level] : starts[level] + levels[level]] = np.inf
        for node in range(levels[level - 1]):
            child, parent = starts[level - 1] + node, starts[level] + node // FAN
            for k in range(dimensions):
                low[k, parent] = min(low[k, parent], low[k, child])
                high[k, parent] = max(high[k, parent], high[k, child])

    taken = np.empty(count, np.int32)
    new = np.empty(dimensions)
    away = np.empty(FAN)
    squared = np.empty(LEAF)
    touched = np.zeros((height, levels[0]), np.int32)
    many = np.zeros(height, np.int64)
    for rank in range(count):
        if rank > 0:
            node = 0
            for level in range(height - 2, -1, -1):
                begin = starts[level] + node * FAN
                best = 0
                for child in range(1, FAN):
                    if top[begin + child] > top[begin + best]:
                        best = child
                node = node * FAN + best
            slot = node * LEAF
            for i in range(node * LEAF + 1, (node + 1) * LEAF):
                if near[i] > near[slot]:
                    slot = i
            if near[slot] <= 0:  # only copies of what is taken are left
                rest = np.sort(order[np.flatnonzero(near[:size] == 0)])
                taken[rank:] = rest[: count - rank]
                break
        taken[rank] = order[slot]
        near[slot] = TAKEN
        for k in range(dimensions):
            new[k] = at[k, slot]
        touched[height - 1, 0], many[height - 1] = 0, 1
        for level in range(height - 2, -1, -1):
            found = 0
            for i in range(many[level + 1]):
                node = touched[level + 1, i]
                begin = starts[level] + node * FAN
                for child in range(FAN):
                    away[child] = 0.0
                for k in range(dimensions):
                    place = new[k]
                    for child in range(FAN):
                        out = max(
                            max(low[k, begin + child] - place, place - high[k, begin + child]), 0.0
                        )
                        away[child] += out * out
                for child in range(FAN):
                    if away[child] < top[begin + child]:
                        touched[level, found] = node * FAN + child
                        found += 1
            many[level] = found
        for i in range(many[0]):
            begin = touched[0, i] * LEAF
            for j in range(LEAF):
                squared[j] = 0.0
            for k in range(dimensions):
                place = new[k]
                for j in range(LEAF):
                    out = at[k, begin + j] - place
                    squared[j] += out * out
            largest = TAKEN
            for j in range(LEAF):
                value = min(near[begin + j], squared[j])
                near[begin + j] = value
                largest = max(largest, value)
            top[touched[0, i]] = largest
        for level in range(1, height):
            for i in range(many[level]):
                node = touched[level, i]
                begin = starts[level - 1] + node * FAN
                largest = TAKEN
                for child in range(FAN):
                    largest = max(largest, top[begin + child])
                top[starts[level] + node] = largest
    return taken
