"""Plants on the ground, tile by tile: what every way of placing them gives."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, SingleArray, checked
from vegtool.errors import UsageError
from vegtool.progress import Progress, silent

if TYPE_CHECKING:
    from vegtool.scene import Scene
    from vegtool.tiles.terrain import Terrain

BoolArray = npt.NDArray[np.bool_]
LongArray = npt.NDArray[np.int64]

METHODS = {
    "inventory": "vegtool.tiles.inventory",
    "spacing_m": "vegtool.tiles.procedural",
}
"""Key of [placement] that asks for it -> module whose `place` places the plants."""

TILE_M = 128.0
"""Metres: side of a tile. A wood has some 1,000 to 4,000 plants on one."""


@dataclass(frozen=True, eq=False)
class Plants:
    """Plants of one tile, most important first: any first part of them is spread evenly too.

    origin: (3,) float64 metres in the scene's frame (y up, right-handed), a point of the tile.
    offset: (n, 3) float32 metres from origin to the plant's foot.
    species: (n,) int32 index into the scene's species.
    yaw: (n,) float32 radians about +y.
    height: (n,) float32 metres; NaN: the model's own.
    tint: (n, 3) float32 linear factors of the colour, near 1.
    row: (n,) int64, which plant it is: the inventory's row, from 1, or a number made of its place
    in the pattern that is repeated.
    """

    origin: FloatArray
    offset: SingleArray
    species: IntArray
    yaw: SingleArray
    height: SingleArray
    tint: SingleArray
    row: LongArray

    def __post_init__(self) -> None:
        offset = checked("Plants.offset", self.offset, (None, 3), np.float32)
        count = len(offset)
        heights = np.ascontiguousarray(self.height, dtype=np.float32)
        known = np.where(np.isnan(heights), np.float32(1), heights)  # NaN is a value of its own
        if not (checked("Plants.height", known, (count,), np.float32) > 0).all():
            raise ValueError("Plants.height: must be more than 0, or NaN")
        heights = heights.view()
        heights.flags.writeable = False
        species = checked("Plants.species", self.species, (count,), np.int32)
        if count and species.min() < 0:
            raise ValueError("Plants.species: indices must be at least 0")
        for name, value in (
            ("origin", checked("Plants.origin", self.origin, (3,), np.float64)),
            ("offset", offset),
            ("species", species),
            ("yaw", checked("Plants.yaw", self.yaw, (count,), np.float32)),
            ("height", heights),
            ("tint", checked("Plants.tint", self.tint, (count, 3), np.float32)),
            ("row", checked("Plants.row", self.row, (count,), np.int64)),
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.offset)


@dataclass(frozen=True, eq=False)
class Tiles:
    """Squares of ground with plants on them.

    low, high: (t, 3) float64 metres, bounds of the feet of the plants of each tile (crowns not
    included). count: (t,) int64, how many plants, an upper bound where they are procedural. cell:
    (t, 2) int64, column along x and row along z of each square; None where feet stay on theirs, so
    that the middle of the bounds tells.
    """

    low: FloatArray
    high: FloatArray
    count: LongArray
    cell: LongArray | None = None

    def __post_init__(self) -> None:
        low = checked("Tiles.low", self.low, (None, 3), np.float64)
        high = checked("Tiles.high", self.high, (len(low), 3), np.float64)
        count = checked("Tiles.count", self.count, (len(low),), np.int64)
        if (low > high).any():
            raise ValueError("Tiles.low: must not be above Tiles.high")
        if len(count) and count.min() < 1:
            raise ValueError("Tiles.count: a tile without plants is none")
        for name, value in (("low", low), ("high", high), ("count", count)):
            object.__setattr__(self, name, value)
        if self.cell is not None:
            cell = checked("Tiles.cell", self.cell, (len(low), 2), np.int64)
            object.__setattr__(self, "cell", cell)

    def __len__(self) -> int:
        return len(self.count)


class Placement(Protocol):
    """The plants of a scene, on square tiles."""

    @property
    def tile_m(self) -> float:
        """Metres: side of the tiles."""

    @property
    def origin(self) -> FloatArray:
        """(3,) float64 metres east, north and up: what was subtracted from the map's coordinates
        to get the scene's frame, x = east, y = up, z = -north; zeros if nothing was."""

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of `origin`, such as EPSG:25832; None where that is no
        place on a map that is known."""

    @property
    def tiles(self) -> Tiles:
        """Where there are plants, and how many."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was repaired, left out or guessed; to be shown to the user."""

    def tallest(self, count: int) -> FloatArray:
        """(count,) metres that no plant of each species is taller than; NaN: the model's own."""

    def measured(self, count: int) -> BoolArray:
        """(count,) bool, whether all plants of each species have a height of their own; those that
        have none are as tall as their model."""

    def plants(self, tile: int, most: int | None = None) -> Plants:
        """The plants of a tile, 0..t-1, or the first `most` of them."""


def placement_of(
    scene: Scene, terrain: Terrain, tile_m: float = TILE_M, progress: Progress = silent
) -> Placement:
    """The plants of a scene, by its [placement] and [[species]], on that ground.

    tile_m: metres, the wanted side of a tile; procedural ones come within a factor of 1.5 of it
    where the spacing lets them.
    Raises UsageError for tables that say too little, too much or nothing that can grow, InputError
    for a file that is missing or broken; both with the file and the line or row.
    """
    if not tile_m > 0:
        raise UsageError(f"tile: expected a side of more than 0 metres; got {tile_m:g}")
    asked = [key for key in METHODS if getattr(scene.placement, key) is not None]
    if len(asked) != 1:
        found = "got both" if asked else "got neither"
        where = scene.at("placement", asked[0]) if asked else scene.at("placement")
        raise UsageError(f"{where}: expected one of {', '.join(METHODS)} in [placement]; {found}")
    if not scene.species:
        raise UsageError(f"{scene.path}: expected a [[species]] for plants to be of; got none")
    placement: Placement = import_module(METHODS[asked[0]]).place(scene, terrain, tile_m, progress)
    return placement
