"""What a billboard shows beyond its own: the surface that goes on from it, within its margin.

Where one billboard ends and the next begins, each covers part of a texel, and both would let the
background through. So a billboard is larger than its box, and shows what is connected with its own
surface there too: it lies as near to the plane as that does. Not in Holst and Schumann (2007).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.lod import Billboards
from vegtool.meshes.pieces import WELD
from vegtool.plant import Plant
from vegtool.surfels.box import SurfelBoxes
from vegtool.surfels.hierarchy import SurfelHierarchy

MARGIN = 0.25
"""Texels that a billboard is larger than its box, on each side. Of levels of a rabbit and a statue
more showed as thorns about the silhouette, and less as holes."""

Longs = npt.NDArray[np.int64]


def billboards_of(one: SurfelHierarchy) -> Billboards:
    """The billboards as they are drawn, with their margins."""
    return with_margin(one.boxes, MARGIN * one.error)


def with_margin(boxes: SurfelBoxes, margin: FloatArray) -> Billboards:
    """Billboards as a level has them, o1 to the right, o2 up, so many metres larger than their
    boxes on each side, and reaching as far from their planes at least; (b,)."""
    number = np.arange(len(boxes), dtype=np.int32)
    half = boxes.half[:, :2] + margin[:, None]
    depth = np.maximum(boxes.half[:, 2], margin)
    return Billboards(boxes.center, boxes.axes[:, 0], boxes.axes[:, 1], half, depth, number)


def going_on(
    plant: Plant, face: IntArray, shown_by: IntArray, planes: Billboards, half_depth: FloatArray
) -> tuple[IntArray, IntArray]:
    """(k,), (k,) int32 further faces, and the billboard that is to show each.

    face, shown_by: (m,) int32 the faces of a plant that each billboard shows as its own. planes: as
    large as they are drawn. half_depth: (b,) metres that they reach to either side. A face goes on
    from another where both share a vertex within that box.
    """
    vertices, count = welded(plant), len(plant.faces)
    incident = np.argsort(vertices.ravel(), kind="stable") // 3
    degree = np.bincount(vertices.ravel())
    first = np.cumsum(degree) - degree
    at = np.empty((len(degree), 3))
    at[vertices.ravel()] = plant.positions[plant.faces.ravel()]

    known = np.sort(shown_by.astype(np.int64) * count + face)
    begun = known
    found = [np.empty(0, dtype=np.int64)]
    while len(begun):
        corner = (begun // count)[:, None] * len(degree) + vertices[begun % count]
        key, times = np.unique(corner, return_counts=True)
        by, vertex = key // len(degree), key % len(degree)
        edge = times < degree[vertex]  # others have it as a corner too
        by, vertex = by[edge], vertex[edge]
        inside = _within(at[vertex], by, planes, half_depth)
        by, vertex = by[inside], vertex[inside]
        nth = np.arange(int(degree[vertex].sum())) - np.repeat(
            np.cumsum(degree[vertex]) - degree[vertex], degree[vertex]
        )
        faces = incident[np.repeat(first[vertex], degree[vertex]) + nth]
        new = np.unique(np.repeat(by, degree[vertex]) * count + faces)
        place = np.searchsorted(known, new)
        begun = new[known[np.minimum(place, len(known) - 1)] != new]
        known = np.sort(np.concatenate([known, begun]))
        found.append(begun)
    more = np.sort(np.concatenate(found))
    return (more % count).astype(np.int32), (more // count).astype(np.int32)


def welded(plant: Plant) -> IntArray:
    """(f, 3) int32 faces by where their corners are, whatever their attributes or material."""
    local = (plant.positions - plant.center) / (plant.radius or 1.0)
    cell = np.rint(local / WELD).astype(np.int64)[plant.faces].reshape(-1, 3)
    _, place = np.unique(cell, axis=0, return_inverse=True)
    return place.reshape(-1, 3).astype(np.int32)


def _within(
    points: FloatArray, by: Longs, planes: Billboards, half_depth: FloatArray
) -> npt.NDArray[np.bool_]:
    offset = points - planes.center[by]
    reach = np.concatenate([planes.half_size, half_depth[:, None]], axis=1)[by]
    axes = np.stack([planes.u, planes.v, planes.normal], axis=1)[by]
    return np.asarray((np.abs(np.einsum("nij,nj->ni", axes, offset)) <= reach).all(axis=1))
