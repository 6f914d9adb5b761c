"""Plants, grounds and cameras that the tests of this folder share."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from plants import plant_of

from vegtool.arrays import FloatArray
from vegtool.lod import Display
from vegtool.scene import Scene, read_scene
from vegtool.tiles.grid import Grid
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Plants, Tiles
from vegtool.tiles.terrain import Terrain

FLAT = Terrain("plane", extent=np.array([400.0, 400.0]))
HEIGHT = 10.0
"""Metres: of the tree, whose middle is at 5 m."""


def tree(switch_m: tuple[float, ...] = (0.0, 20.0, 50.0), fade: float = 0.1) -> Species:
    """2 m to all sides of its foot and 10 m high, in the frame of its bounds."""
    corners = [[[-2, 0, -2], [2, 0, 2], [0, 10, 0]], [[2, 0, -2], [-2, 0, 2], [0, 10, 0]]]
    count = len(switch_m)
    fades = np.array([0.0] + [fade] * (count - 1))
    levels = (plant_of(corners),) * count
    focal, files = Display().pixels_per_metre(1.0), (Path("tree.glb"),) * count
    return Species("tree", levels, np.array(switch_m), fades, focal, files)


@dataclass(frozen=True, eq=False)
class Standing:
    """A placement of some plants of the first species, cut into tiles of so many of them."""

    foot: FloatArray
    yaw: FloatArray
    height: FloatArray
    of_tile: int = 4
    tile_m: float = 32.0
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    crs: str | None = None
    notes: tuple[str, ...] = ()

    def _part(self, tile: int) -> slice:
        return slice(tile * self.of_tile, (tile + 1) * self.of_tile)

    @property
    def tiles(self) -> Tiles:
        parts = [self.foot[self._part(i)] for i in range(-(-len(self.foot) // self.of_tile))]
        return Tiles(
            np.array([part.min(axis=0) for part in parts]),
            np.array([part.max(axis=0) for part in parts]),
            np.array([len(part) for part in parts]),
        )

    def tallest(self, count: int) -> FloatArray:
        return np.full(count, self.height.max())

    def measured(self, count: int) -> np.ndarray:
        return np.ones(count, np.bool_)

    def plants(self, tile: int, most: int | None = None) -> Plants:
        part = self._part(tile)
        foot, count = self.foot[part], len(self.foot[part])
        return Plants(
            np.zeros(3), foot.astype(np.float32), np.zeros(count, np.int32), self.yaw[part],
            self.height[part], np.ones((count, 3), np.float32), np.arange(count),
        )  # fmt: skip


def standing(
    foot: list[list[float]], yaw: list[float] | None = None, height: list[float] | None = None
) -> Standing:
    count = len(foot)
    return Standing(
        np.array(foot, np.float64),
        np.zeros(count) if yaw is None else np.array(yaw),
        np.full(count, HEIGHT) if height is None else np.array(height),
    )


def hills(seed: int = 0, size: float = 80.0, rise: float = 12.0) -> Terrain:
    """Waves of that height from crest to trough, on a grid of 2 m."""
    count = int(size / 2) + 1
    x, z = np.meshgrid(*[np.linspace(-size / 2, size / 2, count)] * 2)
    values = rise / 2 * np.sin(x / 9 + seed) * np.cos(z / 13) + 100
    extent = np.full(2, size)
    return Terrain("heightmap", extent, Grid(values.astype(np.float32), extent))


def scene_with(folder: Path, camera: str, path: str | None = None) -> Scene:
    """A scene whose [camera] says that, and whose path, if any, is in path.toml."""
    if path is not None:
        (folder / "path.toml").write_text(path, encoding="utf-8")
        camera = f'path = "path.toml"\n{camera}'
    file = folder / "scene.toml"
    file.write_text(f"[camera]\n{camera}\n", encoding="utf-8")
    return read_scene(file)


def stations(*lines: str, head: str = "") -> str:
    return head + "".join(f"\n[[station]]\n{line}\n" for line in lines)
