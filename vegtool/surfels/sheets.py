"""A plant's triangles as sheets, which can be simplified without tearing them.

A sheet is a surface whose edges have two triangles or one, and about each of whose vertices the
triangles form one fan. Plants are not so: vertices are doubled along seams of textures, leaves have
triangles of their own for their backs, twigs stick in branches, blades meet in one line. So two
triangles are joined along an edge where the choice is plain: where just these two have the edge's
two vertices, or else its two places, in common. Where an edge is left without a second triangle,
both its places are held: nothing that stands there is ever moved, so that no crack opens.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vegtool.arrays import FloatArray, unit
from vegtool.meshes.collapse import uncollapsed
from vegtool.plant import Plant

Labels = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

FOLDED = -0.98
"""Cosine of the angle between normals: triangles back to back (closer than 11 degrees) are not
joined, so that the rim of a thin leaf stays."""


@dataclass(frozen=True, eq=False)
class Sheets:
    """The f triangles of a plant as sheets of w vertices.

    positions: (w, 3) in plant radii about its center. held: (w,) bool, vertices that must stay.
    faces: (f, 3) int64 into them. whole: (f,) bool, faces with three different places; the others
    belong to no sheet. seam: (v,) int64, equal for vertices of the plant at one place that have the
    same texture coordinates and colour. normals: (v, 3), the plant's.
    """

    positions: FloatArray
    held: Flags
    faces: Labels
    whole: Flags
    seam: Labels
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class Triangles:
    """n triangles as they are simplified.

    faces: (n, 3) int64 vertices of the sheets. corners: (n, 3) int64 vertices of the plant. seam:
    (n, 3) int64, equal for corners at one place with the same texture and material. group: (n,)
    int64.
    """

    faces: Labels
    corners: Labels
    seam: Labels
    group: Labels

    def __len__(self) -> int:
        return len(self.faces)

    def of(self, rows: Labels | Flags) -> Triangles:
        """Some of them."""
        return Triangles(self.faces[rows], self.corners[rows], self.seam[rows], self.group[rows])

    def regrouped(self, group: Labels) -> Triangles:
        """The same in other groups."""
        return Triangles(self.faces, self.corners, self.seam, group)


def together(parts: list[Triangles]) -> Triangles:
    """All triangles of the parts, in order."""
    return Triangles(
        np.concatenate([part.faces for part in parts]),
        np.concatenate([part.corners for part in parts]),
        np.concatenate([part.seam for part in parts]),
        np.concatenate([part.group for part in parts]),
    )


def sheets(plant: Plant) -> Sheets:
    """The sheets that a plant consists of. Vertices are at one place if it is the same to the bit:
    a slit, however narrow, stays as it is."""
    local = (plant.positions - plant.center) / (plant.radius or 1.0)
    place = np.unique(plant.positions + 0.0, axis=0, return_inverse=True)[1].ravel()
    corners = place[plant.faces].ravel()
    whole = uncollapsed(place[plant.faces])
    first, second, alone = _joined(plant, place[plant.faces], whole)

    start, end = following(first), following(second)
    opposite = corners[first] == corners[end]
    joined = (
        np.concatenate([first, start]),
        np.concatenate([np.where(opposite, end, second), np.where(opposite, second, end)]),
    )
    ones = np.ones(len(joined[0]), bool)
    graph = coo_matrix((ones, joined), shape=(len(corners), len(corners)))
    count, fan = connected_components(graph, directed=False)
    positions, held, stays = np.empty((count, 3)), np.zeros(len(place), bool), np.zeros(count, bool)
    positions[fan] = local[plant.faces.ravel()]
    held[corners[alone]] = held[corners[following(alone)]] = True
    stays[fan] = held[corners]
    faces = fan.reshape(-1, 3).astype(np.int64)
    return Sheets(positions, stays, faces, whole, _seams(plant, place), plant.normals)


def _joined(plant: Plant, place: Labels, whole: Flags) -> tuple[Labels, Labels, Labels]:
    """(p,), (p,) half-edges that are joined, and (q,) those left alone. place: (f, 3) of corners.

    Half-edge 3 f + i runs from corner i of face f to the next one.
    """
    alone = np.flatnonzero(np.repeat(whole, 3))
    normal = unit(plant.face_area_vectors / (plant.radius or 1.0) ** 2)
    pairs = []
    for ids in (plant.faces.astype(np.int64), place):
        start, end = ids.ravel()[alone], ids.ravel()[following(alone)]
        one, two = pairs_of(edge_keys(start, end))
        side = np.where(start[one] == end[two], 1.0, -1.0)  # neighbours may wind otherwise
        turn = np.einsum("ei,ei->e", normal[alone[one] // 3], normal[alone[two] // 3])
        one, two = one[side * turn > FOLDED], two[side * turn > FOLDED]
        pairs.append(np.stack([alone[one], alone[two]]))
        alone = np.delete(alone, np.concatenate([one, two]))
    first, second = np.concatenate(pairs, axis=1)
    return first, second, alone


def following(half_edge: Labels) -> Labels:
    """The next half-edge of the same face, whose corner is the end of this one."""
    return np.where(half_edge % 3 == 2, half_edge - 2, half_edge + 1)


def edge_keys(start: Labels, end: Labels) -> Labels:
    """(n,) a number for each edge between vertices below 2^31, the same from either end."""
    return (np.minimum(start, end) << 31) | np.maximum(start, end)


def runs(values: Labels) -> Labels:
    """(r,) where in sorted numbers from 0 up (n,) another one begins."""
    return np.flatnonzero(np.diff(values, prepend=-1))


def pairs_of(key: Labels) -> tuple[Labels, Labels]:
    """(p,), (p,) indices of those that have a key (n,) in common with just one other."""
    order = np.argsort(key, kind="stable")
    start = runs(key[order])
    two = start[np.diff(start, append=len(key)) == 2]
    return order[two], order[two + 1]


def _seams(plant: Plant, place: Labels) -> Labels:
    """(v,) vertices by place, texture coordinates and colour; normals do not count."""
    columns = [place.astype(np.float64)[:, None], plant.uvs]
    if plant.colors is not None:
        columns.append(plant.colors)
    rows = np.concatenate(columns, axis=1) + 0.0  # no negative zero
    return np.unique(rows, axis=0, return_inverse=True)[1].ravel().astype(np.int64)
