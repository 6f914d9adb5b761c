"""How low and how high the ground is that viewers stand on, in rectangles of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.tiles.placement import Placement
from vegtool.tiles.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Floor:
    """Ground in the scene's frame. feet: metres, the lowest and the highest foot of all plants,
    where there is no ground but theirs; else None."""

    terrain: Terrain
    feet: tuple[float, float] | None = None

    def height_at(self, x: float, z: float) -> float:
        """Metres, as paths are walked: 0 where there is no ground."""
        return float(self.terrain.height(np.array([[x, z]]))[0])

    def within(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds, (n,) metres each, in rectangles (n, 2) to (n, 2)."""
        grid, count = self.terrain.grid, len(low)
        if grid is None:
            least, greatest = self.feet or (self.terrain.base, self.terrain.base)
            return np.full(count, least), np.full(count, greatest)
        most = np.array(grid.values.shape[::-1]) - 1
        first = np.clip(np.floor(low / grid.step + most / 2), 0, most).astype(np.int64)
        last = np.clip(np.ceil(high / grid.step + most / 2), 0, most).astype(np.int64) + 1
        found = np.empty((2, count))
        for i, ((a, c), (b, d)) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
            part = grid.values[c:d, a:b]
            found[:, i] = part.min(), part.max()
        return found[0], found[1]

    def on_grid(self, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds, (b, a) metres each, within x[i] and z[j]; x: (a, 2), z: (b, 2)."""
        if self.feet is not None:
            shape = len(z), len(x)
            return np.full(shape, self.feet[0]), np.full(shape, self.feet[1])
        return self.terrain.heights_within(x, z)


def floor_of(terrain: Terrain, placement: Placement | None) -> Floor:
    """The ground of a scene. Where it has none, plants stand at heights of their own."""
    if terrain.kind != "none" or placement is None or not len(placement.tiles):
        return Floor(terrain)
    tiles = placement.tiles
    return Floor(terrain, (float(tiles.low[:, 1].min()), float(tiles.high[:, 1].max())))
