"""The rectangle of least area around points of a plane, exactly.

Freeman, Shapira: Determining the minimum-area encasing rectangle for an arbitrary closed curve
(1975): one of its sides lies along an edge of the convex hull. All edges are tried at once, on the
hull of the few points that a ring of directions does not show to be inside.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray

RING = 8
"""Directions, of half a turn, whose extreme points span the polygon that discards inner points."""


def least_rectangle(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The rectangle of least area around points (2, n).

    Returns a unit vector (2,) along one of its sides, and its least and greatest coordinate (2,)
    along that and along the direction a quarter turn on. Points on one line give its direction,
    equal points (1, 0).
    """
    hull = convex_hull(outer_points(points))
    edge = np.roll(hull, -1, axis=1) - hull
    length = np.hypot(edge[0], edge[1])
    if not length.any():
        return np.array([1.0, 0.0]), hull[:, 0], hull[:, 0]
    x, y = edge[:, length > 0] / length[length > 0]
    along = x[:, None] * hull[0] + y[:, None] * hull[1]
    across = x[:, None] * hull[1] - y[:, None] * hull[0]
    low = np.stack([along.min(axis=1), across.min(axis=1)])
    high = np.stack([along.max(axis=1), across.max(axis=1)])
    best = (high - low).prod(axis=0).argmin()
    return np.array([x[best], y[best]]), low[:, best], high[:, best]


def outer_points(points: FloatArray) -> FloatArray:
    """Those of the points (2, n) that are not strictly inside a polygon of extreme ones."""
    if points.shape[1] <= 2 * RING:
        return points
    turn = np.pi * np.arange(RING) / RING
    along = np.cos(turn)[:, None] * points[0] + np.sin(turn)[:, None] * points[1]
    corner = points[:, np.concatenate([along.argmax(axis=1), along.argmin(axis=1)])]
    edge = np.roll(corner, -1, axis=1) - corner
    real = edge.any(axis=0)
    if not real.any():
        return points[:, :1]  # all are the same point
    (x, y), (cx, cy) = edge[:, real], corner[:, real]
    left_of = x[:, None] * points[1] - y[:, None] * points[0] > (x * cy - y * cx)[:, None]
    return np.asarray(points[:, ~left_of.all(axis=0)])


def convex_hull(points: FloatArray) -> FloatArray:
    """Corners (2, h) of the convex hull, counter-clockwise (Andrew's monotone chain, 1979)."""
    ordered = sorted(set(zip(*points.tolist(), strict=True)))
    if len(ordered) < 3:
        return np.array(ordered).T
    return np.array(half_hull(ordered)[:-1] + half_hull(ordered[::-1])[:-1]).T


def half_hull(ordered: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The chain of left turns from the first to the last of ordered points."""
    chain: list[tuple[float, float]] = []
    for x, y in ordered:
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2], chain[-1]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                break
            chain.pop()
        chain.append((x, y))
    return chain
