"""How far points are from triangles."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray


def to_triangles(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(n,) from points (n, 3) to their triangles (n, 3, 3): to the plane above the inside, else to
    the nearest edge (Ericson, Real-Time Collision Detection, 2005, section 5.1)."""
    edges = np.roll(corners, -1, axis=1) - corners
    offset = points[:, None] - corners
    square = np.einsum("nci,nci->nc", edges, edges)
    along = np.einsum("nci,nci->nc", offset, edges)
    share = np.clip(np.divide(along, square, out=np.zeros_like(along), where=square > 0), 0, 1)
    nearest = np.linalg.norm(offset - share[..., None] * edges, axis=-1).min(axis=1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    length = np.linalg.norm(normal, axis=1)
    inward = np.cross(normal[:, None], edges)
    above = (np.einsum("nci,nci->nc", offset, inward) >= 0).all(axis=1) & (length > 0)
    height = np.abs(np.einsum("ni,ni->n", offset[:, 0], normal))
    return np.asarray(np.divide(height, length, out=nearest, where=above))
