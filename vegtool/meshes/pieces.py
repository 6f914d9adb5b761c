"""The connected pieces of one material's surface: branches and leaves, as a reduction sees them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vegtool.arrays import FloatArray, IntArray
from vegtool.plant import Plant

WELD = 2.0**-19
"""Of the plant's radius: vertices of one material this close are one, whatever their attributes."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one material, welded.

    positions: (w, 3) in plant radii about its center. faces: (n, 3) int32 into them. corners:
    (n, 3) int32, the plant's vertices that give the corners their attributes.
    """

    positions: FloatArray
    faces: IntArray
    corners: IntArray

    def of(self, keep: npt.NDArray[np.bool_]) -> Surface:
        """Those of its triangles, of (n,) bool."""
        return replace(self, faces=self.faces[keep], corners=self.corners[keep])

    @property
    def areas(self) -> FloatArray:
        """(n,) of the triangles, in squared plant radii."""
        a, b, c = (self.positions[self.faces[:, i]] for i in range(3))
        return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


def welded(plant: Plant, material: int) -> Surface:
    """The faces of a material with vertices at one position made one; faces without area go."""
    corners = plant.faces[plant.face_material == material]
    used, corner = np.unique(corners, return_inverse=True)
    local = (plant.positions[used] - plant.center) / (plant.radius or 1.0)
    cell = np.rint(local / WELD).astype(np.int64)
    _, first, place = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    faces = place.ravel()[corner.reshape(-1, 3)].astype(np.int32)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Surface(local[first], faces[whole], corners[whole])


def all_welded(plant: Plant) -> Surface:
    """All faces of a plant, in its order, with vertices of one material at one position made one;
    faces without area stay."""
    local = (plant.positions - plant.center) / (plant.radius or 1.0)
    cell = np.rint(local / WELD).astype(np.int64)[plant.faces].reshape(-1, 3)
    key = np.column_stack([cell, np.repeat(plant.face_material, 3)])
    _, first, place = np.unique(key, axis=0, return_index=True, return_inverse=True)
    positions = local[plant.faces.ravel()[first]]
    return Surface(positions, place.reshape(-1, 3).astype(np.int32), plant.faces)


def pieces(faces: npt.NDArray[np.integer]) -> tuple[int, IntArray]:
    """How many connected pieces the triangles (n, 3) form, and (n,) int32 the piece of each."""
    if not len(faces):
        return 0, np.empty(0, np.int32)
    used, own = np.unique(faces, return_inverse=True)
    own, vertices = own.reshape(-1, 3), len(used)
    start, end = np.concatenate([own[:, :2], own[:, 1:]]).T
    joined = coo_matrix((np.ones(len(start), bool), (start, end)), shape=(vertices, vertices))
    _, label = connected_components(joined, directed=False)
    present, piece = np.unique(label[own[:, 0]], return_inverse=True)
    return len(present), piece.astype(np.int32)


def open_edges(faces: IntArray) -> IntArray:
    """(e, 2) int32 edges of one triangle alone, as it turns."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    _, nth, uses = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return np.asarray(edges[uses[nth.ravel()] == 1], dtype=np.int32)
