"""Which way is up in formats that do not say."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.parts import IndexArray

UPRIGHT: dict[str, FloatArray] = {
    "y": np.eye(3),
    "-y": np.diag([1.0, -1.0, -1.0]),
    "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "x": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "-x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}
"""Rotations (never mirrors) that turn each axis of a file to +y."""

GROUND = 0.02
"""A plant stands where its lowest point is this close to 0, as a fraction of its extent."""
BASE = 0.02
"""The lowest fraction of a plant, which holds its foot and little else."""
NARROW = 0.35
"""A foot is narrower than this fraction of the plant."""


def turned(vectors: FloatArray, matrix: FloatArray) -> FloatArray:
    """(n, 3) vectors times a (3, 3) matrix, to the same bits for any number of threads."""
    if np.array_equal(matrix, np.eye(3)):
        return vectors
    return np.asarray(np.einsum("vj,ij->vi", vectors, matrix))


def guess_up(positions: FloatArray, faces: IndexArray, notes: list[str]) -> str:
    """y or z: the axis along which the plant stands on 0, else on a narrow foot, else y.

    Vertices in use, any unit. The guess is appended to `notes`.
    """
    used = positions[np.unique(faces)]
    stands = {axis: _stands_on_zero(used, k) for axis, k in (("y", 1), ("z", 2))}
    if stands["y"] == stands["z"]:
        stands = {axis: _has_narrow_foot(used, k) for axis, k in (("y", 1), ("z", 2))}
    up = "z" if stands["z"] and not stands["y"] else "y"
    sure = stands["y"] != stands["z"]
    reason = "the axis on which it stands" if sure else "nothing in its shape tells"
    notes.append(f"upward axis taken to be {up} ({reason}); --up overrides it")
    return up


def _stands_on_zero(points: FloatArray, axis: int) -> bool:
    low, high = points[:, axis].min(), points[:, axis].max()
    return bool(abs(low) <= GROUND * (high - low))


def _has_narrow_foot(points: FloatArray, axis: int) -> bool:
    height = points[:, axis]
    foot = points[height <= height.min() + BASE * np.ptp(height)]
    across = [k for k in range(3) if k != axis]
    return bool(
        (np.ptp(foot[:, across], axis=0) <= NARROW * np.ptp(points[:, across], axis=0)).all()
    )
