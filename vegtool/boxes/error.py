"""How far a level draws a plant's surface from where it is: `geometric_error_m`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.lod import Billboards
from vegtool.meshes.distance import to_triangles
from vegtool.plant import Plant

SAMPLES = 65536
"""Points on the surface, each for the same area."""
FEW = 32
"""Triangles of a mesh: of no more, all are looked at."""
NO_AREA = 1e-9
"""Of a mesh's: a triangle with no more shows nothing."""
NEAREST = 8
"""Points of a mesh around a point whose triangles may be the nearest."""


def geometric_error(
    plant: Plant,
    labels: IntArray,
    billboards: Billboards | None,
    mesh: Plant | None = None,
    by_mesh: npt.NDArray[np.bool_] | None = None,
) -> tuple[float, float]:
    """Greatest and 95th percentile distance, metres, from surface points to where they are drawn.

    labels: (f,) the cluster of each face; -1 for faces that no billboard shows. billboards: None
    for a level that is a mesh alone. mesh: of a level that has one; by_mesh: (f,) bool, the faces
    that it shows. What shows a point counts: its plane, of crossed planes the nearest one, or the
    nearest place of the mesh. Points are spread evenly over the area, the same ones at every call;
    what nothing shows is left out. Raises ValueError where a cluster that has faces has no
    billboard, and where nothing is shown.
    """
    face, points = surface_samples(plant, SAMPLES)
    distance = np.full(len(points), np.inf)
    planar = labels[face] >= 0
    if planar.any() and billboards is not None:
        distance[planar] = _to_planes(points[planar], labels[face[planar]], billboards)
    if mesh is not None and by_mesh is not None:
        shown = by_mesh[face]
        distance[shown] = np.minimum(distance[shown], distance_to_mesh(points[shown], mesh))
    distance = distance[np.isfinite(distance)]
    if not len(distance):
        raise ValueError("geometric_error: nothing shows the plant")
    return float(distance.max()), float(np.quantile(distance, 0.95))


def _to_planes(points: FloatArray, cluster: IntArray, billboards: Billboards) -> FloatArray:
    """(n,) metres from points to the nearest plane of their clusters (n,)."""
    order = np.argsort(billboards.cluster, kind="stable")
    per_cluster = np.bincount(billboards.cluster, minlength=int(cluster.max()) + 1)
    if not per_cluster[cluster].all():
        raise ValueError("geometric_error: every cluster needs a billboard")
    first = np.cumsum(per_cluster) - per_cluster
    distance = np.full(len(points), np.inf)
    for nth in range(int(per_cluster.max())):
        plane = order[first[cluster] + np.minimum(nth, per_cluster[cluster] - 1)]
        offset = points - billboards.center[plane]
        away = np.abs(np.einsum("ni,ni->n", offset, billboards.normal[plane]))
        distance = np.minimum(distance, away)
    return distance


def distance_to_mesh(points: FloatArray, mesh: Plant) -> FloatArray:
    """(n,) metres from points (n, 3) to the surface of a mesh.

    Of a FEW triangles with an area, exact. Of more, of those under the nearest of many points
    spread over the mesh: never too small, and exact where one of these triangles is the nearest.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return np.zeros(0)
    nearest = np.full(len(points), np.inf)
    if len(mesh.faces) <= FEW:
        area = mesh.face_areas
        for corners in mesh.corners[area > NO_AREA * area.sum()]:
            nearest = np.minimum(
                nearest, to_triangles(points, np.broadcast_to(corners, (len(points), 3, 3)))
            )
        return nearest
    face, samples = surface_samples(mesh, SAMPLES)
    _, near = cKDTree(samples).query(points, NEAREST)
    for candidate in face[near].T:
        nearest = np.minimum(nearest, to_triangles(points, mesh.corners[candidate]))
    return nearest


def surface_samples(plant: Plant, count: int) -> tuple[IntArray, FloatArray]:
    """Faces (count,) and points (count, 3) metres, evenly spread over the plant's area.

    Evenly spaced along the running sum of the areas; within the faces by Roberts' R2 sequence
    (2018). A plant without area is sampled face by face.
    """
    total = np.cumsum(plant.face_areas)
    if not total[-1] > 0:
        total = np.arange(1.0, len(plant.faces) + 1)
    step = np.arange(count) + 0.5
    face = np.searchsorted(total, step * (total[-1] / count), side="right")
    face = np.minimum(face, len(plant.faces) - 1).astype(np.int32)
    golden = 1.32471795724474602596  # the real root of x^3 = x + 1
    a, b = (step / golden) % 1, (step / golden**2) % 1
    over = a + b > 1
    a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)
    corners = plant.corners[face]
    weights = np.stack([1 - a - b, a, b], axis=1)
    return face, np.einsum("nc,nci->ni", weights, corners)
