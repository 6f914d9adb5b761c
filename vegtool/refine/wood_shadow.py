"""What a surface covers, seen from all around: its outlines on small grids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray

DIRECTIONS = 8
"""Of a half sphere; an outline is the same from behind."""
CELLS = 128
"""Of a grid along the longest extent."""
ROOM = 1.2
"""Of the extent, that a grid shows: what is drawn in place of a surface may reach farther."""


@dataclass(frozen=True, eq=False)
class Shadows:
    """Grids that triangles are drawn on. middle: (3,). extent: length of a grid's side."""

    middle: FloatArray
    extent: float
    directions: int = DIRECTIONS
    cells: int = CELLS

    @staticmethod
    def around(corners: FloatArray) -> Shadows:
        """Grids for triangles (f, 3, 3), whose bounds are not a point."""
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        return Shadows((low + high) / 2, ROOM * float(np.linalg.norm(high - low)))

    @property
    def cell(self) -> float:
        """The area of one cell, in the mean over the directions."""
        return (self.extent / self.cells) ** 2 / self.directions

    def of(self, corners: FloatArray) -> npt.NDArray[np.bool_]:
        """(directions, cells, cells) which cells triangles (f, 3, 3) cover, from either side.

        Their sum times `cell` is the mean area that they cover.
        """
        local = (corners - self.middle) / self.extent * self.cells
        nth = np.arange(self.directions)
        up = (nth + 0.5) / self.directions
        turn = np.pi * nth * (5**0.5 - 1)
        across = np.sqrt(1 - up * up)
        views = np.stack([across * np.cos(turn), up, across * np.sin(turn)], axis=1)
        right = np.cross([0.0, 1.0, 0.0], views)
        right /= np.linalg.norm(right, axis=1)[:, None]
        frames = np.stack([right, np.cross(views, right)], axis=2)
        return np.stack([_covered(local @ f + self.cells / 2, self.cells) for f in frames])


def _covered(corners: FloatArray, cells: int) -> npt.NDArray[np.bool_]:
    """(cells, cells) those whose middles lie in any of the triangles (f, 3, 2), in cells."""
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, cells).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1) - 0.5), -1, cells - 1).astype(np.int64)
    size = np.maximum(high - low + 1, 0)
    count = size.prod(axis=1)
    face = np.repeat(np.arange(len(corners)), count)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    x = low[face, 0] + nth % size[face, 0]
    y = low[face, 1] + nth // size[face, 0]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]

    def beside(p: FloatArray, q: FloatArray) -> FloatArray:
        dx, dy = (q - p).T
        offset = dx * p[:, 1] - dy * p[:, 0]
        return np.asarray(dx[face] * (y + 0.5) - dy[face] * (x + 0.5) - offset[face])

    sides = np.stack([beside(a, b), beside(b, c), beside(c, a)])
    inside = (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)
    grid = np.zeros((cells, cells), dtype=bool)
    grid[y[inside], x[inside]] = True
    return grid
