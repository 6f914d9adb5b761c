"""Point sets and plants that the tests of the boxes share."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray


def card(center: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """The two triangles (2, 3, 3) of a rectangle with half sides u, v."""
    a, b, c, d = center - u - v, center + u - v, center + u + v, center - u + v
    return np.array([[a, b, c], [a, c, d]])


def box_points(half: tuple[float, float, float], inside: int = 200, seed: int = 0) -> FloatArray:
    """The corners of a box about the origin, and points within."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    within = np.random.default_rng(seed).uniform(-1, 1, (inside, 3))
    return np.concatenate([signs, within]) * half


def some_rotation(seed: int = 3) -> FloatArray:
    """A rotation matrix (3, 3), no axis of which is close to one of the world's."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def one(points: FloatArray) -> IntArray:
    """Labels that put all the points in cluster 0."""
    return np.zeros(len(points), dtype=np.int32)
