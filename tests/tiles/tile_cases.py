"""Scenes, pictures and plain oracles that several tests of this folder use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vegtool.scene import Scene, read_scene
from vegtool.tiles.placement import Placement, Plants, placement_of
from vegtool.tiles.terrain import terrain_of

TWO_SPECIES = """
[[species]]
name = "ash"
model = "ash.glb"

[[species]]
name = "pine"
model = "pine.glb"
"""


def scene_of(folder: Path, text: str) -> Scene:
    """A scene file, written and read."""
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return read_scene(path)


def placed(folder: Path, text: str, tile_m: float = 128.0) -> Placement:
    """The plants of a scene file."""
    scene = scene_of(folder, text)
    return placement_of(scene, terrain_of(scene), tile_m)


def picture(path: Path, values: Any, bits: int = 16) -> None:
    """A grey PNG with these values, the first row on top."""
    Image.fromarray(np.asarray(values, dtype=np.uint16 if bits == 16 else np.uint8)).save(path)


def feet(plants: Plants) -> np.ndarray:
    """(n, 3) float64 metres in the scene's frame."""
    return plants.origin + plants.offset.astype(np.float64)


def all_of(placement: Placement) -> list[Plants]:
    return [placement.plants(tile) for tile in range(len(placement.tiles))]


def bytes_of(plants: Plants) -> bytes:
    names = ("origin", "offset", "species", "yaw", "height", "tint", "row")
    return b"".join(getattr(plants, name).tobytes() for name in names)


def least_distance(points: np.ndarray) -> float:
    """Between any two points (n, d), one after the other."""
    return min(
        float(np.linalg.norm(points[i + 1 :] - point, axis=1).min())
        for i, point in enumerate(points[:-1])
    )


def torus_distances(points: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(n,) from points (n, 2) in the unit square to one, the shorter way round."""
    away = np.abs(points - point)
    return np.asarray(np.linalg.norm(np.minimum(away, 1 - away), axis=-1))
