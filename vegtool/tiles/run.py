"""Tiles written to a folder: what they share, then all tiles, the smallest first, then the tileset.

Each file is whole or absent. Tiles of one height do not depend on each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.formats import read_plant
from vegtool.formats.atomic import explained
from vegtool.formats.tileset import TileEntry, tileset_json
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.tiles.make import Tile, make_tile
from vegtool.tiles.pyramid import Pyramid
from vegtool.tiles.quadtree import Node
from vegtool.tiles.shared import FOLDER, shared_of

TILES, TILESET = "tiles", "tileset.json"


def file_of(node: Node) -> str:
    """Of a tile, relative to the output folder."""
    return f"{TILES}/{node.level}_{node.column}_{node.row}.glb"


def write_tiles(pyramid: Pyramid, folder: Path, progress: Progress = silent) -> Iterator[Tile]:
    """Make and write all tiles and what they share, then the tileset; yields each tile.

    Raises OutputError where nothing can be written.
    """
    tree = pyramid.tree
    progress("models", 0.0)
    shared = shared_of(pyramid, range(tree.depth + 1))
    for name, data in shared.files.items():
        _write(folder / TILES / FOLDER / name, data)
    levels = [tree.nodes(level) for level in range(tree.depth, -1, -1)]
    plants: dict[Node, int] = {}
    boxes: dict[Node, FloatArray] = {}
    total, done = sum(map(len, levels)), 0

    def quarter(node: Node) -> Plant | None:
        return read_plant(folder / file_of(node)) if node in plants else None

    for nodes in levels:
        for node in nodes:
            progress(f"tile {node}", done / total)
            done += 1
            tile = make_tile(pyramid, node, shared, quarter)
            if tile is not None:
                _write(folder / file_of(node), tile.data)
                plants[node] = tile.plants
                boxes[node] = _box(pyramid, tile, boxes)
                yield tile
    root = levels[-1][0]
    if root not in plants:
        raise UsageError(
            "tiles: expected plants, found none that stands on the ground of the scene. Check "
            "[placement], and where [[species]] may grow"
        )
    _write(folder / TILESET, tileset_json(_entry(pyramid, root, plants, boxes), None))
    progress("tiles", 1.0)


def _box(pyramid: Pyramid, tile: Tile, boxes: dict[Node, FloatArray]) -> FloatArray:
    """(2, 3) metres: of a tile's plants, of what is drawn of it, and of the tiles below."""
    below = [boxes[one] for one in pyramid.tree.below.get(tile.node, ()) if one in boxes]
    own = [] if tile.bounds is None else [tile.bounds]
    all_of_them = np.stack([pyramid.bounds(tile.node), *own, *below])
    return np.stack([all_of_them[:, 0].min(axis=0), all_of_them[:, 1].max(axis=0)])


def _entry(
    pyramid: Pyramid, node: Node, plants: dict[Node, int], boxes: dict[Node, FloatArray]
) -> TileEntry:
    tiles, which = pyramid.placement.tiles, pyramid.tree.tiles_of(node)
    feet = float(tiles.low[which, 1].min()), float(tiles.high[which, 1].max())
    below = [one for one in pyramid.tree.below.get(node, ()) if one in plants]
    return TileEntry(
        file_of(node),
        pyramid.origin(node),
        boxes[node],
        pyramid.error_m(pyramid.tree.height(node.level)),
        plants[node],
        feet,
        tuple(_entry(pyramid, one, plants, boxes) for one in below),
    )


def _write(path: Path, data: bytes) -> None:
    """A file, whole or not at all."""
    with explained(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".{path.name}.part")
        part.write_bytes(data)
        part.replace(path)
