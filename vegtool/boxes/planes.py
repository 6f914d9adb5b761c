"""Boxes about the plane that suits both the places and the directions of a cluster's faces.

Measured against the boxes of least volume in docs/methods/boxes.md. The normal is
the eigenvector with the smallest eigenvalue of

    scatter / trace(scatter)  -  mean of n n^T over the area

scatter being the second moment of the cluster's surface about its centroid: a direction in which
the cluster is thin, and towards which its faces look. Where several directions are equally good (a
leaf of two crossed cards), the first face decides. In that plane the sides follow the rectangle of
least area.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.boxes.box import Boxes
from vegtool.boxes.groups import Groups
from vegtool.boxes.rectangle import least_rectangle

TIED = 1e-6
"""Eigenvalues, which lie within -1 to 1, that close are equal."""
FAR = 0.618
"""Of the greatest: the first face that looks so much along equally good directions decides."""


def oriented_planes(corners: FloatArray, cluster: IntArray, count: int) -> Boxes:
    """A box per cluster whose third axis is the normal of its best plane.

    corners: (f, 3, 3) metres, the faces' corners. cluster: (f,) 0..count-1. The first two axes are
    the longer and the shorter side of the rectangle of least area around the faces' projection.
    A cluster without faces gets a box of no size at the origin.
    """
    groups = Groups(cluster)
    normal = np.empty((0, 3))
    if len(corners):
        normal = plane_normals(localised(corners, groups)[1], groups)
    return boxes_about(corners, groups, normal, count)


def boxes_about(corners: FloatArray, groups: Groups, normal: FloatArray, count: int) -> Boxes:
    """A box per cluster whose third axis is the given normal.

    corners: (f, 3, 3) metres. groups: the clusters, 0..count-1, of the faces. normal: (g, 3) unit
    vectors of those that have faces. The first two axes are as of `oriented_planes`.
    """
    center, half = np.zeros((count, 3)), np.zeros((count, 3))
    axes = np.tile(np.eye(3), (count, 1, 1))
    if not len(corners):
        return Boxes(center, axes, half)
    origin, local = localised(corners, groups)
    frames = frames_about(normal)
    low, high = np.empty((len(groups), 3)), np.empty((len(groups), 3))
    side = np.empty((len(groups), 2))
    for i, part in enumerate(groups.slices()):
        x, y, depth = np.einsum("ij,jn->in", frames[i], local[:, :, part].reshape(3, -1))
        side[i], low[i, :2], high[i, :2] = least_rectangle(np.stack([x, y]))
        low[i, 2], high[i, 2] = depth.min(), depth.max()
    here = groups.present
    frames = turned(frames, side)
    center[here] = origin + np.einsum("gi,gij->gj", (low + high) / 2, frames)
    axes[here], half[here] = longer_first(frames, (high - low) / 2)
    return Boxes(center, axes, half)


def localised(corners: FloatArray, groups: Groups) -> tuple[FloatArray, FloatArray]:
    """Origin (g, 3) of each group, its first corner, and coordinates from there, sorted by group:
    (axis, corner, face)."""
    origin = corners[groups.order[groups.starts[:-1]], 0]
    local = np.ascontiguousarray(corners[groups.order].transpose(2, 1, 0))
    for axis, row in enumerate(local):
        row -= groups.spread(origin[:, axis])
    return origin, local


def plane_normals(local: FloatArray, groups: Groups) -> FloatArray:
    """Unit normals (g, 3) of the planes, from coordinates (axis, corner, face) sorted by group."""
    size = np.sqrt(groups.greatest((local**2).sum(axis=0).max(axis=0)))
    local = local * groups.spread(1 / np.where(size > 0, size, 1.0))
    middle = local.mean(axis=1)
    vector = 0.5 * np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0], axis=0)
    area = np.sqrt((vector**2).sum(axis=0))
    weight = np.where(groups.spread(groups.sum(area)) > 0, area, 1.0)  # no area: every face alike
    total = groups.sum(weight)
    mean = np.stack([groups.sum(weight * row) / total for row in middle])
    local -= groups.spread(mean.T).T[:, None]
    middle -= groups.spread(mean.T).T
    facing = np.divide(vector, area, out=np.zeros_like(vector), where=area > 0)
    scatter, looks = np.empty((len(groups), 3, 3)), np.empty((len(groups), 3, 3))
    for i, j in combinations_with_replacement(range(3), 2):
        # A triangle's second moment about a point is area / 12 (sum of v v^T + 9 c c^T).
        moment = (local[i] * local[j]).sum(axis=0) + 9 * middle[i] * middle[j]
        scatter[:, i, j] = scatter[:, j, i] = groups.sum(weight / 12 * moment)
        looks[:, i, j] = looks[:, j, i] = groups.sum(weight * facing[i] * facing[j]) / total
    trace = np.trace(scatter, axis1=1, axis2=2)
    scatter /= np.where(trace > 0, trace, 1.0)[:, None, None]
    values, vectors = np.linalg.eigh(scatter - looks)
    normal = vectors[:, :, 0].copy()
    parts = list(groups.slices())
    for tied in np.flatnonzero(values[:, 1] - values[:, 0] <= TIED):
        good = vectors[tied][:, values[tied] - values[tied, 0] <= TIED].T
        along = good @ facing[:, parts[tied]]
        length = np.linalg.norm(along, axis=0)
        first = int((length > FAR * length.max()).argmax())
        if length[first] > 0:  # else no face has an area
            normal[tied] = along[:, first] / length[first] @ good
    return normal


def frames_about(normal: FloatArray) -> FloatArray:
    """Right-handed axes (g, 3, 3) whose third rows are the normals (g, 3)."""
    across = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = unit(np.cross(across, normal))
    return np.stack([first, np.cross(normal, first), normal], axis=1)


def turned(frames: FloatArray, side: FloatArray) -> FloatArray:
    """Frames (g, 3, 3) turned about their third axes, the first ones to directions (g, 2)."""
    x, y = side[:, :1], side[:, 1:]
    first = x * frames[:, 0] + y * frames[:, 1]
    second = x * frames[:, 1] - y * frames[:, 0]
    return np.stack([first, second, frames[:, 2]], axis=1)


def longer_first(axes: FloatArray, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Axes and half extents with the longer of the first two in front, still right-handed."""
    swap = half[:, 1] > half[:, 0]
    other = np.stack([axes[:, 1], -axes[:, 0], axes[:, 2]], axis=1)
    axes = np.where(swap[:, None, None], other, axes)
    return axes, np.where(swap[:, None], half[:, [1, 0, 2]], half)
