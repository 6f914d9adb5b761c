"""Squares of surfels in programs of others: valid glTF, and points in 3d-tiles-renderer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from programs import MARKS, node
from surfel_sets import ball

from vegtool.formats.gltf_tile import surfels_glb
from vegtool.formats.tileset import CLIENT_PX, TILESET, TileEntry, tileset_files
from vegtool.lighting.light import Light
from vegtool.preview.eye import Eye, towards
from vegtool.preview.scenery import Look
from vegtool.preview.tile_forest import TileForest
from vegtool.preview.tileset import read_tileset

pytestmark = MARKS
SIDE = 240
LIGHT = Light()
KNOWN = "TilesRenderer: tiles versions at 1.1 or higher have limited support."
GIVES_WAY = 40.0
"""Metres from the root's box."""
STATIONS = {"far": 50.0, "near": 20.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball of a radius of 2 m as 500 surfels; below, as 2,000, in floats."""
    place = tmp_path_factory.mktemp("squares")
    (place / "tiles").mkdir()
    (place / "tiles" / "root.glb").write_bytes(surfels_glb(ball(500, 2.0), "root"))
    (place / "tiles" / "child.glb").write_bytes(surfels_glb(ball(2000, 2.0), "child", plain=True))
    bounds = np.array([[-2.0] * 3, [2.0] * 3])
    focal = Eye(np.zeros(3)).focal_px(SIDE)
    child = TileEntry("tiles/child.glb", np.zeros(3), bounds, 0.0, 1, surfels=2000)
    root = TileEntry(
        "tiles/root.glb", np.zeros(3), bounds, GIVES_WAY * CLIENT_PX / focal, 1,
        children=(child,), surfels=500,
    )  # fmt: skip
    (place / TILESET).write_bytes(tileset_files(root, None)[TILESET])
    return place


def test_files_of_surfels_are_valid(folder: Path) -> None:
    files = [str(file) for file in sorted((folder / "tiles").glob("*.glb"))]
    for answer in node("validate.mjs", {"files": files, "alone": True}):
        assert answer["messages"] == [], answer["file"]


def test_a_client_draws_all_points_of_the_tiles_that_we_draw(folder: Path, tmp_path: Path) -> None:
    """A pixel each: within the ball, none outside, more of them from nearby; nobody complains."""
    stations, eyes = [], []
    for name, away in STATIONS.items():
        place = np.array([0.0, 0.0, away + 2.0])
        eyes.append(Eye(place, *towards(-place)))
        stations.append(
            {
                "eye": place.tolist(), "target": [0, 0, 0], "fov": 60.0, "near": 0.1,
                "far": 1000.0, "sun": LIGHT.direction.tolist(), "out": str(tmp_path / name),
            }
        )  # fmt: skip
    job = {
        "width": SIDE, "height": SIDE, "error": CLIENT_PX,
        "light": {"sun": LIGHT.sun, "above": LIGHT.sky_above, "below": LIGHT.sky_below},
        "visits": [{"folder": str(folder), "stations": stations}],
    }  # fmt: skip
    (answer,) = node("fly_over_tiles.mjs", job)
    assert answer["failed"] == [] and {c for c in answer["complaints"] if KNOWN not in c} == set()
    tileset = read_tileset(folder / TILESET)
    for eye, (name, away), found in zip(eyes, STATIONS.items(), answer["stations"], strict=True):
        chosen = TileForest(tileset).choose(eye, (SIDE, SIDE), Look())
        ours = [Path(tileset.file[tile] or "").relative_to(folder).as_posix() for tile in chosen]
        assert found["drawn"] == ours and found["calls"] == 1
        half = np.frombuffer((tmp_path / name).read_bytes(), np.float16).reshape(SIDE, SIDE, 4)
        y, x = np.nonzero(half[..., 3] > 0.1)
        radius = eye.focal_px(SIDE) * 2 / away
        assert np.hypot(x + 0.5 - SIDE / 2, y + 0.5 - SIDE / 2).max() < radius + 1.5
        assert len(x) > 0.6 * np.pi * (radius - 1) ** 2
