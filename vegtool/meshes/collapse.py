"""Edges of welded surfaces collapsed, by the quadric error of what moves.

Garland, Heckbert: Surface simplification using quadric error metrics (1997), by fast-simplification
(S. Forstmann's Fast-Quadric-Mesh-Simplification), which moves positions and nothing else. A corner
that remains takes the attributes of an original vertex that collapsed into it, the nearest one on
its own texture island.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from fast_simplification import simplify

from vegtool.arrays import FloatArray, IntArray
from vegtool.meshes.pieces import Surface, pieces
from vegtool.plant import Plant


@dataclass(frozen=True, eq=False)
class Collapsed:
    """What is left of a surface of n triangles. positions: (w, 3). faces: (m, 3) int32 into them.

    vertex: (n, 3) int32, what has become of the corners: equal ones where a triangle is gone, -1
    where nothing is left around one.
    """

    positions: FloatArray
    faces: IntArray
    vertex: IntArray


def edges_collapsed(
    surface: Surface, target: int, aggressiveness: float, borders: bool = False
) -> Collapsed:
    """Edges collapsed until `target` triangles are left, or none may go. borders: whether open ones
    stay as they are."""
    used, local = np.unique(surface.faces, return_inverse=True)
    faces = local.reshape(-1, 3).astype(np.int32)
    whole = faces[uncollapsed(faces)]
    if not len(whole):
        return Collapsed(np.empty((0, 3)), whole, np.full(faces.shape, -1, np.int32))
    positions, left, collapses = simplify(
        surface.positions[used],
        whole,
        target_count=min(target, len(whole)),
        agg=aggressiveness,
        return_collapses=True,
        preserve_border=borders,
    )
    vertex = roots(len(used), collapses)[faces]
    kept = np.unique(vertex[uncollapsed(vertex)])
    rank = np.full(len(used), -1, np.int32)
    rank[kept] = np.arange(len(kept))
    return Collapsed(positions, left.astype(np.int32), rank[vertex])


def roots(count: int, collapses: npt.NDArray[np.integer]) -> npt.NDArray[np.int64]:
    """(count,) the vertex that each has become part of. collapses: (c, 2) into which, which."""
    root = np.arange(count)
    root[collapses[:, 1]] = collapses[:, 0]
    while not np.array_equal(root, root[root]):
        root = root[root]
    return root


def uncollapsed(faces: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
    """(n,) which triangles (n, 3) have three different corners."""
    return np.asarray((faces != np.roll(faces, 1, axis=1)).all(axis=1))


def carried(surface: Surface, made: Collapsed) -> Surface:
    """What is left of the surface, each corner with the attributes of an original vertex.

    Of those that collapsed into it, the nearest on the texture island of the corner's triangle,
    which is an original one whose corners have moved.
    """
    source, corner = np.unique(surface.corners, return_inverse=True)
    corner = corner.reshape(-1, 3)
    islands, face_island = pieces(corner)
    island = np.zeros(len(source), np.int64)
    island[corner] = face_island[:, None]
    vertex = np.full(len(source), -1, np.int64)
    vertex[corner] = made.vertex
    origin = np.zeros((len(source), 3))
    origin[corner] = surface.positions[surface.faces]

    moved = np.linalg.norm(origin - made.positions[vertex], axis=1)
    place = vertex * islands + island
    order = np.lexsort((moved, place))
    places, first = np.unique(place[order], return_index=True)
    left = uncollapsed(made.vertex)
    wanted = made.faces.astype(np.int64) * islands + face_island[left, None]
    nearest = source[order[first[np.searchsorted(places, wanted)]]]
    return Surface(made.positions, made.faces, nearest.astype(np.int32))


def assembled(plant: Plant, reduced: list[tuple[int, Surface]]) -> Plant:
    """One plant of the surfaces of its materials, with the attributes that their corners name."""
    positions, source, faces, material = [], [], [], []
    count = 0
    for number, surface in reduced:
        pair = np.stack([surface.faces.ravel(), surface.corners.ravel()], axis=1)
        vertex, index = np.unique(pair, axis=0, return_inverse=True)
        positions.append(surface.positions[vertex[:, 0]])
        source.append(vertex[:, 1])
        faces.append(count + index.reshape(-1, 3))
        material.append(np.full(len(surface.faces), number))
        count += len(vertex)
    origin = np.concatenate(source)
    return Plant(
        name=plant.name,
        positions=np.concatenate(positions) * (plant.radius or 1.0) + plant.center,
        normals=plant.normals[origin],
        uvs=plant.uvs[origin],
        faces=np.concatenate(faces),
        face_material=np.concatenate(material),
        materials=plant.materials,
        colors=None if plant.colors is None else plant.colors[origin],
        source=plant.source,
    )
