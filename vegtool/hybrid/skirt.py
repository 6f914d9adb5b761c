"""Edges of an open surface collapsed, its border too where that is straight.

Garland, Heckbert: Surface simplification using quadric error metrics (1997), section 6, on
preserving boundaries: for each border edge a plane across the surface is added to the quadrics of
its ends. The library takes no planes, so they are given as triangles: a skirt along the border,
which is cut off afterwards.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.meshes.collapse import Collapsed, edges_collapsed, uncollapsed
from vegtool.meshes.pieces import Surface, open_edges


def edges_collapsed_in_skirt(
    surface: Surface, normals: FloatArray, target: int, aggressiveness: float
) -> Collapsed:
    """Edges collapsed until about `target` triangles are left, or fewer.

    surface: of w vertices, all of them used. normals: (w, 3) unit, of these.
    """
    faces, count = surface.faces, len(surface.faces)
    border = open_edges(faces)
    length = np.linalg.norm(np.subtract(*surface.positions[border.T]), axis=1)
    vertices = np.unique(border)
    below = np.full(len(surface.positions), -1, dtype=np.int32)
    below[vertices] = len(surface.positions) + np.arange(len(vertices), dtype=np.int32)
    deep = float(length.mean()) if len(length) else 0.0
    hem = surface.positions[vertices] + deep * normals[vertices]
    start, end = border.T
    skirt = np.concatenate(
        [np.stack([end, start, below[start]], 1), np.stack([end, below[start], below[end]], 1)]
    ).astype(np.int32)
    whole = Surface(
        np.concatenate([surface.positions, hem]),
        np.concatenate([faces, skirt]),
        np.concatenate([surface.corners, np.zeros_like(skirt)]),
    )
    made = edges_collapsed(whole, target * len(whole.faces) // count, aggressiveness)
    own = made.faces[np.flatnonzero(uncollapsed(made.vertex)) < count]
    used, local = np.unique(own, return_inverse=True)
    rank = np.full(len(made.positions) + 1, -1, dtype=np.int32)
    rank[used] = np.arange(len(used), dtype=np.int32)
    return Collapsed(
        made.positions[used], local.reshape(-1, 3).astype(np.int32), rank[made.vertex[:count]]
    )


def sideways(positions: FloatArray, faces: IntArray, normals: FloatArray) -> FloatArray:
    """(w, 3) unit, along the surface and across its border; 0 elsewhere. normals: (w, 3) unit."""
    border = open_edges(faces)
    along = np.zeros_like(positions)
    for end in border.T:
        np.add.at(along, end, positions[border[:, 1]] - positions[border[:, 0]])
    return unit(np.cross(along, normals))
