"""Repairs that every format needs: faces that cannot be drawn, and normals that are missing.

Nothing is repaired in silence: each function returns how much it changed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, unit
from vegtool.formats.parts import IndexArray

LARGEST = 1e15
"""File units: a coordinate beyond it is as broken as an infinite one."""
FLATTEST = 1e-10
"""Height of a triangle over its longest edge, below which it has no area worth drawing: far above
the rounding of float64 on centred positions, far below the thinnest blade of grass."""


def usable_rows(values: FloatArray, limit: float = LARGEST) -> npt.NDArray[np.bool_]:
    """(n,) bool: rows without NaN and with all values within -limit..limit."""
    if not values.size or -limit < values.min() <= values.max() < limit:
        return np.ones(len(values), dtype=np.bool_)  # nearly always, and many times faster
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(values) < limit).all(axis=1))


def bounds(points: FloatArray) -> FloatArray:
    """(2, 3) least and greatest coordinates; by columns, which is much faster than along axis 0."""
    return np.array([[column.min() for column in points.T], [column.max() for column in points.T]])


def flat_faces(positions: FloatArray, faces: IndexArray) -> np.ndarray:
    """(f,) bool: faces without area."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    ab, ac = b - a, c - a
    longest = np.maximum(np.maximum(_squared(ab), _squared(ac)), _squared(c - b))
    return np.asarray(_squared(np.cross(ab, ac)) <= FLATTEST**2 * longest**2)


def repeated_faces(
    positions: FloatArray, uvs: FloatArray, faces: IndexArray, group: IndexArray
) -> np.ndarray:
    """(f,) bool: faces that repeat an earlier one exactly: the same three positions and texture
    coordinates in the same order of turning, in the same group (material).

    Faces that share positions but turn the other way are the two sides of a card and are kept.
    Candidates come from a 64-bit hash, each is then compared with the first of its kind.
    """
    corner = _mix(_row_hash(np.concatenate([positions, uvs], axis=1))[faces])
    start = np.argmin(corner, axis=1)
    turned = faces[np.arange(len(faces))[:, None], (start[:, None] + np.arange(3)) % 3]
    ordered = np.take_along_axis(corner, (start[:, None] + np.arange(3)) % 3, axis=1)
    key = group.astype(np.uint64)
    for k in range(3):
        key = _mix(key ^ ordered[:, k])
    order = np.argsort(key, kind="stable")
    repeats = np.zeros(len(faces), dtype=bool)
    new_run = np.r_[True, key[order][1:] != key[order][:-1]]
    first = order[np.maximum.accumulate(np.where(new_run, np.arange(len(order)), 0))]
    later, earlier = order[~new_run], first[~new_run]
    same = (
        (positions[turned[later]] == positions[turned[earlier]]).all(axis=(1, 2))
        & (uvs[turned[later]] == uvs[turned[earlier]]).all(axis=(1, 2))
        & (group[later] == group[earlier])
    )
    repeats[later[same]] = True
    return repeats


def smooth_normals(positions: FloatArray, faces: IndexArray, point: IndexArray) -> FloatArray:
    """(v, 3) unit normals, the sum of the area vectors of the faces around each point.

    point: (v,) index of the point that a vertex belongs to; vertices of one point share a normal.
    Vertices of points without faces, or whose faces cancel, get the zero vector.
    """
    a, b, c = (positions[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    corner = point[faces].T.ravel()
    count = int(point.max()) + 1
    total = np.stack(
        [np.bincount(corner, np.tile(area[:, k], 3), minlength=count) for k in range(3)], axis=1
    )
    return unit(np.asarray(total, dtype=np.float64))[point]


def last_face_normals(positions: FloatArray, faces: IndexArray) -> FloatArray:
    """(v, 3) unit normals, each of the last face that uses the vertex; zero where none does."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    normals = np.zeros_like(positions)
    normals[faces] = unit(np.cross(b - a, c - a))[:, None]
    return normals


def _squared(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", vectors, vectors))


def _row_hash(rows: FloatArray) -> np.ndarray:
    """(n,) uint64: equal rows have equal hashes (-0 counts as 0)."""
    bits = np.ascontiguousarray(rows + 0.0).view(np.uint64)
    key = np.zeros(len(rows), dtype=np.uint64)
    for k in range(rows.shape[1]):
        key = _mix(key ^ bits[:, k])
    return key


def _mix(key: np.ndarray) -> np.ndarray:
    """Scatter 64-bit keys (the finaliser of MurmurHash3, public domain)."""
    key = (key ^ (key >> np.uint64(33))) * np.uint64(0xFF51AFD7ED558CCD)
    key = (key ^ (key >> np.uint64(33))) * np.uint64(0xC4CEB9FE1A85EC53)
    return np.asarray(key ^ (key >> np.uint64(33)))
