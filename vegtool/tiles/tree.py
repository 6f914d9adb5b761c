"""What clients begin with: a tileset.json, or the index of plain files, over the tiles there are.

A square that could not be made has no content: clients then draw its quarters, from however far. A
square of which a quarter is missing has none: clients stay with it rather than show a hole.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

import vegtool
from vegtool.arrays import FloatArray
from vegtool.formats.tileset import TileEntry
from vegtool.tiles.jobs import file_of
from vegtool.tiles.journal import Entry
from vegtool.tiles.pyramid import Pyramid
from vegtool.tiles.quadtree import Node

ABOVE = 1.001
"""Of its quarters' errors, how much greater a square's is at least: where they are the same, some
clients take the quarter for one that is never to be drawn, and go on to its own."""


def tree_of(pyramid: Pyramid, found: Mapping[str, Entry]) -> TileEntry | None:
    """The tiles that were made, from the root on; None where there are no plants on any."""
    return _entry(pyramid, Node(0, 0, 0), found)


def _entry(pyramid: Pyramid, node: Node, found: Mapping[str, Entry]) -> TileEntry | None:
    tree, own = pyramid.tree, found.get(str(node))
    if own is not None and not own.facts["plants"]:
        return None  # no plants turned out to stand there
    quarters = tree.quarters(node)
    below = [one for one in (_entry(pyramid, q, found) for q in quarters) if one is not None]
    whole = all(_complete(found, pyramid, quarter) for quarter in quarters)
    if own is None and not below:
        return None
    children = tuple(below) if own is None or whole else ()
    bounds = [pyramid.bounds(node), *(child.bounds for child in below)]
    if own is not None and own.facts["bounds"] is not None:
        bounds.append(np.array(own.facts["bounds"]) + pyramid.origin(node))
    tiles, which = pyramid.placement.tiles, tree.tiles_of(node)
    measured = 0.0 if own is None else own.facts["error_m"] or 0.0
    return TileEntry(
        None if own is None else file_of(node),
        pyramid.origin(node),
        np.stack([np.min([b[0] for b in bounds], axis=0), np.max([b[1] for b in bounds], axis=0)]),
        max(
            pyramid.error_m(tree.height(node.level)),
            measured,
            *(ABOVE * c.error_m for c in below),
            0.0,
        ),
        sum(c.plants for c in below) if own is None else own.facts["plants"],
        (float(tiles.low[which, 1].min()), float(tiles.high[which, 1].max())),
        children,
        0 if own is None else own.facts.get("surfels", 0),
    )


def _complete(found: Mapping[str, Entry], pyramid: Pyramid, node: Node) -> bool:
    """Whether a square can be drawn: it, or all of its quarters."""
    if str(node) in found:
        return True
    quarters = pyramid.tree.quarters(node)
    return bool(quarters) and all(_complete(found, pyramid, one) for one in quarters)


def index_json(
    pyramid: Pyramid,
    root: TileEntry,
    placed: FloatArray | None,
    scene: Mapping[str, Any] | None = None,
) -> bytes:
    """A list of the tiles, each after the square that it is on, for readers of their own; and what
    of a scene it is made for, if of any.

    Metres in the scene's frame, y up, but for `earth_from_scene`, whose columns take the scene's
    frame turned z up to the earth's.
    """
    tiles: list[dict[str, object]] = []

    def add(tile: TileEntry, above: int | None) -> None:
        number = len(tiles)
        tiles.append(
            {
                "file": tile.uri,
                "in": above,
                "origin_m": tile.origin.tolist(),
                "bounds_m": tile.bounds.tolist(),
                "error_m": tile.error_m,
                "from_m": tile.error_m / pyramid.error_m(1) * pyramid.from_m(1),
                "plants": tile.plants,
            }
        )
        for child in tile.children:
            add(child, number)

    add(root, None)
    values: dict[str, Any] = {
        "generator": f"vegtool {vegtool.__version__}",
        "earth_from_scene": None if placed is None else placed.T.ravel().tolist(),
        "tiles": tiles,
    }
    if scene is not None:
        values["scene"] = dict(scene)
    return (json.dumps(values, allow_nan=False, separators=(",", ":")) + "\n").encode()
