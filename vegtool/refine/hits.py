"""Where parallel rays from all around meet triangles: what hides what, and how much is covered.

A ray stands for a cell of a grid across its direction, through the cell's middle: areas counted in
rays are unbiased, however small the triangles are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, unit

Ints = npt.NDArray[np.int64]

DIRECTIONS = 8
CELLS = 160
"""Of a grid along the longest extent."""
ROOM = 1.1
"""Of the extent, that a grid shows: what is drawn in place of triangles may reach farther."""


@dataclass(frozen=True, eq=False)
class Rays:
    """Grids across directions. middle: (3,). extent: length of a grid's side. views: (d, 3) unit
    vectors towards the viewers."""

    middle: FloatArray
    extent: float
    cells: int
    views: FloatArray

    @staticmethod
    def around(
        corners: FloatArray,
        directions: int = DIRECTIONS,
        cells: int = CELLS,
        room: float = ROOM,
        half: bool = False,
        views: FloatArray | None = None,
    ) -> Rays:
        """For triangles (f, 3, 3), whose bounds are not a point. room: of their extent, that a grid
        shows. half: from above only, as does for outlines, which are the same from behind. views:
        (d, 3) unit vectors towards viewers, in place of evenly spread ones."""
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        middle, extent = (low + high) / 2, room * float(np.linalg.norm(high - low))
        if views is not None:
            return Rays(middle, extent, cells, views)
        nth = np.arange(directions)
        part = (nth + 0.5) / directions
        up = part if half else 1 - 2 * part
        turn = np.pi * nth * (5**0.5 - 1)
        across = np.sqrt(1 - up * up)
        views = np.stack([across * np.cos(turn), up, across * np.sin(turn)], axis=1)
        return Rays(middle, extent, cells, views)

    @property
    def cell(self) -> float:
        """The area that a ray stands for, in the mean over the directions."""
        return (self.extent / self.cells) ** 2 / len(self.views)


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays meet triangles, h times. ray: (h,) which; those of a direction are together.
    face: (h,). at: (h, 2) barycentric, of the second and third corners. depth: (h,) along the ray
    towards the viewer. front: (h,) whether the face is seen from where it is counter-clockwise."""

    ray: Ints
    face: Ints
    at: FloatArray
    depth: FloatArray
    front: npt.NDArray[np.bool_]

    def of(self, kept: npt.NDArray[np.bool_]) -> Hits:
        """Some of them, (h,) bool."""
        return Hits(
            self.ray[kept], self.face[kept], self.at[kept], self.depth[kept], self.front[kept]
        )


def hits(rays: Rays, corners: FloatArray) -> Hits:
    """Of triangles (f, 3, 3), from either side."""
    found = [_of_view(rays, corners, index) for index in range(len(rays.views))]
    columns = zip(*((h.ray, h.face, h.at, h.depth, h.front) for h in found), strict=True)
    return Hits(*(np.concatenate(column) for column in columns))


def _of_view(rays: Rays, corners: FloatArray, index: int) -> Hits:
    view = rays.views[index]
    right = unit(np.cross([0.0, 1.0, 0.0], view))
    frame = np.stack([right, np.cross(view, right), view], axis=1)
    local = (corners - rays.middle) @ frame
    flat = local[..., :2] / rays.extent * rays.cells + rays.cells / 2
    low = np.clip(np.ceil(flat.min(axis=1) - 0.5), 0, rays.cells).astype(np.int64)
    high = np.clip(np.floor(flat.max(axis=1) - 0.5), -1, rays.cells - 1).astype(np.int64)
    size = np.maximum(high - low + 1, 0)
    count = size.prod(axis=1)
    face = np.repeat(np.arange(len(corners)), count)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    x = low[face, 0] + nth % np.maximum(size[face, 0], 1)
    y = low[face, 1] + nth // np.maximum(size[face, 0], 1)
    a = flat[:, 0]
    (bx, by), (cx, cy) = (flat[:, 1] - a).T, (flat[:, 2] - a).T
    twice = bx * cy - by * cx
    plain = np.abs(twice) > np.finfo(float).eps * rays.cells**2
    scale = np.divide(1.0, twice, out=np.zeros_like(twice), where=plain)
    px, py = x + 0.5 - a[face, 0], y + 0.5 - a[face, 1]
    second = (px * cy[face] - py * cx[face]) * scale[face]
    third = (py * bx[face] - px * by[face]) * scale[face]
    inside = (second >= 0) & (third >= 0) & (second + third <= 1) & plain[face]
    face, second, third = face[inside], second[inside], third[inside]
    z = local[face, :, 2]
    depth = z[:, 0] + second * (z[:, 1] - z[:, 0]) + third * (z[:, 2] - z[:, 0])
    ray = index * rays.cells**2 + y[inside] * rays.cells + x[inside]
    return Hits(ray, face, np.stack([second, third], axis=1), depth, twice[face] > 0)


def rays_met(rays: Rays, found: Hits) -> npt.NDArray[np.bool_]:
    """(d * cells * cells,) which rays meet anything. Their number times `cell` is what is covered,
    in the mean over the directions."""
    result = np.zeros(len(rays.views) * rays.cells**2, dtype=bool)
    result[found.ray] = True
    return result


def distinct(ray: Ints, label: Ints, count: int) -> FloatArray:
    """(count,) rays that meet each label at least once: rays and labels (h,) of hits."""
    key = np.unique(ray * count + label)
    return np.bincount(key % count, minlength=count).astype(np.float64)


def nearest(found: Hits) -> npt.NDArray[np.bool_]:
    """(h,) hits that nothing hides from the viewer."""
    order = np.lexsort((-found.depth, found.ray))
    first = np.ones(len(order), dtype=bool)
    first[1:] = found.ray[order][1:] != found.ray[order][:-1]
    result = np.zeros(len(order), dtype=bool)
    result[order[first]] = True
    return result
