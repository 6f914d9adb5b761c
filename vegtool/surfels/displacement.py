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

from vegtool.arrays import FloatArray
from vegtool.surfels.faces import Faces
from vegtool.surfels.sheets import Flags, Labels, Triangles, edge_keys, following

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
