"""The way that an eye walks: along the trail, looking where it goes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.camera_path.file import CameraPath, Station, read_path, written
from vegtool.preview.eye import Eye
from vegtool.preview.path import duration_s, eyes
from vegtool.preview.world import World
from walk.scenes import TREES, Setting
from walk.trail import middle

SPEED_M_S, HEIGHT_M = 1.5, 1.7
HALF_M = 55.0
"""Along x, from the middle of the landscape to either end: 120 m of trail."""
STATION_M = 5.0
VIEWS = 60
"""Frames of a walk: two metres apart."""
STATIONS = 10
"""Views that are compared with the truth."""
CLEAR_M = 1.0
"""From the eye to the feet of trees at least."""


def views_of(setting: Setting, world: World, folder: Path) -> list[Eye]:
    """VIEWS eyes along the way, which is written as FOLDER/path.toml.

    Raises ValueError where it leads into a tree.
    """
    x = np.arange(-HALF_M, HALF_M + STATION_M / 2, STATION_M)
    stations = tuple(
        Station((float(a), HEIGHT_M, float(b)), above_ground=True)
        for a, b in zip(x, middle(x), strict=True)
    )
    file = folder / "path.toml"
    file.write_text(written(CameraPath(stations, speed_m_s=SPEED_M_S)), encoding="utf-8")
    path = read_path(file)
    rate = (VIEWS - 1) / duration_s(path, world.height_at)
    found = eyes(path, rate, world.height_at)[:VIEWS]
    trees = feet(setting, world)
    for index, eye in enumerate(found):
        near = np.linalg.norm(trees - eye.position[[0, 2]], axis=1).min(initial=np.inf)
        if near < CLEAR_M:
            raise ValueError(f"{setting.name}: view {index} is {near:.2f} m from a tree")
    return found


def evenly(views: int, wanted: int) -> list[int]:
    """Which of the views are stations: `wanted` of them, the first and the last among them."""
    return sorted({round(i) for i in np.linspace(0, views - 1, wanted)})


def feet(setting: Setting, world: World) -> FloatArray:
    """(n, 2) metres, x and z of all trees."""
    wanted = [i for i, name in enumerate(setting.kinds) if name in TREES]
    found = []
    for tile in range(len(world.placement.tiles)):
        plants = world.placement.plants(tile)
        there = plants.origin + plants.offset[np.isin(plants.species, wanted)]
        found.append(there[:, [0, 2]])
    return np.concatenate(found)
