"""Whether a tileset.json is what clients can use: containment, errors, files, cycles.

Source: OGC 22-025r4, 3D Tiles 1.1, sections 6.3 to 6.7. Of what the specification allows, only
boxes and explicit children are known here: what vegtool writes. Boxes of siblings may overlap, as
crowns over a border do: it asks that a tile's box holds those below it, and nothing of those beside
it. But no file is to be the content of two tiles, as its plants would stand there twice.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from vegtool.arrays import FloatArray

TOLERANCE_M = 1e-3
"""Metres that a child's corner may be outside of its parent's box, by rounding."""
CORNERS = np.array(np.meshgrid(*3 * [[-1.0, 1.0]])).reshape(3, -1).T
MAGIC = b"glTF"


@dataclass(frozen=True)
class Box:
    """A bounding box in its own tile's frame: center (3,) and half axes, the rows of (3, 3)."""

    center: FloatArray
    axes: FloatArray

    @property
    def corners(self) -> FloatArray:
        """(8, 3)."""
        return np.asarray(self.center + CORNERS @ self.axes)

    def outside_m(self, points: FloatArray) -> float:
        """Metres by which the farthest of points (n, 3) is outside."""
        length = np.linalg.norm(self.axes, axis=1)
        unit = self.axes / np.where(length > 0, length, 1)[:, None]
        away = np.abs((points - self.center) @ unit.T) - length
        return float(max(away.max(), 0.0))


def check_tileset(path: Path) -> list[str]:
    """Everything that is wrong with a tileset and those that it refers to, a sentence each; none
    where all is well."""
    return list(_check_file(path, (), {}))


def _check_file(path: Path, above: tuple[Path, ...], shown: dict[Path, str]) -> Iterator[str]:
    """above: the tilesets that refer to it. shown: by which tile each content is."""
    if path.resolve() in above:
        yield f"{path}: refers to itself, by way of {above[-1]}"
        return
    try:
        values = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        yield f"{path}: expected JSON; {error}"
        return
    if not isinstance(values, dict) or not isinstance(values.get("root"), dict):
        yield f"{path}: expected an object with a root tile"
        return
    version = _object(values, "asset").get("version")
    if version != "1.1":
        yield f"{path}: asset.version: expected 1.1; found {version!r}"
    if not _is_error(values.get("geometricError")):
        yield f"{path}: geometricError: expected a number of at least 0; found none"
    if values["root"].get("refine") not in ("REPLACE", "ADD"):
        yield f"{path}: root: refine: expected REPLACE or ADD; found {values['root'].get('refine')}"
    here = (*above, path.resolve())
    yield from _check_tile(path, values["root"], "root", None, None, here, shown)


def _is_error(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and 0 <= value < float("inf")


def _check_tile(
    path: Path,
    tile: dict[str, Any],
    name: str,
    parent: Box | None,
    parent_error: float | None,
    above: tuple[Path, ...],
    shown: dict[Path, str],
) -> Iterator[str]:
    where = f"{path}: {name}"
    box = _box(tile)
    if box is None:
        yield f"{where}: boundingVolume: expected a box of 12 numbers; found none"
    matrix = _matrix(tile)
    if matrix is None:
        yield f"{where}: transform: expected 16 numbers, the last 1; found another"
    if box is not None and parent is not None and matrix is not None:
        corners = box.corners @ matrix[:3, :3].T + matrix[:3, 3]
        outside = parent.outside_m(corners)
        if outside > TOLERANCE_M:
            yield f"{where}: its box is {outside:.3f} m outside of its parent's"
    error = tile.get("geometricError")
    if not _is_error(error):
        yield f"{where}: geometricError: expected a number of at least 0; found {error!r}"
        error = None
    elif parent_error is not None and float(error or 0) > parent_error:
        yield f"{where}: geometricError {error:g} is more than its parent's, {parent_error:g}"
    yield from _check_content(path, tile, where, above, shown)
    children = tile.get("children")
    if children == []:
        yield f"{where}: children: expected some, or none of the key; found an empty list"
    if children is not None and not isinstance(children, list):
        yield f"{where}: children: expected a list of tiles; found {children!r:.60}"
        children = None
    for index, child in enumerate(children or []):
        if not isinstance(child, dict):
            yield f"{where}: children: expected tiles; found {child!r:.60}"
            continue
        yield from _check_tile(path, child, f"{name}.{index}", box, error, above, shown)


def _check_content(
    path: Path, tile: dict[str, Any], where: str, above: tuple[Path, ...], shown: dict[Path, str]
) -> Iterator[str]:
    content = tile.get("content")
    if content is None:
        if not tile.get("children"):
            yield f"{where}: has neither content nor children"
        return
    uri = _object(tile, "content").get("uri")
    if not isinstance(uri, str):
        yield f"{where}: content: expected a uri; found none"
        return
    file = path.parent / unquote(uri)
    if not file.is_file():
        yield f"{where}: content: expected the file {file}, found none"
    elif file.suffix == ".json":
        if tile.get("children"):
            yield f"{where}: a tile that refers to a tileset has no children"
        yield from _check_file(file, above, shown)
    else:
        with file.open("rb") as opened:
            head = opened.read(12)
        size = int.from_bytes(head[8:12], "little")
        if head[:4] != MAGIC or size != file.stat().st_size:
            yield f"{where}: content: {file} is no whole .glb file"
        other = shown.setdefault(file.resolve(), where)
        if other != where:
            yield f"{where}: content: {file} is that of {other.removeprefix(f'{path}: ')} too"


def _box(tile: dict[str, Any]) -> Box | None:
    numbers = _numbers(_object(tile, "boundingVolume").get("box"), 12)
    return None if numbers is None else Box(numbers[:3], numbers[3:].reshape(3, 3))


def _matrix(tile: dict[str, Any]) -> FloatArray | None:
    values = tile.get("transform")
    if values is None:
        return np.eye(4)
    numbers = _numbers(values, 16)
    return None if numbers is None or numbers[15] != 1 else numbers.reshape(4, 4).T


def _object(values: dict[str, Any], key: str) -> dict[str, Any]:
    """What a key holds, if that is an object, else one without keys."""
    found = values.get(key)
    return found if isinstance(found, dict) else {}


def _numbers(values: Any, count: int) -> FloatArray | None:
    """(count,), or None for anything but so many finite numbers."""
    if not isinstance(values, list) or len(values) != count:
        return None
    if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        return None
    numbers = np.array(values, np.float64)
    return numbers if np.isfinite(numbers).all() else None
