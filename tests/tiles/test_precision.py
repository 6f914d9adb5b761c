"""A forest far from a map's origin, read back from its tiles as a client reads them: every plant is
where the inventory says, beside its neighbours, to a millimetre.

As clients do, transforms are multiplied in double precision down to a tile; in its file, what is
stored is in single precision, or in 16 bits. A plant is where the mean of its vertices is, less the
mean of its model's.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_tiles_run import library
from tile_cases import scene_of

from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.gltf_tile import INSTANCING
from vegtool.seeding import generator
from vegtool.tiles.georeference import earth_from_scene
from vegtool.tiles.options import TileOptions
from vegtool.tiles.pyramid import Pyramid, pyramid_of
from vegtool.tiles.quadtree import Node
from vegtool.tiles.run import file_of, write_tiles
from vegtool.tiles.shared import shared_of

EASTING, NORTHING = 5e5, 5e6
MILLIMETRE = 1e-3
COUNT = 300
SCENE = """
[terrain]
crs = "EPSG:32632"

[[species]]
name = "ash"

[placement]
inventory = "plants.csv"
"""


def forest(folder: Path, side_m: float) -> np.ndarray:
    """(n, 2) metres east and north, as the inventory says, to a tenth of a millimetre. All plants
    are equally high, so that a merged tile has them in one order, that of its stand."""
    rng = generator(0, "forest")
    places = np.add(np.round(rng.uniform(0, side_m, (COUNT, 2)), 4), (EASTING, NORTHING))
    up = rng.uniform(400, 440, COUNT)
    rows = [f"{x:.4f},{y:.4f},{z:.3f},3.25" for (x, y), z in zip(places, up, strict=True)]
    (folder / "plants.csv").write_text("\n".join(["x,y,z,height", *rows]))
    return places


def written(folder: Path, **options: Any) -> Pyramid:
    scene = scene_of(folder, SCENE)
    made = pyramid_of(scene, library(folder), TileOptions(**options))
    list(write_tiles(made, folder / "out"))
    return made


def contents(folder: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Each tile's file, and (4, 4) from the tile, z up, to the tileset's frame."""

    def walk(tile: dict[str, Any], above: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        matrix = above @ np.array(tile["transform"], np.float64).reshape(4, 4).T
        yield tile["content"]["uri"], matrix
        for child in tile.get("children", ()):
            yield from walk(child, matrix)

    yield from walk(json.loads((folder / "tileset.json").read_bytes())["root"], np.eye(4))


def plants_in(made: Pyramid, node: Node, path: Path) -> np.ndarray:
    """(n, 3) metres from the tile's origin, y up, in the order of the stand."""
    file, stand = open_gltf(path), made.stand(node)
    if made.instanced(made.tree.height(node.level)):
        found = [
            file.accessor(one["extensions"][INSTANCING]["attributes"]["TRANSLATION"])
            for one in file.json["nodes"] if INSTANCING in one.get("extensions", {})
        ]  # fmt: skip
        assert len(found) == 1 and found[0].dtype == np.float32
        return found[0].astype(np.float64)
    (one,) = (one for one in file.json["nodes"] if "mesh" in one)
    (primitive,) = file.json["meshes"][one["mesh"]]["primitives"]
    stored = file.accessor(primitive["attributes"]["POSITION"])
    vertices = stored * one.get("scale", [1, 1, 1])[0] + one.get("translation", [0, 0, 0])
    each = vertices.reshape(len(stand), -1, 3)
    height = made.tree.height(node.level)
    parts = shared_of(made, range(height, height + 1)).sheets[height].sheet.parts
    (model,) = (one.positions for one in parts if len(one.positions) == each.shape[1])
    x, y, z = model.mean(axis=0)
    cos, sin = np.cos(stand.yaw), np.sin(stand.yaw)
    middle = np.stack([cos * x + sin * z, np.full(len(stand), y), cos * z - sin * x], axis=1)
    return np.asarray(each.mean(axis=1) - stand.scale[:, None] * middle)


def on_the_map(made: Pyramid, folder: Path, base: np.ndarray) -> dict[int, np.ndarray]:
    """By level, (n, 2) metres east and north of the scene's origin, by row: through a globe's
    coordinates, where base, (4, 4), is of those."""
    levels = range(made.tree.depth + 1)
    nodes = {file_of(node): node for level in levels for node in made.tree.nodes(level)}
    found = {level: np.full((COUNT, 2), np.nan) for level in levels}
    back = np.linalg.inv(base)
    for name, matrix in contents(folder):
        node = nodes[name]
        x, y, z = plants_in(made, node, folder / name).T
        local = np.stack([x, -z, y, np.ones_like(x)])
        found[node.level][made.stand(node).row - 1] = (back @ (base @ matrix @ local))[:2].T
    return found


def off(found: np.ndarray, wanted: np.ndarray) -> float:
    """The greatest error of one plant's place as seen from another's, metres."""
    away = found - wanted
    return float(np.ptp(away, axis=0).max())


@pytest.mark.parametrize(
    ("side_m", "options"),
    [
        (120.0, {"tile": 32.0}),
        (56.0, {"tile": 14.0, "near": 1}),
        (120.0, {"tile": 32.0, "plain": True}),
        (4000.0, {"tile": 1000.0, "near": 1, "plain": True}),
    ],
)  # fmt: skip
def test_plants_are_where_they_are_beside_each_other(
    tmp_path: Path, side_m: float, options: dict[str, Any]
) -> None:
    """On every level of tiles, and with the earth's coordinates in between too."""
    wanted = forest(tmp_path, side_m)
    made = written(tmp_path, **options)
    assert made.placement.origin[:2] == pytest.approx((EASTING, NORTHING), abs=side_m)
    earth = earth_from_scene(made.placement.crs, made.placement.origin, 420.0)
    assert earth is not None and np.linalg.norm(earth[:3, 3]) > 6e6
    for base in (np.eye(4), earth):
        levels = on_the_map(made, tmp_path / "out", base)
        assert len(levels) == 3
        for level, found in levels.items():
            assert off(found, wanted - made.placement.origin[:2]) < MILLIMETRE, f"level {level}"
