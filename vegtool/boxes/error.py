"""How far billboards draw a plant's surface from where it is: `geometric_error_m`."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.lod import Billboards
from vegtool.plant import Plant

SAMPLES = 65536
"""Points on the surface, each for the same area."""


def geometric_error(plant: Plant, labels: IntArray, billboards: Billboards) -> tuple[float, float]:
    """Greatest and 95th percentile distance, metres, from surface points to where they are drawn.

    labels: (f,) the cluster of each face. The plane that shows a point counts; of crossed planes
    the nearest one does. Points are spread evenly over the area, the same ones at every call.
    Raises ValueError where a cluster that has faces has no billboard.
    """
    face, points = surface_samples(plant, SAMPLES)
    cluster = labels[face]
    order = np.argsort(billboards.cluster, kind="stable")
    per_cluster = np.bincount(billboards.cluster, minlength=int(labels.max()) + 1)
    if not per_cluster[cluster].all():
        raise ValueError("geometric_error: every cluster needs a billboard")
    first = np.cumsum(per_cluster) - per_cluster
    distance = np.full(len(points), np.inf)
    for nth in range(int(per_cluster.max())):
        plane = order[first[cluster] + np.minimum(nth, per_cluster[cluster] - 1)]
        offset = points - billboards.center[plane]
        away = np.abs(np.einsum("ni,ni->n", offset, billboards.normal[plane]))
        distance = np.minimum(distance, away)
    return float(distance.max()), float(np.quantile(distance, 0.95))


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
