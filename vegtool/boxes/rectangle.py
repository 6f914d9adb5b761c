"""The rectangle of least area around points of a plane, exactly.

Freeman, Shapira: Determining the minimum-area encasing rectangle for an arbitrary closed curve
(1975): one of its sides lies along an edge of the convex hull. All edges are tried at once, on the
hull of the few points that a ring of directions does not show to be inside.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray

RING = 16
"""Directions whose extreme points span the polygon that discards inner points."""


def least_rectangle(points: FloatArray) -> FloatArray:
    """Unit vector (2,) along a side of the rectangle of least area around points (n, 2).

    Points on one line give its direction; equal points give (1, 0).
    """
    hull = convex_hull(outer_points(points))
    edges = np.roll(hull, -1, axis=0) - hull
    length = np.hypot(edges[:, 0], edges[:, 1])
    edges, length = edges[length > 0], length[length > 0]
    if not len(edges):
        return np.array([1.0, 0.0])
    edges /= length[:, None]
    hull = hull - hull[0]
    along = hull[:, 0] * edges[:, :1] + hull[:, 1] * edges[:, 1:]
    across = hull[:, 1] * edges[:, :1] - hull[:, 0] * edges[:, 1:]
    area = np.ptp(along, axis=1) * np.ptp(across, axis=1)
    return np.asarray(edges[area.argmin()])


def outer_points(points: FloatArray) -> FloatArray:
    """The points that are not strictly inside the polygon of a ring of extreme points."""
    if len(points) <= 2 * RING:
        return points
    angle = 2 * np.pi * np.arange(RING) / RING
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    polygon = points[np.einsum("rj,nj->rn", ring, points).argmax(axis=1)]
    edge = np.roll(polygon, -1, axis=0) - polygon
    side = edge[:, :1] * (points[:, 1] - polygon[:, 1:]) - edge[:, 1:] * (
        points[:, 0] - polygon[:, :1]
    )
    real = np.abs(edge).max(axis=1) > 0
    if not real.any():
        return points[:1]  # all are the same point
    outside = ~(side[real] > 0).all(axis=0)
    return np.asarray(points[outside])


def convex_hull(points: FloatArray) -> FloatArray:
    """Corners (h, 2) of the convex hull, counter-clockwise (Andrew's monotone chain, 1979)."""
    ordered = [(float(x), float(y)) for x, y in np.unique(points, axis=0)]
    if len(ordered) < 3:
        return np.array(ordered)
    lower, upper = half_hull(ordered), half_hull(ordered[::-1])
    return np.array(lower[:-1] + upper[:-1])


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
