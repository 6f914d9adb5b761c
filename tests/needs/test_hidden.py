"""What the ground hides: a ridge by hand, and hills against many lines of sight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from needs_cases import FLAT, hills, scene_with

from vegtool.arrays import FloatArray
from vegtool.needs.hidden import PLANES, hidden
from vegtool.needs.inside import inside
from vegtool.needs.viewers import Viewers, viewers_of
from vegtool.seeding import generator
from vegtool.tiles.grid import Grid
from vegtool.tiles.terrain import Terrain

CREST = 30.0
"""Metres: of a ridge along z, 20 m wide at its crest, on ground that is at 0 elsewhere."""


def ridge() -> Terrain:
    x = np.linspace(-150, 150, 151)
    height = np.clip(CREST * (60 - np.abs(x)) / 50, 0, CREST)
    extent = np.array([300.0, 300.0])
    return Terrain("heightmap", extent, Grid(np.tile(height, (151, 1)).astype(np.float32), extent))


def looking(folder: Path, ground: Terrain, low: float = 1.5, high: float = 2.0) -> Viewers:
    """From a patch 100 m before the ridge's middle."""
    camera = f"polygon = [[-105, -5], [-95, -5], [-95, 5], [-105, 5]]\nheight_m = [{low}, {high}]\n"
    return viewers_of(scene_with(folder, camera), ground)


def box(x: float, z: float, top: float) -> FloatArray:
    """Ten metres wide."""
    return np.array([[[x - 5, 0.0, z - 5], [x + 5, top, z + 5]]])


def test_what_is_behind_a_ridge(tmp_path: Path) -> None:
    """The crest begins 95 m from the farthest eye, 28 m above it, half of the way to the near side
    of a box, which is hidden up to 58 m, then. Boxes before the ridge and on it are seen, and so is
    all from above, and where the ridge ends."""
    behind = looking(tmp_path, ridge())
    assert hidden(box(90, 0, 25), behind).all() and hidden(box(90, 0, 55), behind).all()
    assert not hidden(box(90, 0, 59), behind).any()
    assert not hidden(box(-60, 0, 5), behind).any() and not hidden(box(0, 0, 35), behind).any()
    assert not hidden(box(90, 0, 5), looking(tmp_path, ridge(), 60, 60)).any()
    short = ridge()
    assert short.grid is not None
    cut = np.where(np.abs(np.linspace(-150, 150, 151))[:, None] < 40, short.grid.values, 0)
    short = Terrain("heightmap", short.extent, Grid(cut.astype(np.float32), short.grid.extent))
    assert hidden(box(60, 0, 5), looking(tmp_path, short)).all()
    assert not hidden(box(60, 100, 5), looking(tmp_path, short)).any()


def test_flat_ground_hides_nothing(tmp_path: Path) -> None:
    assert not hidden(box(90, 0, 1), looking(tmp_path, FLAT)).any()


def test_eyes_as_high_as_one_likes_see_all(tmp_path: Path) -> None:
    camera = "polygon = [[-105, -5], [-95, -5], [-95, 5], [-105, 5]]"
    assert not hidden(box(90, 0, 1), viewers_of(scene_with(tmp_path, camera), ridge())).any()


def test_ground_beyond_the_map_hides_nothing(tmp_path: Path) -> None:
    """A cliff at its border goes on for ever where heights are asked for there."""
    ground = ridge()
    assert ground.grid is not None
    values = np.zeros((151, 151), np.float32)
    values[:, 0] = 90.0
    ground = Terrain("heightmap", ground.extent, Grid(values, ground.grid.extent))
    assert not hidden(box(-200, 0, 5), looking(tmp_path, ground)).any()


@pytest.mark.parametrize("seed", range(2))
def test_no_line_of_sight_reaches_what_is_hidden(seed: int, tmp_path: Path) -> None:
    """Of thousands, between eyes and places in boxes that are hidden: each is under ground
    somewhere between. And boxes are found."""
    ground = hills(seed, rise=20.0)
    rng = generator(seed, "boxes")
    corner = rng.uniform(-25, 15, 2)
    (x, z), (w, d) = corner, corner + 8
    camera = f"polygon = [[{x}, {z}], [{w}, {z}], [{w}, {d}]]\nheight_m = [1, 1.8]\n"
    viewers = viewers_of(scene_with(tmp_path, camera), ground)
    low = rng.uniform(-39, 32, (300, 2))
    high = low + rng.uniform(1, 6, (300, 2))
    least, most = ground.heights_within(
        np.stack([low[:, 0], high[:, 0]], 1), np.stack([low[:, 1], high[:, 1]], 1)
    )
    bottom, top = np.diagonal(least), np.diagonal(most) + rng.uniform(0.2, 3, 300)
    boxes = np.stack(
        [
            np.stack([low[:, 0], bottom, low[:, 1]], 1),
            np.stack([high[:, 0], top, high[:, 1]], 1),
        ],
        axis=1,
    )
    found = boxes[hidden(boxes, viewers)]
    assert len(found) > 20
    eyes = inside(viewers, 100, seed).position
    places = rng.uniform(found[:, 0], found[:, 1], (20, len(found), 3)).reshape(-1, 3)
    picked = eyes[rng.integers(0, len(eyes), len(places))]
    share = np.linspace(0, 1, 8 * PLANES)[:, None, None]
    line = picked + share * (places - picked)
    under = line[..., 1] < ground.height(line[..., [0, 2]].reshape(-1, 2)).reshape(line.shape[:2])
    assert under.any(axis=0).all()
