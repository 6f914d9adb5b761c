"""The oriented box of a set of triangles, by principal component analysis.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007),
section 3.1. Components are of the surface, not of the vertices: a finer mesh of the same surface
has the same box. Of what has no surface (lines, points) all triangles count alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, checked

Ints = npt.NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class SurfelBoxes:
    """b boxes. center: (b, 3). axes: (b, 3, 3), whose rows o1, o2, n are right-handed unit vectors,
    the longest side first: n looks to where more of the surface's front is seen. half: (b, 3) the
    half sizes w >= h >= d along these; 0 where a set is flat. In the unit of the triangles."""

    center: FloatArray
    axes: FloatArray
    half: FloatArray

    def __post_init__(self) -> None:
        center = checked("SurfelBoxes.center", self.center, (None, 3), np.float64)
        object.__setattr__(self, "center", center)
        for name, shape in (("axes", (len(center), 3, 3)), ("half", (len(center), 3))):
            value = checked(f"SurfelBoxes.{name}", getattr(self, name), shape, np.float64)
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.center)

    @property
    def normal(self) -> FloatArray:
        """(b, 3) unit."""
        return self.axes[:, 2]

    def quads(self) -> FloatArray:
        """(b, 4, 3) the corners of the billboards, counter-clockwise as seen from their front."""
        turn = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        sides = self.half[:, :2, None] * self.axes[:, :2]
        return np.asarray(self.center[:, None] + np.einsum("qs,bsi->bqi", turn, sides))


@dataclass(frozen=True, eq=False)
class Moments:
    """How m surfaces lie. weight: (m,) area, or how many triangles there are of a set without any.
    facing: (m, 3) sum of area vectors. mean: (m, 3). spread: (m, 3, 3) second moment about the
    mean, times the weight."""

    weight: FloatArray
    facing: FloatArray
    mean: FloatArray
    spread: FloatArray

    def of(self, rows: Ints) -> Moments:
        """Some of them."""
        return Moments(self.weight[rows], self.facing[rows], self.mean[rows], self.spread[rows])

    def with_(self, other: Moments) -> Moments:
        """Each joined with one of the others."""
        weight = self.weight + other.weight
        share = (other.weight / weight)[:, None]
        away = other.mean - self.mean
        reduced = (self.weight * other.weight / weight)[:, None, None]
        spread = self.spread + other.spread + reduced * away[:, :, None] * away[:, None]
        facing = self.facing + other.facing
        return Moments(weight, facing, self.mean + share * away, spread)


def moments_of(corners: FloatArray, first: Ints) -> Moments:
    """Of sets of triangles.

    corners: (t, 3, 3), set by set. first: (m,) rising from 0, the first triangle of each set; none
    is empty.
    """
    count = np.diff(np.append(first, len(corners)))
    of = np.repeat(np.arange(len(first)), count)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    weight = np.linalg.norm(facing, axis=1)
    weight = np.where(np.add.reduceat(weight, first)[of] > 0, weight, 1.0)
    total = np.add.reduceat(weight, first)
    mean = np.add.reduceat((weight / total[of])[:, None] * corners.mean(axis=1), first)
    # of a triangle: Blow, Binstock (2004), "How to find the inertia tensor"
    local = corners - mean[of, None]
    middle = local.sum(axis=1)
    spread = np.einsum("tci,tcj->tij", local, local) + middle[:, :, None] * middle[:, None]
    spread = np.add.reduceat(weight[:, None, None] / 12 * spread, first)
    return Moments(total, np.add.reduceat(facing, first), mean, spread)


def boxes_round(moments: Moments, points: FloatArray, first: Ints) -> SurfelBoxes:
    """Boxes as surfaces lie, round points (p, 3), of which those of each begin at `first`, (m,)."""
    count = np.diff(np.append(first, len(points)))
    of = np.repeat(np.arange(len(first)), count)
    axes = np.linalg.eigh(moments.spread)[1][:, :, ::-1].swapaxes(1, 2)
    along = np.einsum("pi,pji->pj", points - moments.mean[of], axes[of])
    low, high = np.minimum.reduceat(along, first), np.maximum.reduceat(along, first)
    order = np.argsort(low - high, axis=1, kind="stable")
    axes = np.take_along_axis(axes, order[:, :, None], axis=1)
    half = np.take_along_axis((high - low) / 2, order, axis=1)
    middle = np.take_along_axis((high + low) / 2, order, axis=1)
    center = moments.mean + np.einsum("bj,bji->bi", middle, axes)
    looks = np.einsum("bi,bi->b", moments.facing, axes[:, 2])
    axes[:, 2] = np.where(looks[:, None] < 0, -axes[:, 2], axes[:, 2])
    axes[:, 1] = np.cross(axes[:, 2], axes[:, 0])
    return SurfelBoxes(center, axes, half)


def boxes_of(corners: FloatArray, first: Ints) -> SurfelBoxes:
    """The boxes of sets of triangles, given as in `moments_of`."""
    return boxes_round(moments_of(corners, first), corners.reshape(-1, 3), 3 * np.asarray(first))
