"""Plants in folders, of few triangles, that the tests of libraries share."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from plants import plant_of

from vegtool.formats.gltf import plant_glb, write_chain
from vegtool.lod import Display, Level, LodChain
from vegtool.seeding import generator
from vegtool.tiles.library import MANIFEST

TRIANGLES = generator(0, "triangles").random((8, 3, 3))
TRIANGLES[..., 1] += 1


def write(folder: Path, name: str, distances: tuple[float, ...] = (10.0, 25.0)) -> Path:
    """A chain of meshes of 8, 7, ... triangles; returns its manifest."""
    levels = [Level("mesh", mesh=plant_of(TRIANGLES))]
    for index, distance in enumerate(distances, start=1):
        mesh = plant_of(TRIANGLES[: 8 - index])
        levels.append(Level("mesh", mesh=mesh, near_distance_m=distance))
    write_chain(LodChain(name, tuple(levels), Display(50.0, 900), 0), folder)
    return folder / f"{name}{MANIFEST}"


def edit(manifest: Path, change: Callable[[dict[str, Any]], None]) -> None:
    values = json.loads(manifest.read_bytes())
    change(values)
    manifest.write_text(json.dumps(values))


def model(folder: Path, name: str = "oak.glb") -> Path:
    path = folder / name
    path.write_bytes(plant_glb(plant_of(TRIANGLES)))
    return path
