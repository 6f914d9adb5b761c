"""Tilesets that are for the viewers of a scene: others are told."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cards import cards

from vegtool.errors import InputError
from vegtool.formats.gltf import plant_glb
from vegtool.formats.tileset import TileEntry, tileset_files
from vegtool.preview.eye import Eye
from vegtool.preview.made_for import beyond, made_for
from vegtool.preview.tile_world import read_tile_world

FILE = Path("tiles/tileset.json")
AREA: dict[str, Any] = {
    "file": "scene.toml", "bounds_m": [[-1, 1.5, -1], [11, 2, 11]],
    "corners_m": [[0, 0], [10, 0], [10, 10]], "along": False, "reach_m": 1.0,
    "fov_y_deg": 60.0, "image_height_px": 1080,
}  # fmt: skip
"""A triangle of ground, and 1 m around it; eyes of 1.5 to 2 m."""
ROAD = {
    **AREA,
    "corners_m": [[0, 0], [10, 0]],
    "along": True,
    "bounds_m": [[-1, 1, -1], [11, 2, 1]],
}


def eye(x: float, y: float, z: float, fov: float = 60.0) -> Eye:
    return Eye(np.array([x, y, z]), fov_y_deg=fov)


def test_how_far_an_eye_is_outside() -> None:
    """In the triangle; 1 m beside it; 2 m beside that; before its long side, sqrt(2) / 2 m from it
    for each metre; and half a metre too high."""
    places = np.array(
        [[8, 1.6, 2], [5, 1.6, -1], [5, 1.6, -3], [2, 1.6, 8], [8, 2.5, 2]], dtype=np.float64
    )
    away = made_for(AREA).outside_m(places)
    np.testing.assert_allclose(away, [0, 0, 2, 6 / np.sqrt(2) - 1, 0.5], atol=1e-12)
    road = made_for(ROAD)
    np.testing.assert_allclose(
        road.outside_m(np.array([[5, 1.6, 0.9], [5, 1.6, 3.0], [14, 1.6, 0.0]])), [0, 2, 3]
    )


def test_what_is_as_high_as_one_likes_is_never_above() -> None:
    anywhere = made_for({**AREA, "bounds_m": [[-1, 0, -1], [11, None, 11]]})
    assert not anywhere.is_outside(eye(8, 1e4, 2), 1080)


def test_finer_pictures_are_others() -> None:
    """By as much as a metre is more pixels of them."""
    made = made_for(AREA)
    assert not made.is_outside(eye(8, 1.6, 2), 1080)
    assert not made.is_outside(eye(8, 1.6, 2), 720)
    assert made.is_outside(eye(8, 1.6, 2), 1440)
    assert made.is_outside(eye(8, 1.6, 2, 40), 1080)
    assert made.times(eye(8, 1.6, 2), 2160) == pytest.approx(2)


def test_it_is_said_once_of_all_eyes() -> None:
    made = made_for(AREA)
    inside = [eye(8, 1.6, 2), eye(9, 1.8, 3)]
    assert beyond(FILE, made, inside, 1080) == ()
    (note,) = beyond(FILE, made, [*inside, eye(5, 1.6, -3), eye(5, 1.6, -5)], 1080)
    assert "of 4 eyes 2 are up to 4 m outside" in note and "finer" in note
    assert "vegtool tiles SOURCE --species LIBRARY -o tiles" in note and "scene.toml" in note
    (note,) = beyond(FILE, made, inside, 2160)
    assert "2 times as fine" in note and "outside" not in note


def tileset(folder: Path, scene: Any) -> Path:
    (folder / "tile.glb").write_bytes(plant_glb(cards(np.zeros((1, 3)), 1.0)))
    box = np.array([[-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]])
    root = TileEntry("tile.glb", np.zeros(3), box, 1.0, 1)
    for name, data in tileset_files(root, None, scene=scene).items():
        (folder / name).write_bytes(data)
    return folder / "tileset.json"


def test_a_folder_says_whom_it_is_for(tmp_path: Path) -> None:
    world = read_tile_world(tileset(tmp_path, AREA))
    assert len(world.told_of([eye(50, 1.6, 0)], 1080).notes) == len(world.notes) + 1
    assert world.told_of([eye(8, 1.6, 2)], 1080).notes == world.notes
    anyone = read_tile_world(tileset(tmp_path, None))
    assert anyone.told_of([eye(50, 1.6, 0)], 1080).notes == anyone.notes
    assert replace(anyone.tileset, made_for=None).made_for is None


@pytest.mark.parametrize(
    "key, value",
    [("corners_m", [[0, 0, 0]]), ("bounds_m", [[0], [0]]), ("fov_y_deg", 0), ("reach_m", "far")],
)
def test_what_is_broken_is_said(key: str, value: object, tmp_path: Path) -> None:
    file = tileset(tmp_path, json.loads(json.dumps({**AREA, key: value})))
    with pytest.raises(InputError, match="made again"):
        read_tile_world(file)
