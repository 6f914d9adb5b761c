"""Polygons to triangles: fans where the polygon is convex, ears cut off where it is not."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.parts import IndexArray


def triangulate(corners: IndexArray, points: FloatArray) -> IndexArray:
    """(n * (k - 2), 3) places in 0..k-1 of the triangles of n polygons, those of one together.

    corners: (n, k) indices into points (p, 3). A convex polygon becomes a fan around its first
    corner; another (a leaf's outline, say) loses ears one by one, so that no triangle leaves it.
    """
    count, size = corners.shape
    steps = np.arange(1, size - 1)
    fan = np.stack([np.zeros_like(steps), steps, steps + 1], axis=1)
    places = np.broadcast_to(fan, (count, size - 2, 3)).copy()
    if size > 3:
        with np.errstate(invalid="ignore", over="ignore"):  # broken points, dropped later
            rings = points[corners] - points[corners].mean(axis=1, keepdims=True)
        for row in np.flatnonzero(~_convex(rings)):
            places[row] = _ears(rings[row])
    return places.reshape(-1, 3)


def _convex(rings: FloatArray) -> np.ndarray:
    """(n,) bool: polygons (n, k, 3) that turn the same way at every corner. Broken ones pass."""
    with np.errstate(invalid="ignore", over="ignore"):
        before, after = np.roll(rings, 1, axis=1), np.roll(rings, -1, axis=1)
        turns = np.cross(rings - before, after - rings)
        normal = np.cross(rings, after).sum(axis=1, keepdims=True)
        along = (turns * normal).sum(axis=2)
        slack = 1e-9 * np.abs(along).max(axis=1, keepdims=True)
        return np.asarray(~(along < -slack).any(axis=1))


def _ears(ring: FloatArray) -> IndexArray:
    """(k - 2, 3) triangles of one polygon (k, 3), by ear clipping in the plane of its normal."""
    normal = np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
    drop = int(np.abs(normal).argmax())
    flat = np.delete(ring, drop, axis=1) * ([1, -1] if drop == 1 else [1, 1])
    if normal[drop] < 0:
        flat = flat * [1, -1]
    left = list(range(len(ring)))
    triangles = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(flat, left, k)), 0)
        triangles.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    return np.array([*triangles, left])


def _is_ear(flat: FloatArray, left: list[int], k: int) -> bool:
    """Whether corner k bulges and no other corner lies in its triangle."""
    a, b, c = (flat[left[(k + step) % len(left)]] for step in (-1, 0, 1))
    if _turn(a, b, c) <= 0:
        return False
    others = [flat[i] for i in left if i not in (left[k - 1], left[k], left[(k + 1) % len(left)])]
    return not any(
        _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0 for p in others
    )


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
