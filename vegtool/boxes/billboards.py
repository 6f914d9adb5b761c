"""Boxes turned into billboards: one plane for a flat box, two or three crossed ones for others.

Paper: Colditz et al. (2005), section 2.1: "A nearly flat box with two long and a small side can be
represented by a single billboard. If the points form a box with more equal side lengths, three
crossed billboards are used." A long thin box gets two, crossed along its axis; so does a compact
one that a third plane would show from the edge alone, such as a piece of trunk, which would become
a disc on it; and a flat one that its plane would show so, such as a slice of trunk.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.boxes.box import Boxes
from vegtool.boxes.fit import fit_boxes
from vegtool.boxes.groups import Groups
from vegtool.boxes.options import BoxOptions
from vegtool.boxes.planes import oriented_planes
from vegtool.lod import Billboards
from vegtool.plant import Plant

MIN_SIDE = 1e-3
"""Least half side of a billboard, as a fraction of its cluster's diagonal: never without texels."""
MIN_SIDE_PLANT = 1e-6
"""The same as a fraction of the plant's radius, for clusters that are a point."""
UP = np.array([0.0, 1.0, -1e-3])
"""Where the top of a picture points; the tilt decides for billboards that lie flat."""


def make_billboards(
    plant: Plant, labels: IntArray, options: BoxOptions | None = None
) -> Billboards:
    """The billboards of a clustering.

    labels: (f,) int32, each face's cluster. Planes are ordered by cluster; a cluster without
    faces has none. A single plane lies at the area-weighted mean of its cluster along the normal,
    where the rms displacement is least; crossed planes pass through the box's centre. Rectangles
    are tight around the projected faces. The front faces where most of the area of single-sided
    faces looks, else away from the plant's centre; v points up as far as the box allows.
    """
    options = options or BoxOptions()
    count = int(labels.max()) + 1
    boxes = cluster_boxes(plant, labels, count, options)
    shown = shown_shares(plant, labels, boxes)
    planes = planes_per_box(boxes, shown, options)
    return cut_planes(plant, labels, boxes, planes, shown, options)


def cluster_boxes(plant: Plant, labels: IntArray, count: int, options: BoxOptions) -> Boxes:
    """The boxes (count) of a clustering, by the fit that the options name."""
    if options.plane == "orientation":
        return oriented_planes(plant.corners, labels, count)
    return fit_boxes(plant.corners.reshape(-1, 3), np.repeat(labels, 3), count, options)


def shown_shares(plant: Plant, labels: IntArray, boxes: Boxes) -> FloatArray:
    """(k, 3): the share of a cluster's area that a plane across each axis of its box shows.

    That is |n . axis|, averaged over the area: a half for faces of all directions, next to nothing
    for a tube about the axis. -1 for a cluster without faces, a half for one without area.
    """
    groups = Groups(labels)
    axes = boxes.axes[labels[groups.order]]
    shown = np.abs(np.einsum("fai,fi->fa", axes, plant.face_area_vectors[groups.order]))
    area = groups.sum(plant.face_areas[groups.order])[:, None]
    shares = np.full((len(boxes), 3), -1.0)
    sums = groups.sum(shown)
    shares[groups.present] = np.divide(sums, area, out=np.full_like(sums, 0.5), where=area > 0)
    return shares


def planes_per_box(boxes: Boxes, shown: FloatArray, options: BoxOptions) -> IntArray:
    """(k,) int32: 1, 2 or 3 billboards for each box, by its form; 0 for one without faces.

    shown: (k, 3) as from `shown_shares`.
    """
    longest, middle, least = boxes.half.T
    flat = (ratio(least, middle) < options.flat_ratio) & (shown[:, 2] >= options.edge_on)
    long_thin = ratio(middle, longest) < options.long_ratio
    compact = np.where(shown.min(axis=1) < options.edge_on, 2, 3)
    if options.shape == "single":
        planes = np.ones(len(boxes))
    elif options.shape == "crossed":
        planes = np.where(long_thin, 2, compact)
    elif options.plane == "orientation":
        planes = np.where(long_thin & ~flat, 2, 1)
    else:
        planes = np.where(flat, 1, np.where(long_thin, 2, compact))
    return np.where(shown[:, 0] < 0, 0, planes).astype(np.int32)


def ratio(short: FloatArray, long: FloatArray) -> FloatArray:
    """short / long, and 0 where both are."""
    return np.divide(short, long, out=np.zeros_like(short), where=long > 0)


def cut_planes(
    plant: Plant,
    labels: IntArray,
    boxes: Boxes,
    planes: IntArray,
    shown: FloatArray,
    options: BoxOptions,
) -> Billboards:
    """Billboards through boxes (k), `planes` (k,) 0 to 3 of them each.

    The first has the box's third axis for its normal, then the second, then the first. Two share
    the longest axis in a long thin box, else the axis across which a plane shows least; `shown`:
    (k, 3) as from `shown_shares`.
    """
    cluster = np.repeat(np.arange(len(boxes), dtype=np.int32), planes)
    which = np.concatenate([np.arange(n) for n in planes]).astype(np.int64)
    axes, half = boxes.axes[cluster], boxes.half[cluster]
    row = np.arange(len(cluster))
    long_thin = ratio(boxes.half[:, 1], boxes.half[:, 0]) < options.long_ratio
    shared = np.where(long_thin | (planes != 2), 0, shown.argmin(axis=1))
    normals = np.array([[2, 1, 0], [2, 0, 1], [1, 0, 2]])  # by the shared axis, which comes last
    normal_axis = normals[shared[cluster], which]
    sides = np.array([[1, 2], [0, 2], [0, 1]])[normal_axis]

    normal = axes[row, normal_axis]
    facing, mean = surface_sums(plant, labels, len(boxes))
    center = boxes.center[cluster]
    depth = half[row, normal_axis]
    offset = np.einsum("pi,pi->p", mean[cluster] - center, normal)
    offset = np.where(planes[cluster] == 1, np.clip(offset, -depth, depth), 0.0)
    center = center + offset[:, None] * normal
    outward = center - plant.center
    normal = normal * front_sign(normal, facing[cluster], outward)[:, None]

    choices = axes[row[:, None], sides]  # (p, 2, 3)
    upward = choices @ UP
    upper = np.abs(upward).argmax(axis=1)
    sign = np.where(upward[row, upper] < 0, -1.0, 1.0)
    v = choices[row, upper] * sign[:, None]
    size = half[row[:, None], sides[row[:, None], np.stack([1 - upper, upper], axis=1)]]
    floor = MIN_SIDE * 2 * np.linalg.norm(half, axis=1)
    floor = np.maximum(floor, MIN_SIDE_PLANT * (plant.radius or 1.0))
    return Billboards(
        center=center,
        u=np.cross(v, normal),
        v=v,
        half_size=np.maximum(size, floor[:, None]),
        half_depth=depth + np.abs(offset),
        cluster=cluster,
    )


def surface_sums(plant: Plant, labels: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Per cluster the sum of its single-sided faces' area vectors and its area-weighted mean."""
    single_sided = np.array([not m.double_sided for m in plant.materials])[plant.face_material]
    facing, mean = np.zeros((count, 3)), np.zeros((count, 3))
    groups = Groups(labels)
    order, here = groups.order, groups.present
    facing[here] = groups.sum((plant.face_area_vectors * single_sided[:, None])[order])
    area = plant.face_areas[order]
    weight = np.where(groups.spread(groups.sum(area)) > 0, area, 1.0)
    base = plant.face_centroids[groups.order[groups.starts[:-1]]]
    local = plant.face_centroids[order] - groups.spread(base)
    mean[here] = base + groups.sum(weight[:, None] * local) / groups.sum(weight)[:, None]
    return facing, mean


def front_sign(normal: FloatArray, facing: FloatArray, outward: FloatArray) -> FloatArray:
    """(p,) -1 or 1: which side of each plane is its front."""
    towards = np.einsum("pi,pi->p", normal, facing)
    away = np.einsum("pi,pi->p", normal, outward)
    return np.where(np.where(towards != 0, towards, away) < 0, -1.0, 1.0)
