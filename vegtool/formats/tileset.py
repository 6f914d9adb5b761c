"""tileset.json of 3D Tiles 1.1: an explicit quadtree in which squares replace their quarters.

Source: OGC 22-025r4, 3D Tiles 1.1. Tiles are z-up, glTF is y-up: what is (x, y, z) in a tile's file
is (x, -z, y) here. Every tile has its own origin, a translation from its parent's, in double
precision; numbers in files stay small.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import vegtool
from vegtool.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class TileEntry:
    """uri: of its file. origin: (3,) metres in the scene's frame, y up. bounds: (2, 3) metres
    there, least and greatest corner, which hold the children's. error_m: geometric error. plants:
    on it. feet_m: lowest and highest of where they stand."""

    uri: str
    origin: FloatArray
    bounds: FloatArray
    error_m: float
    plants: int = 0
    feet_m: tuple[float, float] = (0.0, 0.0)
    children: Sequence[TileEntry] = ()


def tileset_json(root: TileEntry, placed: FloatArray | None) -> bytes:
    """The file. placed: (4, 4) from the scene's frame, z up, to the earth's; None where it has no
    place there. The tileset's own error is twice the root's: it is not drawn where it has none."""
    base = np.eye(4) if placed is None else placed
    top = _tile(root)
    top["transform"] = _columns(base @ _translation(root.origin))
    top["refine"] = "REPLACE"
    values = {
        "asset": {"version": "1.1", "generator": f"vegtool {vegtool.__version__}"},
        "geometricError": 2 * root.error_m or 1.0,
        "root": top,
    }
    return (json.dumps(values, allow_nan=False, separators=(",", ":")) + "\n").encode()


def _tile(tile: TileEntry) -> dict[str, Any]:
    low, high = _turned(tile.bounds - tile.origin)
    low, high = np.minimum(low, high), np.maximum(low, high)
    half = np.diag((high - low) / 2)
    found: dict[str, Any] = {
        "boundingVolume": {"box": [*((low + high) / 2).tolist(), *half.ravel().tolist()]},
        "geometricError": tile.error_m,
        "content": {"uri": tile.uri},
        "extras": {"plants": tile.plants, "feet_m": [tile.feet_m[0], tile.feet_m[1]]},
    }
    if tile.children:
        found["children"] = [
            {"transform": _columns(_translation(child.origin - tile.origin))} | _tile(child)
            for child in tile.children
        ]
    return found


def _turned(points: FloatArray) -> FloatArray:
    """Points (n, 3), y up, in z-up axes."""
    x, y, z = points.T
    return np.stack([x, -z, y], axis=1)


def _translation(away: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, 3] = _turned(away[None])[0]
    return matrix


def _columns(matrix: FloatArray) -> list[float]:
    return [float(v) for v in matrix.T.ravel()]
