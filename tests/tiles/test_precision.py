"""A forest far from a map's origin, read back from its tiles as a client reads them: every plant is
where the inventory says, beside its neighbours, to a millimetre.

As clients do, transforms are multiplied in double precision down to a tile; in its file, what is
stored is in single precision, or in 16 bits. A plant is where the mean of its vertices is, less the
mean of its model's.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_tiles_run import library, world, write_tiles
from tile_cases import scene_of

from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.gltf_tile import INSTANCING
from vegtool.seeding import generator
from vegtool.tiles.jobs import file_of
from vegtool.tiles.options import TileOptions
from vegtool.tiles.pyramid import Pyramid, pyramid_of
from vegtool.tiles.quadtree import Node, quadtree_of

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
    # without the squares above, which have no single plants
    made = replace(made, tree=quadtree_of(made.placement.tiles, made.placement.tile_m))
    write_tiles(made, folder / "out")
    return made


def contents(folder: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Each tile's file, and (4, 4) from the tile, z up, to the earth's frame."""

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
    parts = world(made, path.parent).shared.sheet(height).sheet.parts
    (model,) = (one.positions for one in parts if len(one.positions) == each.shape[1])
    x, y, z = model.mean(axis=0)
    cos, sin = np.cos(stand.yaw), np.sin(stand.yaw)
    middle = np.stack([cos * x + sin * z, np.full(len(stand), y), cos * z - sin * x], axis=1)
    return np.asarray(each.mean(axis=1) - stand.scale[:, None] * middle)


def on_the_map(made: Pyramid, folder: Path) -> dict[int, np.ndarray]:
    """By level, (n, 2) metres east and north of the scene's origin, by row: by way of a globe's
    coordinates, as clients have them."""
    levels = range(made.tree.depth + 1)
    nodes = {file_of(node): node for level in levels for node in made.tree.nodes(level)}
    found = {level: np.full((COUNT, 2), np.nan) for level in levels}
    assert made.placed is not None and np.linalg.norm(made.placed[:3, 3]) > 6e6
    back = np.linalg.inv(made.placed)
    for name, matrix in contents(folder):
        node = nodes[name]
        x, y, z = plants_in(made, node, folder / name).T
        local = np.stack([x, -z, y, np.ones_like(x)])
        found[node.level][made.stand(node).row - 1] = (back @ (matrix @ local))[:2].T
    return found


def off(found: np.ndarray, wanted: np.ndarray) -> float:
    """The greatest error of one plant's place as seen from another's, metres."""
    away = found - wanted
    return float(np.ptp(away, axis=0).max())


@pytest.mark.parametrize(
    ("side_m", "options"),
    [
        (120.0, {"tile": 32.0, "near": 2}),
        (56.0, {"tile": 14.0, "near": 1}),
        (120.0, {"tile": 32.0, "near": 2, "plain": True}),
        (4000.0, {"tile": 1000.0, "near": 1, "plain": True}),
    ],
)  # fmt: skip
def test_plants_are_where_they_are_beside_each_other(
    tmp_path: Path, side_m: float, options: dict[str, Any]
) -> None:
    """On every level of tiles, on the earth."""
    wanted = forest(tmp_path, side_m)
    made = written(tmp_path, **options)
    assert made.placement.origin[:2] == pytest.approx((EASTING, NORTHING), abs=side_m)
    levels = on_the_map(made, tmp_path / "out")
    assert len(levels) == 3
    for level, found in levels.items():
        assert off(found, wanted - made.placement.origin[:2]) < MILLIMETRE, f"level {level}"
