"""Of how many viewers is a face shown, where planes leave cracks? Looked up, ray by ray.

"Hybrid billboard clouds" (sketch), section 2, on fractional coverage: "the fraction of all viewing
angles from which it is visible". Where faces lie beside each other decides it as much as how they
are turned (shown.py): neighbours that move onto different planes part. So parallel rays from all
around are followed: what of a surface they meet first is seen, and what of that they do not meet on
the planes is a hole, through which the background is seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.clustering.features import Labels
from vegtool.refine.hits import Hits, Rays, hits, nearest

DIRECTIONS = 48
"""From which is looked, over the whole sphere."""
CELL = 0.4
"""Of what planes may move faces by: from ray to ray."""
FEWEST, MOST = 64, 256
"""Rays from side to side."""

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Sights:
    """What r rays meet of f faces. first: (r,) int64 the face nearest to the viewer, or -1."""

    rays: Rays
    first: Labels

    @property
    def directions(self) -> int:
        return len(self.rays.views)

    def met(self, corners: FloatArray, both_sides: Bools) -> Bools:
        """(r,) whether rays meet any of the triangles (n, 3, 3). both_sides: (n,) whether they are
        seen from behind too."""
        result = np.zeros(len(self.first), dtype=bool)
        for found in _by_view(self.rays, corners, both_sides):
            result[found.ray] = True
        return result

    def through(self, corners: FloatArray, both_sides: Bools, worth: FloatArray) -> FloatArray:
        """(n,) the sum of what rays are worth, (r,), over those that meet each triangle."""
        result = np.zeros(len(corners))
        for found in _by_view(self.rays, corners, both_sides):
            result += np.bincount(found.face, worth[found.ray], len(corners))
        return result

    def seen(self, which: Bools, faces: int) -> FloatArray:
        """(faces, d) how large what is seen of them looks from each direction, along those of the
        rays that are named, (r,)."""
        cell = (self.rays.extent / self.rays.cells) ** 2
        ray = np.flatnonzero(which & (self.first >= 0))
        index = self.first[ray] * self.directions + ray // self.rays.cells**2
        count = np.bincount(index, minlength=faces * self.directions)
        return np.asarray(cell * count.reshape(faces, self.directions))


def sights(corners: FloatArray, both_sides: Bools, reach: float) -> Sights:
    """Of faces (f, 3, 3), close enough for cracks between planes that move them by `reach`."""
    rays = Rays.around(corners, DIRECTIONS)
    cells = int(np.clip(rays.extent / max(CELL * reach, rays.extent / MOST), FEWEST, MOST))
    rays = replace(rays, cells=cells)
    first = np.full(DIRECTIONS * cells**2, -1, dtype=np.int64)
    for found in _by_view(rays, corners, both_sides):
        seen = nearest(found)
        first[found.ray[seen]] = found.face[seen]
    return Sights(rays, first)


def _by_view(rays: Rays, corners: FloatArray, both_sides: Bools) -> Iterator[Hits]:
    """Hits of triangles on the sides that show, direction by direction: few are kept at a time."""
    for nth, view in enumerate(rays.views):
        found = hits(replace(rays, views=view[None]), corners)
        found = found.of(found.front | both_sides[found.face])
        yield replace(found, ray=found.ray + nth * rays.cells**2)
