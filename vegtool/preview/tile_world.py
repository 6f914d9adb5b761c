"""A folder of tiles as a place to walk through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.tileset import TILESET
from vegtool.gl.landscape import GroundMesh
from vegtool.lighting.light import Sun
from vegtool.preview.eye import Eye, towards
from vegtool.preview.made_for import beyond
from vegtool.preview.options import FadeMode
from vegtool.preview.tile_forest import TileForest
from vegtool.preview.tileset import Tileset, read_tileset
from vegtool.preview.world import EYE_M, MARGIN_M, STAND_M
from vegtool.tiles.terrain import Terrain

LEVEL_M = 1.0
"""Metres between the lowest and the highest feet, up to which the ground is drawn as a plane."""
OUTSIDE = 1.5
"""Sizes of a stand, from its middle to the eye."""
BESIDE_M = 5.0
"""From the border of a landscape to the eye."""


@dataclass(frozen=True, eq=False)
class TileWorld:
    """See scenery.Place. Tilesets say nothing of the ground but where feet are."""

    tileset: Tileset
    start: Eye
    target: FloatArray
    ground: GroundMesh | None
    notes: tuple[str, ...] = ()
    sun: Sun | None = None
    way: Path | None = None
    orbited: bool = False
    file: Path = Path(TILESET)

    def told_of(self, eyes: Sequence[Eye], height_px: int) -> TileWorld:
        """The same, with a note where it is not made for these eyes, in pictures of that height."""
        made = self.tileset.made_for
        notes = () if made is None else beyond(self.file, made, eyes, height_px)
        return replace(self, notes=(*self.notes, *notes))

    @property
    def progressive(self) -> bool:
        """Whether any tile is surfels."""
        return bool(self.tileset.surfels.any())

    def height_at(self, x: float, z: float) -> float:
        """Metres: of the feet on the smallest tile there."""
        return _height(self.tileset, np.array([x, z]))

    def scenery(self, fade: FadeMode) -> TileForest:
        """What draws it; nothing is uploaded yet. Tiles follow each other at once,
        but those of surfels, which blend."""
        return TileForest(self.tileset, self.ground)

    def details(self, focal_px: float) -> list[str]:
        """From where tiles of each level are drawn, 0 being the finest."""
        found, tiles = [], self.tileset
        for depth in range(tiles.deepest + 1):
            here = tiles.shown & (tiles.depth == depth)
            if here.any():
                away = tiles.error_m[here].max() * focal_px / tiles.seen_px
                level, count = tiles.deepest - depth, int(here.sum())
                many = int(tiles.surfels[here].sum())
                of = f", {many:,} surfels" if many else ""
                found.append(f"level {level}: {count:,} tiles{of}, drawn from {away:,.3g} m")
        return found


def read_tile_world(file: Path) -> TileWorld:
    """The place of a tileset.json. Raises InputError for what is missing or broken."""
    tiles = read_tileset(file)
    low, high = tiles.low[0], tiles.high[0]
    size = high - low
    middle = (low + high) / 2
    small = bool(max(size[0], size[2]) < STAND_M)
    away = OUTSIDE * size.max() if small else size[2] / 2 + BESIDE_M
    xz = middle[[0, 2]] + np.array([0.0, away])
    base = _height(tiles, xz)
    eye = np.array([xz[0], base + EYE_M, xz[1]])
    target = np.array([middle[0], (base + high[1]) / 2, middle[2]])
    start = Eye(eye, 0.0, towards(target - eye)[1] if small else 0.0)
    ground: GroundMesh | None = None
    notes: tuple[str, ...] = ()
    feet = tiles.feet_m[0]
    if feet[1] - feet[0] <= LEVEL_M:
        extent = 2 * np.maximum(np.abs(low), np.abs(high))[[0, 2]] + 2 * MARGIN_M
        mesh = Terrain("plane", extent=extent, base=float(feet[0])).mesh(1)
        ground = GroundMesh(np.zeros(3), *mesh)
    else:
        notes = (f"{file}: has no ground, which is for the client to show; none is drawn",)
    return TileWorld(tiles, start, target, ground, notes, file=file)


def _height(tiles: Tileset, xz: FloatArray) -> float:
    """Of the feet on the deepest of the tiles that are nearest; no tile is nearer than those that
    it is in."""
    nearest, least, front = 0, np.inf, np.zeros(1, np.int64)
    while len(front):
        low, high = tiles.low[front][:, [0, 2]], tiles.high[front][:, [0, 2]]
        away = np.linalg.norm(np.maximum(0, np.maximum(low - xz, xz - high)), axis=1)
        away = np.round(away, 3)
        least = min(least, float(away.min()))
        front = front[away <= least]
        nearest = int(front[0]) if len(front) else nearest
        front = tiles.below(front)
    return float(tiles.feet_m[nearest].mean())
