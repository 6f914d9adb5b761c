"""tileset.json of 3D Tiles 1.1: an explicit quadtree in which squares replace their quarters.

Source: OGC 22-025r4, 3D Tiles 1.1. Tiles are z-up, glTF is y-up: what is (x, y, z) in a tile's file
is (x, -z, y) here. Every tile has its own origin, a translation from its parent's, in double
precision; numbers in files stay small.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import numpy as np

import vegtool
from vegtool.arrays import FloatArray

MOST = 2000
"""Tiles that one file lists; of more, clients would wait for what they do not look at."""
APART = 5
"""Levels of tiles in one of several files: 341 tiles."""
TILESET = "tileset.json"
CLIENT_PX = 16.0
"""Pixels that a tile's error may be seen as before clients go on to its children, unless they are
told otherwise."""
BLENDED = 0.2
"""Of the distance at which a tile of surfels gives way to its quarters: along so much of it before,
both are drawn. In the nearer half of it, all surfels of the quarters are, in the other all of the
tile's own, so that there are no holes."""


@dataclass(frozen=True, eq=False)
class TileEntry:
    """uri: of its file, or None of a tile without content. origin: (3,) metres in the scene's
    frame, y up. bounds: (2, 3) metres there, least and greatest corner, which hold the children's.
    error_m: geometric error. plants: on it. feet_m: lowest and highest of where they stand.
    surfels: that it is drawn as, 0 where it is drawn as anything else."""

    uri: str | None
    origin: FloatArray
    bounds: FloatArray
    error_m: float
    plants: int = 0
    feet_m: tuple[float, float] = (0.0, 0.0)
    children: Sequence[TileEntry] = ()
    surfels: int = 0


def tileset_files(
    root: TileEntry,
    placed: FloatArray | None,
    seen_px: float = CLIENT_PX,
    gone_m: float | None = None,
    scene: Mapping[str, Any] | None = None,
) -> dict[str, bytes]:
    """TILESET and, where there are many tiles, others that it refers to, beside the tiles.

    placed: (4, 4) from the scene's frame, z up, to the earth's; None where it has no place there.
    Where the root is in the scene's frame, y up, is among its extras: origin_m. seen_px: pixels
    that errors are to be seen as; what clients have not unless told so is among them, too. gone_m:
    metres, the error of showing nothing; twice the root's if None. scene: plain values, what of a
    scene it is made for, which are among them where there are any.
    """
    base = np.eye(4) if placed is None else placed
    files: dict[str, bytes] = {}
    apart = APART if _count(root) > MOST else None
    top = _tile(root, "", apart, 0, files)
    top["extras"]["origin_m"] = root.origin.tolist()
    if seen_px != CLIENT_PX:
        top["extras"]["seen_px"] = seen_px
    if scene is not None:
        top["extras"]["scene"] = dict(scene)
    top["transform"] = _columns(base @ _translation(root.origin))
    files[TILESET] = _file(top, 2 * root.error_m if gone_m is None else gone_m)
    return files


def _count(tile: TileEntry) -> int:
    return 1 + sum(map(_count, tile.children))


def _file(top: dict[str, Any], gone_m: float) -> bytes:
    """gone_m: the tileset's own error. It is not drawn where it has none."""
    values = {
        "asset": {"version": "1.1", "generator": f"vegtool {vegtool.__version__}"},
        "geometricError": gone_m or 1.0,
        "root": {**top, "refine": "REPLACE"},
    }
    return (json.dumps(values, allow_nan=False, separators=(",", ":")) + "\n").encode()


def _tile(
    tile: TileEntry, folder: str, apart: int | None, depth: int, files: dict[str, bytes]
) -> dict[str, Any]:
    """A tile as a file in `folder` has it; its children, where those are `apart` levels below, in
    files of their own."""
    low, high = _turned(tile.bounds - tile.origin)
    low, high = np.minimum(low, high), np.maximum(low, high)
    half = np.diag((high - low) / 2)
    found: dict[str, Any] = {
        "boundingVolume": {"box": [*((low + high) / 2).tolist(), *half.ravel().tolist()]},
        "geometricError": tile.error_m,
        "extras": {"plants": tile.plants, "feet_m": [tile.feet_m[0], tile.feet_m[1]]},
    }
    if tile.surfels:
        found["extras"]["surfels"] = tile.surfels
    if tile.uri is not None:
        found["content"] = {"uri": tile.uri.removeprefix(folder)}
    children = []
    for child in tile.children:
        place = {"transform": _columns(_translation(child.origin - tile.origin))}
        if apart and child.uri and child.children and (depth + 1) % apart == 0:
            path = PurePosixPath(child.uri).with_suffix(".json")
            within = f"{path.parent}/"
            top = _tile(child, within, apart, depth + 1, files)
            files[str(path)] = _file(top, 2 * child.error_m)
            told = {key: top[key] for key in ("boundingVolume", "geometricError", "extras")}
            refers = {"content": {"uri": str(path).removeprefix(folder)}}
            children.append({**place, **told, **refers})
        else:
            children.append({**place, **_tile(child, folder, apart, depth + 1, files)})
    if children:
        found["children"] = children
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
