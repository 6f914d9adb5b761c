"""Surfel billboards over the patches of a surface: which stands for which, and from where on.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007),
sections 4.2 to 4.5. A billboard is drawn where it is valid (eq. 1) and its father is not (eq. 18).
To ask both of a billboard and its father, and no others, validity must only grow on the way up:
then what is drawn is what a descent from the root would draw. It does where

- distances are to spheres that contain those of all below, and
- z_min of a father is at least 1 / sqrt(theta (2 - theta)) times that of its children: a child is
  valid there from all directions, not from the share theta alone. The reduction sees to that
  (reduce.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.surfels.base import Base
from vegtool.surfels.box import SurfelBoxes, boxes_of
from vegtool.surfels.validity import distance_error

MOST_TEXELS = 1024
"""Along a side of a billboard: of what is flat, eq. 9 has no bound."""
TINY = float(np.finfo(np.float64).tiny)
TOGETHER = 200_000
"""Triangles whose boxes are found at once."""


@dataclass(frozen=True, eq=False)
class SurfelHierarchy:
    """b billboards over p patches; a father comes after its children.

    boxes: b, in metres. father: (b,) int32, -1 at a root. error: (b,) metres, epsilon z_min / pc,
    at least d sqrt(theta (2 - theta)) (eq. 8), nowhere less than below. center: (b, 3) and radius:
    (b,) metres, spheres that distances are to. above: (p,) int32 the lowest billboard over each
    patch, -1 where there is none. theta: share of directions.
    """

    boxes: SurfelBoxes
    father: IntArray
    error: FloatArray
    center: FloatArray
    radius: FloatArray
    above: IntArray
    theta: float
    least: float = 0.0

    def __post_init__(self) -> None:
        name, count = "SurfelHierarchy", len(self.boxes)
        values = {
            "father": checked(f"{name}.father", self.father, (count,), np.int32),
            "error": checked(f"{name}.error", self.error, (count,), np.float64),
            "center": checked(f"{name}.center", self.center, (count, 3), np.float64),
            "radius": checked(f"{name}.radius", self.radius, (count,), np.float64),
            "above": checked(f"{name}.above", self.above, (None,), np.int32),
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)
        for key in ("father", "above"):
            rows = values[key]
            if len(rows) and not -1 <= rows.min() <= rows.max() < count:
                raise ValueError(f"{name}.{key}: indices must lie in -1..{count - 1}")
        if not (0 < self.theta <= 1 and self.least >= 0):
            raise ValueError(f"{name}: expected a share theta of directions, and least in metres")
        has = self.father >= 0
        if (self.father[has] <= np.flatnonzero(has)).any():
            raise ValueError(f"{name}.father: must come after its children")

    def __len__(self) -> int:
        return len(self.boxes)

    def pairs(self) -> tuple[IntArray, IntArray]:
        """(q,) int32 patches and (q,) int32 the billboards that show them, billboard by
        billboard."""
        return ancestors(self.above, self.father)


def ancestors(above: IntArray, father: IntArray) -> tuple[IntArray, IntArray]:
    """(q,) int32 and (q,) int32: each with all that is above it, by what is above."""
    patch, at = np.arange(len(above), dtype=np.int32), above
    patches, found = [], []
    while len(at):
        patch, at = patch[at >= 0], at[at >= 0]
        patches.append(patch)
        found.append(at)
        at = father[at]
    below, over = np.concatenate(patches), np.concatenate(found)
    order = np.lexsort((below, over))
    return below[order], over[order]


def whole(base: Base, children: IntArray, theta: float, least: float = 0.0) -> SurfelHierarchy:
    """A billboard for each patch and each pair of `merging.merged`, (p - 1, 2), with an error of so
    many metres at least."""
    patches = len(base.first)
    total = patches + len(children)
    father = np.full(total, -1, dtype=np.int32)
    made = np.arange(patches, total, dtype=np.int32)
    father[children[:, 0]] = father[children[:, 1]] = made
    above = np.arange(patches, dtype=np.int32)
    boxes = _boxes(base, *ancestors(above, father))
    error = own_error(boxes, theta, least)
    radius = np.linalg.norm(boxes.half, axis=1)
    start = SurfelHierarchy(boxes, father, error, boxes.center, radius, above, theta, least)
    return monotone(base, start)


def own_error(boxes: SurfelBoxes, theta: float, least: float) -> FloatArray:
    """(b,) metres: of billboards by themselves (eq. 8), of which no texel may be smaller."""
    flat = distance_error(boxes.half[:, 2], theta)
    texel = 2 * boxes.half[:, 0] / MOST_TEXELS
    return np.asarray(np.maximum(np.maximum(flat, texel), max(least, TINY)))


def monotone(base: Base, one: SurfelHierarchy, growth: float = 1.0) -> SurfelHierarchy:
    """The same with errors and spheres that only grow on the way up, from those of the patches; a
    father's error is at least `growth` times that of its children."""
    error, radius = one.error.copy(), one.radius.copy()
    over = one.above >= 0
    at = one.above[over]
    away = np.linalg.norm(one.center[at] - base.center[over], axis=1) + base.radius[over]
    np.maximum.at(radius, at, away)
    np.maximum.at(error, at, base.error[over])
    for child, father in enumerate(one.father.tolist()):
        if father >= 0:
            away_m = float(np.linalg.norm(one.center[father] - one.center[child]))
            radius[father] = max(radius[father], away_m + radius[child])
            error[father] = max(error[father], growth * error[child])
    return replace(one, error=error, radius=radius)


def _boxes(base: Base, patch: IntArray, over: IntArray) -> SurfelBoxes:
    """Of all billboards, round all that they show."""
    sizes = np.diff(np.append(base.first, len(base.corners)))
    count = np.bincount(over, sizes[patch]).astype(np.int64)
    ends = np.searchsorted(np.cumsum(count), np.arange(TOGETHER, count.sum() + TOGETHER, TOGETHER))
    found, begin = [], 0
    for end in np.unique(np.minimum(ends + 1, len(count))).tolist():
        rows = slice(np.searchsorted(over, begin), np.searchsorted(over, end))
        own = sizes[patch[rows]]
        start = np.repeat(base.first[patch[rows]] - np.cumsum(own) + own, own)
        triangle = start + np.arange(int(own.sum()))
        some = count[begin:end]
        found.append(boxes_of(base.corners[triangle], np.cumsum(some) - some))
        begin = end
    parts = [[getattr(one, name) for one in found] for name in ("center", "axes", "half")]
    return SurfelBoxes(*(np.concatenate(part) for part in parts))
