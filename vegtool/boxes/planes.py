"""Boxes about the plane that suits both the places and the directions of a cluster's faces.

Measured against the boxes of least volume in docs/methods/boxes.md. The normal is
the eigenvector with the smallest eigenvalue of

    scatter / trace(scatter)  -  mean of n n^T over the area

scatter being the second moment of the cluster's surface about its centroid: a direction in which
the cluster is thin, and towards which its faces look. In that plane the sides follow the rectangle
of least area.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.boxes.box import Boxes
from vegtool.boxes.groups import Groups
from vegtool.boxes.rectangle import least_rectangle


def oriented_planes(corners: FloatArray, cluster: IntArray, count: int) -> Boxes:
    """A box per cluster whose third axis is the normal of its best plane.

    corners: (f, 3, 3) metres, the faces' corners. cluster: (f,) 0..count-1. The first two axes are
    the longer and the shorter side of the rectangle of least area around the faces' projection.
    A cluster without faces gets a box of no size at the origin.
    """
    center, half = np.zeros((count, 3)), np.zeros((count, 3))
    axes = np.tile(np.eye(3), (count, 1, 1))
    if not len(corners):
        return Boxes(center, axes, half)
    groups = Groups(cluster)
    first = corners[groups.order[groups.starts[:-1]], 0]
    local = corners[groups.order] - groups.spread(first)[:, None]
    normal = plane_normals(local, groups)
    for group, part in enumerate(groups.slices()):
        k = groups.present[group]
        points = local[part].reshape(-1, 3)
        axes[k], center[k], half[k] = box_about(points, normal[group])
    center[groups.present] += first
    return Boxes(center, axes, half)


def plane_normals(local: FloatArray, groups: Groups) -> FloatArray:
    """Unit normals (g, 3) of the planes, from corners (f, 3, 3) sorted by group."""
    size = np.sqrt(groups.greatest((local**2).sum(axis=2).max(axis=1)))
    local = local / groups.spread(np.where(size > 0, size, 1.0))[:, None, None]
    vector = 0.5 * np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])
    area = np.linalg.norm(vector, axis=1)
    total = groups.sum(area)
    weight = np.where(groups.spread(total) > 0, area, 1.0)  # no area at all: every face alike
    total = groups.sum(weight)
    centroid = local.mean(axis=1)
    mean = groups.sum(weight[:, None] * centroid) / total[:, None]
    offset = local - groups.spread(mean)[:, None]
    middle = centroid - groups.spread(mean)
    # A triangle's second moment about a point is area / 12 (sum of v v^T + 9 c c^T).
    moment = np.einsum("fci,fcj->fij", offset, offset)
    moment += 9 * middle[:, :, None] * middle[:, None, :]
    scatter = groups.sum(weight[:, None, None] / 12 * moment)
    trace = np.trace(scatter, axis1=1, axis2=2)
    scatter /= np.where(trace > 0, trace, 1.0)[:, None, None]
    facing = unit(vector)
    outer = groups.sum(weight[:, None, None] * facing[:, :, None] * facing[:, None, :])
    _, vectors = np.linalg.eigh(scatter - outer / total[:, None, None])
    return np.asarray(vectors[:, :, 0])


def box_about(points: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axes (3, 3), center (3,) and half extents (3,) of the least box with that third axis."""
    across = np.eye(3)[np.abs(normal).argmin()]
    a = np.cross(normal, across)
    a /= np.linalg.norm(a)
    b = np.cross(normal, a)
    flat = np.einsum("ij,nj->ni", np.stack([a, b]), points)
    direction = least_rectangle(flat)
    first = direction[0] * a + direction[1] * b
    axes = np.stack([first, np.cross(normal, first), normal])
    along = np.einsum("ij,nj->in", axes, points)
    low, high = along.min(axis=1), along.max(axis=1)
    half = (high - low) / 2
    center = (high + low) / 2 @ axes
    if half[1] > half[0]:
        axes = np.stack([axes[1], -axes[0], axes[2]])
        half = half[[1, 0, 2]]
    return axes, center, half
