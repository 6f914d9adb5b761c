"""Where triangles of all levels lie on the coarsest one.

Cuts of a multi-triangulation (cuts.py) mix levels without cracks because patches switch in groups,
and groups overlap from round to round until they are spread over the whole surface. A tile is a
part of the surface, whatever its neighbours show. So of each triangle the patches of the coarsest
level are found that are beneath it: a tile of some of these patches draws all triangles over any of
them. Over a border both sides draw the same ones, and where levels differ nothing is left open.

A point goes up from node to node: from the patches that one simplifies away to the nearest triangle
of those that it makes, and so on. So it stays on its own side of a thin leaf, wherever groups have
one side alone.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.surfels.faces import Faces
from vegtool.surfels.multi_triangulation import MultiTriangulation
from vegtool.surfels.sheets import Labels

ASKED = 4
"""Points of a triangle: its corners and its middle. Corners on a border may be said to be on either
side of it, the middle is inside."""


def beneath(mt: MultiTriangulation) -> npt.NDArray[np.int32]:
    """(t, 4) int32 patches of the coarsest level, counted from 0, beneath the corners and the
    middle of each triangle of `mt.faces`."""
    source = len(mt.error) - 1
    positions = (mt.plant.positions - mt.plant.center) / (mt.plant.radius or 1.0)
    arc = np.repeat(np.arange(len(mt.start)), mt.sizes)
    start, end = mt.start[arc].astype(np.int64), mt.end[arc].astype(np.int64)
    coarsest = int(np.searchsorted(mt.start, source))
    by_maker = np.argsort(end, kind="stable")
    made = Faces(positions[mt.faces[by_maker]], end[by_maker])

    # corners of triangles around a vertex go the same way
    key, corner = np.unique(start[:, None] * len(positions) + mt.faces, return_inverse=True)
    points = np.concatenate([positions[key % len(positions)], positions[mt.faces].mean(axis=1)])
    node = np.concatenate([key // len(positions), start])
    on = np.full(len(points), -1, np.int64)
    todo = np.flatnonzero(node < source)
    while len(todo):
        on[todo] = by_maker[made.nearest(points[todo], node[todo])]
        node[todo] = start[on[todo]]
        todo = todo[node[todo] < source]
    asked = np.concatenate(
        [corner.reshape(-1, 3), len(key) + np.arange(len(start))[:, None]], axis=1
    )
    reached = on[asked]
    own: Labels = np.where(reached < 0, np.arange(len(start))[:, None], reached)
    return (arc[own] - coarsest).astype(np.int32)
