"""The way that an eye walks through a landscape: always the same, around what stands in its way.

Leg by leg the heading is drawn anew, from a seed, until nothing stands near the leg; of the seeds
the first one counts whose way goes nowhere nearer to the foot of a tree than CLEAR_M.
"""

from __future__ import annotations

from itertools import count
from math import cos, radians, sin
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.preview.eye import Eye
from vegtool.preview.path import CameraPath, Station, duration_s, eyes, read_path, written
from vegtool.preview.world import World
from vegtool.seeding import generator
from walk.scenes import TREES, Setting

SPEED_M_S, HEIGHT_M = 1.5, 1.7
LENGTH_M = 120.0
LEG_M = 4.0
VIEWS = 60
"""Frames of a walk: two metres apart."""
STATIONS = 10
"""Views that are compared with the truth."""
CLEAR_M = 1.0
"""Between the eye and the feet of trees."""
SPARE_M = 0.3
"""More than that along straight legs, which the way rounds."""
TURN_DEG = 40.0
"""Standard deviation of the heading about that of the whole way."""
TRIES = 400
"""Headings, before a seed is given up."""
AROUND = (*TREES, "bush")
"""What the way leads around."""


def views_of(setting: Setting, world: World, folder: Path) -> list[Eye]:
    """VIEWS eyes along the way, which is kept in FOLDER/path.toml."""
    file = folder / "path.toml"
    if not file.exists():
        file.write_text(written(_way(setting, world)), encoding="utf-8")
    path = read_path(file)
    rate = (VIEWS - 1) / duration_s(path, world.height_at)
    return eyes(path, rate, world.height_at)[:VIEWS]


def evenly(views: int, wanted: int) -> list[int]:
    """Which of the views are stations: `wanted` of them, the first and the last among them."""
    return sorted({round(i) for i in np.linspace(0, views - 1, wanted)})


def feet(setting: Setting, world: World, names: tuple[str, ...]) -> FloatArray:
    """(n, 2) metres, x and z of all plants of these kinds."""
    wanted = [i for i, name in enumerate(setting.kinds) if name in names]
    found = [np.zeros((0, 2))]
    for tile in range(len(world.placement.tiles)):
        plants = world.placement.plants(tile)
        there = plants.origin + plants.offset[np.isin(plants.species, wanted)]
        found.append(there[:, [0, 2]])
    return np.concatenate(found)


def _way(setting: Setting, world: World) -> CameraPath:
    around, trees = (feet(setting, world, names) for names in (AROUND, TREES))
    for seed in count():
        points = _legs(around, seed)
        if points is None:
            continue
        path = CameraPath(
            tuple(Station((float(x), HEIGHT_M, float(z)), above_ground=True) for x, z in points),
            speed_m_s=SPEED_M_S,
        )
        way = np.array([eye.position[[0, 2]] for eye in eyes(path, ground=world.height_at)])
        if _nearest(way, trees) >= CLEAR_M:
            return path
    raise AssertionError  # seeds do not end


def _legs(around: FloatArray, seed: int) -> FloatArray | None:
    """(n, 2) corners of a way along x through the middle, or None where it ends before."""
    random = generator(seed, "walk")
    points = [np.array([-LENGTH_M / 2, random.uniform(-10, 10)])]
    along = np.linspace(0, 1, 17)[:, None]
    for _ in range(TRIES):
        if _nearest(points[-1][None], around) < CLEAR_M + SPARE_M:
            return None
        heading = radians(random.normal(0, TURN_DEG))
        end = points[-1] + LEG_M * np.array([cos(heading), sin(heading)])
        leg = points[-1] + along * (end - points[-1])
        if _nearest(leg, around) >= CLEAR_M + SPARE_M:
            points.append(end)
        if len(points) > LENGTH_M / LEG_M:
            return np.array(points)
    return None


def _nearest(points: FloatArray, feet: FloatArray) -> float:
    """Metres between any of points (n, 2) and any of feet (m, 2)."""
    low, high = points.min(axis=0) - 2 * CLEAR_M, points.max(axis=0) + 2 * CLEAR_M
    near = feet[((feet >= low) & (feet <= high)).all(axis=1)]
    if not len(near):
        return np.inf
    return float(np.linalg.norm(points[:, None] - near, axis=2).min())
