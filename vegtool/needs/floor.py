"""How low and how high the ground is that viewers stand on, in rectangles of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.tiles.placement import Placement
from vegtool.tiles.terrain import Terrain

FEW = 3
"""Cells of a heightmap on a side of a rectangle whose bounds are taken exactly."""


@dataclass(frozen=True, eq=False)
class Floor:
    """Ground in the scene's frame. feet: metres, the lowest and the highest foot of all plants,
    where there is no ground but theirs; else None."""

    terrain: Terrain
    feet: tuple[float, float] | None = None

    def within(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds, (n,) metres each, in rectangles (n, 2) to (n, 2): the least there are, but for
        large ones, for which they are those of all samples that reach into them."""
        grid, count = self.terrain.grid, len(low)
        if grid is None:
            least, greatest = self.feet or (self.terrain.base, self.terrain.base)
            return np.full(count, least), np.full(count, greatest)
        half = (np.array(grid.values.shape[::-1]) - 1) / 2
        first, last = np.floor(low / grid.step + half), np.ceil(high / grid.step + half)
        found = np.empty((2, count))
        small = (last - first).max(axis=1) <= FEW
        # linear along x and along z between its samples: extreme at corners and on the grid's lines
        line = np.clip(
            (first[small, None] + np.arange(FEW + 1)[:, None] - half) * grid.step,
            low[small, None],
            high[small, None],
        )
        x, z = line[:, None, :, 0], line[:, :, None, 1]
        points = np.stack(np.broadcast_arrays(x, z), axis=-1)
        height = grid.at(points.reshape(-1, 2)).reshape(len(line), (FEW + 1) ** 2)
        found[:, small] = height.min(axis=1), height.max(axis=1)
        cells = [np.clip(end, 0, 2 * half).astype(np.int64) for end in (first, last)]
        for i in np.flatnonzero(~small):
            (a, c), (b, d) = cells[0][i], cells[1][i] + 1
            part = grid.values[c:d, a:b]
            found[:, i] = part.min(), part.max()
        return found[0], found[1]


def floor_of(terrain: Terrain, placement: Placement | None) -> Floor:
    """The ground of a scene. Where it has none, plants stand at heights of their own."""
    if terrain.kind != "none" or placement is None or not len(placement.tiles):
        return Floor(terrain)
    tiles = placement.tiles
    return Floor(terrain, (float(tiles.low[:, 1].min()), float(tiles.high[:, 1].max())))
