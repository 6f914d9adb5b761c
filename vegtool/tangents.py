"""Per-vertex tangents from texture coordinates, for meshes that carry a normal texture.

Source: E. Lengyel, "Computing Tangent Space Basis Vectors for an Arbitrary Mesh" (2001), with the
signs of glTF 2.0 section 3.7.2.1: bitangent = cross(normal, tangent) * w points to the picture's
top, that is against v. Mirrored texture coordinates need two frames at one vertex, so vertices on
a mirror seam are split.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit

_LEAST_TANGENT = 1e-6  # fraction of a tangent that must remain after removing its normal part


def tangents(
    positions: FloatArray, normals: FloatArray, uvs: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """Tangents for a mesh, after splitting its vertices where mirrored faces meet others.

    positions, normals: (v, 3); uvs: (v, 2); faces: (f, 3). Returns (n, 4) float64 tangents with
    w = +1 or -1; (n,) int32, the old vertex of each new one; (f, 3) int32 faces of new vertices.
    The first v new vertices are the old ones. Faces with no extent in the texture add nothing; a
    vertex that has only such faces gets some direction perpendicular to its normal.
    """
    along_u, along_v, mirrored = _face_frames(positions[faces], uvs[faces])
    origin, split = _split_mirrored(len(positions), faces, mirrored)
    normal = normals[origin]
    tangent = _orthogonal(_sum_at_vertices(split, along_u, len(origin)), normal)
    up = -_sum_at_vertices(split, along_v, len(origin))
    agrees = np.einsum("ij,ij->i", np.cross(normal, tangent), up) >= 0
    w = np.where(agrees, 1.0, -1.0)
    return np.concatenate([tangent, w[:, None]], axis=1), origin, split


def _face_frames(corners: FloatArray, uvs: FloatArray) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Per face, unit vectors of growing u and of growing v, and whether the picture is mirrored."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
    determinant = u1 * v2 - u2 * v1
    sign = np.sign(determinant)[:, None]
    along_u = unit(sign * (v2[:, None] * e1 - v1[:, None] * e2))
    along_v = unit(sign * (u1[:, None] * e2 - u2[:, None] * e1))
    # v runs down the picture: upright faces, counter-clockwise in space, run clockwise in (u, v).
    return along_u, along_v, determinant > 0


def _split_mirrored(count: int, faces: IntArray, mirrored: np.ndarray) -> tuple[IntArray, IntArray]:
    """Give mirrored faces their own copies of the vertices that they share with upright ones."""
    upright_use = np.zeros(count, dtype=bool)
    upright_use[faces[~mirrored]] = True
    mirrored_use = np.zeros(count, dtype=bool)
    mirrored_use[faces[mirrored]] = True
    shared = np.flatnonzero(upright_use & mirrored_use).astype(np.int32)
    copy = np.arange(count, dtype=np.int32)
    copy[shared] = count + np.arange(len(shared), dtype=np.int32)
    split = np.where(mirrored[:, None], copy[faces], faces)
    return np.concatenate([np.arange(count, dtype=np.int32), shared]), split


def _sum_at_vertices(faces: IntArray, vectors: FloatArray, count: int) -> FloatArray:
    """(count, 3): the sum of `vectors` (f, 3) over the faces at each vertex."""
    corners = faces.ravel()
    sums = [np.bincount(corners, np.repeat(vectors[:, k], 3), count) for k in range(3)]
    return np.stack(sums, axis=1)


def _orthogonal(vectors: FloatArray, normals: FloatArray) -> FloatArray:
    """Unit vectors perpendicular to `normals`, nearest to `vectors`; some direction where none."""
    direction = unit(vectors)
    flat = direction - normals * np.einsum("ij,ij->i", direction, normals)[:, None]
    lost = np.linalg.norm(flat, axis=1) < _LEAST_TANGENT
    axis = np.eye(3)[np.abs(normals[lost]).argmin(axis=1)]
    flat[lost] = np.cross(normals[lost], axis)
    return unit(flat)
