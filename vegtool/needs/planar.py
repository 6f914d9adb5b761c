"""Distances in the plane of x and z, in metres: of rectangles and points from segments and areas.

Rectangles (n, 2) are given by their least and greatest corners; points by twice the same array.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray

BoolArray = npt.NDArray[np.bool_]

PARALLEL = 1e-300
"""Instead of the 0 metres that a segment goes along an axis."""


def gaps(low: FloatArray, high: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(n, s) least distance of rectangles from segments (s, 2); 0 where they meet."""
    if low is high:
        return _from_points(low, start, end)
    found = np.minimum(_from_rectangles(low, high, start), _from_rectangles(low, high, end))
    for x in (low, high):
        for z in (low, high):
            corner = np.stack([x[:, 0], z[:, 1]], axis=1)
            found = np.minimum(found, _from_points(corner, start, end))
    found[_meet(low, high, start, end)] = 0.0
    return found


def reaches(low: FloatArray, high: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(n, s) greatest distance between any point of a rectangle and any of a segment."""
    sides = []
    for point in (start, end):
        away = np.maximum(np.abs(point - low[:, None]), np.abs(point - high[:, None]))
        sides.append(np.hypot(away[..., 0], away[..., 1]))
    return np.asarray(np.maximum(*sides))


def within(points: FloatArray, corners: FloatArray) -> BoolArray:
    """(n,) whether points are in a polygon (v, 2): a ray along +x leaves it once more than it
    enters. Of two parts that overlap, what both cover is outside."""
    x, z = points[:, None, 0], points[:, None, 1]
    (ax, az), (bx, bz) = corners.T, np.roll(corners, -1, axis=0).T
    crosses = (az > z) != (bz > z)
    along = np.divide(z - az, bz - az, out=np.zeros(crosses.shape), where=crosses)
    hits = crosses & (x < ax + along * (bx - ax))
    return np.asarray(hits.sum(axis=1) % 2 == 1)


def _from_points(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    x, z = points[:, None, 0] - start[:, 0], points[:, None, 1] - start[:, 1]
    dx, dz = (end - start).T
    square = np.maximum(dx * dx + dz * dz, PARALLEL)
    share = np.clip((x * dx + z * dz) / square, 0.0, 1.0)
    return np.asarray(np.hypot(x - share * dx, z - share * dz))


def _from_rectangles(low: FloatArray, high: FloatArray, point: FloatArray) -> FloatArray:
    away = np.maximum(np.maximum(low[:, None] - point, point - high[:, None]), 0.0)
    return np.hypot(away[..., 0], away[..., 1])


def _meet(low: FloatArray, high: FloatArray, start: FloatArray, end: FloatArray) -> BoolArray:
    """(n, s) whether some of a segment is in a rectangle: clipped as Liang and Barsky (1984) do."""
    way = end - start
    way = np.where(way == 0, PARALLEL, way)
    with np.errstate(over="ignore"):
        one, other = (low[:, None] - start) / way, (high[:, None] - start) / way
    enters = np.minimum(one, other).max(axis=2)
    leaves = np.maximum(one, other).min(axis=2)
    return np.asarray((enters <= leaves) & (leaves >= 0) & (enters <= 1))
