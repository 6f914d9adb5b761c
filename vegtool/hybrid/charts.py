"""Pictures for a hybrid's mesh: what a triangle shows is what the original has beneath it.

A chart is a connected part of the mesh whose faces look about the same way. Its picture is taken
along that way, as a billboard's is, of the original's faces: colours and normals finer than the
mesh itself, as in Cohen, Olano, Manocha: Appearance-preserving simplification (1998). A billboard
is a chart that is flat. What would be but a few texels stays coloured by its vertices.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.baking.bake import Charted
from vegtool.boxes.error import surface_samples
from vegtool.hybrid.mesh import Mesh
from vegtool.lod import Billboards, Charts
from vegtool.plant import Plant
from vegtool.refine.planes import billboards_about

CONE = 0.6
"""Cosine: faces of a chart look no farther apart than that from the first of them, 53 degrees."""
LEAST_SIDE, LEAST_AREA = 4.0, 256.0
"""Texels of a picture that is worth its gutters."""
SAMPLES = 4
"""Points of the mesh for each face of the original, about which the nearest is looked for."""
TURNED = 0.25
"""Of the mesh's radius: how far apart points count that look in opposite ways."""


def charted(
    plant: Plant, mesh: Mesh, density: float, reach_m: float
) -> tuple[Mesh, Charts, Charted] | None:
    """A mesh whose vertices are of one chart each, what its faces show, and what is to be baked for
    that; None where all pictures would be small. density: texels per metre. reach_m: metres that
    the original may be off the mesh."""
    chart, axis = cones(mesh)
    planes = facing(billboards_about(mesh.plant, chart, axis), axis)
    sides = 2 * density * planes.half_size
    worth = (sides.min(axis=1) >= LEAST_SIDE) & (sides.prod(axis=1) >= LEAST_AREA)
    if not worth.any():
        return None
    number = np.where(worth, np.cumsum(worth) - 1, -1).astype(np.int32)
    kept = np.flatnonzero(worth)
    planes = taken(planes, kept, reach_m)
    of_face = number[chart]
    face, shows = beneath(plant, mesh, of_face, planes)
    return mesh.split(of_face), Charts(planes, of_face), Charted(planes, face, shows)


def cones(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """(t,) int32 the chart of each face, and (c, 3) which way each looks; the largest faces
    begin."""
    corners = mesh.positions[mesh.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    size, normal = np.linalg.norm(area, axis=1), unit(area)
    beside = neighbours(mesh.place)
    chart = np.full(len(size), -1, dtype=np.int32)
    count = 0
    for seed in np.argsort(-size, kind="stable").tolist():
        if chart[seed] >= 0:
            continue
        looks, chart[seed] = normal[seed], count
        waiting = deque([seed])
        while waiting:
            for other in beside[waiting.popleft()]:
                if chart[other] < 0 and normal[other] @ looks > CONE:
                    chart[other] = count
                    waiting.append(other)
        count += 1
    axes = unit(np.stack([np.bincount(chart, along, count) for along in area.T], axis=1))
    return chart, np.where(axes.any(axis=1, keepdims=True), axes, [0.0, 1.0, 0.0])


def neighbours(faces: IntArray) -> list[list[int]]:
    """Of each triangle (t, 3), those that share an edge with it."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, edge = np.unique(edges, axis=0, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable")
    ends = np.flatnonzero(np.diff(edge.ravel()[order], prepend=-1))
    found: list[list[int]] = [[] for _ in faces]
    for group in np.split(order // 3, ends[1:]):
        for one in group.tolist():
            found[one] += [other for other in group.tolist() if other != one]
    return found


def facing(planes: Billboards, axis: FloatArray) -> Billboards:
    """The same rectangles, seen from where the axes (c, 3) point."""
    away = np.einsum("ci,ci->c", planes.normal, axis) < 0
    return replace(planes, u=np.where(away[:, None], -planes.u, planes.u))


def taken(planes: Billboards, rows: npt.NDArray[np.integer], reach_m: float) -> Billboards:
    """Some of them, deep enough for what is so far off."""
    return Billboards(
        planes.center[rows], planes.u[rows], planes.v[rows], planes.half_size[rows],
        planes.half_depth[rows] + reach_m, np.arange(len(rows), dtype=np.int32),
    )  # fmt: skip


def beneath(
    plant: Plant, mesh: Mesh, of_face: IntArray, planes: Billboards
) -> tuple[IntArray, IntArray]:
    """(m,), (m,) int32: faces of the original that the mesh stands for and the chart that is to
    show each: that of the nearest place of the mesh that looks alike, and those of the faces beside
    it, where these see its front."""
    from scipy.spatial import cKDTree

    own = mesh.stands_for
    triangle, points = surface_samples(mesh.plant, SAMPLES * max(len(own), len(mesh.faces)))
    radius = mesh.plant.radius or 1.0
    looks = unit(mesh.plant.face_area_vectors / radius**2)[triangle]
    normal = unit(plant.face_area_vectors[own] / radius**2)
    turned = TURNED * radius
    tree = cKDTree(np.concatenate([points, turned * looks], axis=1))
    near = tree.query(np.concatenate([plant.face_centroids[own], turned * normal], axis=1))[1]
    nearest = of_face[triangle[near]]
    # the faces about a place are in each other's charts, so that pictures reach over their edges
    place = np.unique(np.round(plant.corners[own].reshape(-1, 3) / radius, 6), axis=0,
                      return_inverse=True)[1].reshape(-1, 3)  # fmt: skip
    row = np.arange(len(own))
    at = np.unique(np.stack([place.ravel(), np.repeat(nearest, 3)], axis=1), axis=0)
    at = at[at[:, 1] >= 0]
    first = np.searchsorted(at[:, 0], np.arange(place.max(initial=-1) + 2))
    count = first[place + 1] - first[place]
    rows = np.repeat(np.repeat(row, 3), count.ravel())
    nth = np.arange(len(rows)) - np.repeat(np.cumsum(count.ravel()) - count.ravel(), count.ravel())
    shows = at[np.repeat(first[place].ravel(), count.ravel()) + nth, 1]
    pair = np.unique(np.stack([rows, shows], axis=1), axis=0)
    front = np.einsum("mi,mi->m", normal[pair[:, 0]], planes.normal[pair[:, 1]]) > 0
    pair = pair[front]
    return own[pair[:, 0]].astype(np.int32), pair[:, 1].astype(np.int32)
