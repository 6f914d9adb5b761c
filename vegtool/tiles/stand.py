"""Plants of some tiles as models that stand there: which, how large, how turned, of what colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from vegtool.arrays import FloatArray, IntArray, SingleArray
from vegtool.tiles.library import Species
from vegtool.tiles.placement import LongArray, Placement


@dataclass(frozen=True, eq=False)
class Stand:
    """n plants. foot: (n, 3) float64 metres in the scene's frame. species: (n,) int32. scale: (n,)
    of the model. yaw: (n,) radians about +y. tint: (n, 3) linear factors. row: (n,) which plant.
    tile: (n,) int64 the placement's tile that each is on."""

    foot: FloatArray
    species: IntArray
    scale: FloatArray
    yaw: FloatArray
    tint: SingleArray
    row: LongArray
    tile: LongArray

    def __len__(self) -> int:
        return len(self.foot)

    def on(self, tiles: LongArray) -> Stand:
        """The plants on some of the tiles alone, in their order."""
        kept = np.isin(self.tile, tiles)
        return Stand(*(getattr(self, item.name)[kept] for item in fields(self)))


def stand_on(placement: Placement, tiles: LongArray, species: Sequence[Species]) -> Stand:
    """The plants of one tile or more, in the placement's order."""
    found = [placement.plants(int(tile)) for tile in tiles]
    kind = np.concatenate([plants.species for plants in found])
    own = np.array([one.height for one in species])
    height = np.concatenate([plants.height for plants in found]).astype(np.float64)
    return Stand(
        np.concatenate([plants.origin + plants.offset.astype(np.float64) for plants in found]),
        kind,
        np.where(np.isfinite(height), height / own[kind], 1.0),
        np.concatenate([plants.yaw for plants in found]).astype(np.float64),
        np.concatenate([plants.tint for plants in found]),
        np.concatenate([plants.row for plants in found]),
        np.repeat(tiles, [len(plants) for plants in found]),
    )
