"""Of how many viewers is a face shown, where planes leave cracks? Looked up, ray by ray.

"Hybrid billboard clouds" (sketch), section 2, on fractional coverage: "the fraction of all viewing
angles from which it is visible". Where faces lie beside each other decides it as much as how they
are turned (shown.py): neighbours that move onto different planes part. So parallel rays from all
around are followed: what of a surface they meet first is seen, and what of that no plane shows them
from the same side is a hole, through which the background is seen, or the inside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.clustering.features import Labels
from vegtool.refine.hits import Hits, Rays, hits, nearest

DIRECTIONS = 32
"""From which is looked, over the whole sphere."""
CELL = 0.4
"""Of what planes may move faces by: from ray to ray."""
FEWEST, MOST = 64, 256
"""Rays from side to side."""

TINY = float(np.finfo(float).tiny)
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Sights:
    """What r rays meet of f faces. first: (r,) int64 the face nearest to the viewer, or -1.
    front: (r,) whether that is seen from where it is counter-clockwise.

    Rays run from side to side of a picture for each direction, one direction after the other.
    """

    rays: Rays
    first: Labels
    front: Bools

    @property
    def directions(self) -> int:
        return len(self.rays.views)

    def met(self, corners: FloatArray, both_sides: Bools) -> tuple[Labels, Labels]:
        """(h,), (h,) which rays meet which of the triangles (n, 3, 3), those that meet the surface
        only what shows them the same side. both_sides: (n,) whether triangles are seen from behind
        too."""
        ray, face = [], []
        for found in _by_view(self.rays, corners, both_sides):
            same = (self.first[found.ray] < 0) | (self.front[found.ray] == found.front)
            ray.append(found.ray[same])
            face.append(found.face[same])
        return np.concatenate(ray), np.concatenate(face)

    def seen(self, which: Bools, faces: int) -> FloatArray:
        """(faces, d) how large what is seen of them looks from each direction, along those of the
        rays that are named, (r,)."""
        cell = (self.rays.extent / self.rays.cells) ** 2
        ray = np.flatnonzero(which & (self.first >= 0))
        index = self.first[ray] * self.directions + ray // self.rays.cells**2
        count = np.bincount(index, minlength=faces * self.directions)
        return np.asarray(cell * count.reshape(faces, self.directions))


def sights(corners: FloatArray, both_sides: Bools, which: Bools, reach: float) -> Sights:
    """Of some faces, (f,) bool, of (f, 3, 3), by rays that are close enough for the cracks between
    planes that move faces by `reach`. both_sides: (f,) whether they are seen from behind too."""
    rays = Rays.around(corners, DIRECTIONS)
    cells = int(np.clip(rays.extent / max(CELL * reach, TINY), FEWEST, MOST))
    rays = replace(rays, cells=cells)
    first = np.full(DIRECTIONS * cells**2, -1, dtype=np.int64)
    front = np.zeros(len(first), dtype=bool)
    face = np.flatnonzero(which)
    for found in _by_view(rays, corners[face], both_sides[face]):
        seen = nearest(found)
        first[found.ray[seen]] = face[found.face[seen]]
        front[found.ray[seen]] = found.front[seen]
    return Sights(rays, first, front)


def _by_view(rays: Rays, corners: FloatArray, both_sides: Bools) -> Iterator[Hits]:
    """Hits of triangles on the sides that show, direction by direction: few are known at a time."""
    for nth, view in enumerate(rays.views):
        found = hits(replace(rays, views=view[None]), corners)
        found = found.of(found.front | both_sides[found.face])
        yield replace(found, ray=found.ray + nth * rays.cells**2)
