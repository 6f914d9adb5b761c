"""How far simplified triangles lie from the original.

Marks lie on the original: its vertices, and the middles of its edges. Each is followed from level
to level, and always is over one triangle, the nearest of those that its group became. So whatever
cut is drawn, one triangle of it is no further from a mark than that group's displacement. Along an
edge, the distance from a surface that bends once rises and falls in straight lines; so where it is
large at the middle, points beside it are looked at too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.meshes.distance import to_triangles
from vegtool.surfels.sheets import Flags, Labels, Triangles, edge_keys, following, runs

BLOCK = 1 << 19
"""Pairs of points and triangles that are looked at together: some megabytes."""

ROW = 256
"""Most points that are looked at together, of one group."""

FAR = 4.0
"""Plant radii: how far outside of triangles that have no plane all points are said to be."""

BESIDE = np.array([-0.75, -0.5, -0.25, 0.25, 0.5, 0.75])
"""Of half an edge: where points beside the middle of an edge are."""

LARGE = 0.5
"""Of the group's displacement: an edge reaches twice as far as its middle at most."""

MARGIN = 8 / 7
"""Times what is measured: where the lines meet between two points that are looked at, an eighth of
the edge apart, the distance is no more."""


@dataclass(frozen=True, eq=False)
class Marks:
    """m points of the original.

    points: (m, 3) plant radii. half: (m, 3) half the edge whose middle it is, or zero. face: (m,)
    int64 the triangle that it is over.
    """

    points: FloatArray
    half: FloatArray
    face: Labels

    def over(self, face: Labels) -> Marks:
        """Those that are over a triangle (m,) int64, -1 for none."""
        rows = face >= 0
        return Marks(self.points[rows], self.half[rows], face[rows])


def marks_on(triangles: Triangles, positions: FloatArray, held: Flags) -> Marks:
    """The marks of the original's triangles, wherever the surface can move at all."""
    start = triangles.faces.ravel()
    end = start[following(np.arange(len(start)))]
    vertex = np.unique(start, return_index=True)[1]
    vertex = vertex[~held[start[vertex]]]
    edge = np.unique(edge_keys(start, end), return_index=True)[1]
    edge = edge[~(held[start[edge]] & held[end[edge]])]
    a, b = positions[start[edge]], positions[end[edge]]
    return Marks(
        np.concatenate([positions[start[vertex]], (a + b) / 2]),
        np.concatenate([np.zeros((len(vertex), 3)), (b - a) / 2]),
        np.concatenate([vertex, edge]) // 3,
    )


def displaced(
    marks: Marks, group: Labels, corners: FloatArray, own: Labels, groups: int
) -> tuple[FloatArray, Labels]:
    """(g,) how far the original that each group's marks are on is at most from its triangles; and
    (m,) which of these each mark is over, -1 where its group has none.

    group: (m,) of the marks. corners: (t, 3, 3) of triangles, own: (t,) their groups, sorted.
    """
    faces = Faces(corners, own)
    near = faces.nearest(marks.points, group)
    rows = np.flatnonzero(near >= 0)
    far, of = faces.distance(marks.points[rows], near[rows]), group[rows]
    most = np.zeros(groups)
    np.maximum.at(most, of, far)

    large = (far > LARGE * most[of]) & marks.half[rows].any(axis=1)
    rows, far, of = rows[large], far[large], np.repeat(of[large], len(BESIDE))
    points = marks.points[rows, None] + BESIDE[:, None] * marks.half[rows, None]
    points = points.reshape(-1, 3)
    # no more than straight lines from the ends allow: the point may be over another group
    bound = np.multiply.outer(far, 1 + np.abs(BESIDE)).ravel()
    np.maximum.at(most, of, np.minimum(faces.distance(points, faces.nearest(points, of)), bound))
    return most * MARGIN, near


class Faces:
    """Triangles of groups, as points ask for them.

    corners: (t, 3, 3). own: (t,) their groups, sorted. planes: (t, 4, 4) through each edge, inward,
    and the triangle's own: unit normals and offsets.
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
        planes = self.planes[which]
        height = np.einsum("npi,ni->np", planes[..., :3], points) + planes[..., 3]
        result: FloatArray = np.abs(height[:, 3])
        rows = np.flatnonzero((height[:, :3] < 0).any(axis=1))
        result[rows] = to_triangles(points[rows], self.corners[which[rows]])
        return result

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
