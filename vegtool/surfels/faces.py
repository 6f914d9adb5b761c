"""Triangles, as points ask how far they are from them."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.meshes.distance import to_triangles
from vegtool.surfels.sheets import Labels, runs

BLOCK = 1 << 19
"""Pairs of points and triangles that are looked at together: some megabytes."""

ROW = 256
"""Most points that are looked at together, of one group."""

FAR = 4.0
"""Plant radii: how far outside of triangles that have no plane all points are said to be."""


class Faces:
    """Triangles of groups, as points ask for them.

    corners: (t, 3, 3) plant radii. own: (t,) their groups, sorted. planes: (t, 4, 4) through each
    edge, inward, and the triangle's own: unit normals and offsets.
    """

    def __init__(self, corners: FloatArray, own: Labels) -> None:
        self.corners, self.own = corners, own
        sides = np.roll(corners, -1, axis=1) - corners
        normal = unit(np.cross(sides[:, 0], sides[:, 1]))[:, None]
        normals = np.concatenate([unit(np.cross(normal, sides)), normal], axis=1)
        through = np.concatenate([corners, corners[:, :1]], axis=1)
        offset = -np.einsum("tpi,tpi->tp", normals, through)
        offset[~normal.any(axis=(1, 2)), :3] = -FAR
        self.planes = np.concatenate([normals, offset[..., None]], axis=2)

    def distance(self, points: FloatArray, which: Labels) -> FloatArray:
        """(n,) of points (n, 3) from triangles (n,)."""
        height = self._heights(points, which)
        result: FloatArray = np.abs(height[:, 3])
        rows = np.flatnonzero((height[:, :3] < 0).any(axis=1))
        result[rows] = to_triangles(points[rows], self.corners[which[rows]])
        return result

    def least(self, points: FloatArray, of: Labels, which: Labels) -> FloatArray:
        """(n,) of points (n, 3) from that of their triangles that they are above, or else from the
        nearest. of, which: (p,), (p,) pairs of points and triangles."""
        height = self._heights(points[of], which)
        above = (height[:, :3] >= 0).all(axis=1)
        result = np.full(len(points), np.inf)
        np.minimum.at(result, of[above], np.abs(height[above, 3]))
        rows = np.flatnonzero(result[of] == np.inf)
        np.minimum.at(result, of[rows], to_triangles(points[of[rows]], self.corners[which[rows]]))
        return result

    def _heights(self, points: FloatArray, which: Labels) -> FloatArray:
        """(n, 4) of points (n, 3) over the planes of triangles (n,)."""
        planes = self.planes[which]
        height = np.einsum("npi,ni->np", planes[..., :3], points) + planes[..., 3]
        return np.asarray(height)

    def nearest(self, points: FloatArray, group: Labels) -> Labels:
        """(n,) the triangle of its group (n,) that a point is about nearest to; -1 for none.

        By the distance from its plane and, outside it, that from the furthest line of its edges.
        """
        result = np.full(len(points), -1)
        order = np.argsort(group, kind="stable")
        order = order[np.isin(group[order], self.own)]
        start, tall = _rows(group[order])
        first = np.searchsorted(self.own, group[order[start]])
        wide = np.searchsorted(self.own, group[order[start]], "right") - first
        rest = np.lexsort((wide, tall))
        while len(rest):
            high, broad = np.maximum.accumulate(tall[rest]), np.maximum.accumulate(wide[rest])
            pairs = high * broad * np.arange(1, len(rest) + 1)
            count = max(1, int(np.searchsorted(pairs, BLOCK, "right")))
            now, rest = rest[:count], rest[count:]
            at = start[now, None] + np.minimum(np.arange(high[count - 1]), tall[now, None] - 1)
            of = first[now, None] + np.minimum(np.arange(broad[count - 1]), wide[now, None] - 1)
            best = self._best(points[order[at]], of)
            result[order[at]] = np.take_along_axis(of, best, axis=1)
        return result

    def _best(self, points: FloatArray, of: Labels) -> Labels:
        """(b, p) which of triangles (b, q) is best for points (b, p, 3)."""
        # float32 will do about one of the triangles
        origin, planes = self.corners[of[:, 0], 0], self.planes[of]
        offset = (points - origin[:, None]).astype(np.float32)
        shift = np.einsum("bqki,bi->bqk", planes[..., :3], origin) + planes[..., 3]
        normal, shift = planes[..., :3].astype(np.float32), shift.astype(np.float32)
        outside = np.zeros(1, np.float32)
        for plane in range(4):
            height = offset @ normal[:, :, plane].swapaxes(1, 2)
            height += shift[:, None, :, plane]
            if plane < 3:
                outside = np.minimum(outside, height)
        return np.asarray((outside**2 + height**2).argmin(axis=2))


def _rows(group: Labels) -> tuple[Labels, Labels]:
    """(r,), (r,) where rows of one group each begin, and their sizes, ROW at most. group: (n,)
    sorted."""
    nth = np.arange(len(group))
    first = runs(group)
    since = nth - np.repeat(first, np.diff(first, append=len(group)))
    start = np.flatnonzero(since % ROW == 0)
    return start, np.diff(start, append=len(group))
