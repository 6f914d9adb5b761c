"""A folder of tiles as a client reads it: the tree of tileset.json, and what each tile draws.

A tile of a large tileset may refer to another file, whose root it then is (OGC 22-025r4, 3D Tiles
1.1, external tilesets). All files are read at once, which takes seconds for half a million tiles.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.errors import InputError
from vegtool.formats import read_plant
from vegtool.formats.beside import find_beside
from vegtool.formats.gltf_data import GltfFile, open_gltf
from vegtool.formats.gltf_tile import INSTANCING
from vegtool.formats.tileset import CLIENT_PX
from vegtool.plant import Plant
from vegtool.preview.made_for import MadeFor, made_for

LongArray = npt.NDArray[np.int64]

UNTURNED = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""Three columns of the transform of a tile that is only moved."""
BROKEN = (
    ValueError, KeyError, TypeError, IndexError, AttributeError, AssertionError, OverflowError,
    RecursionError,
)  # fmt: skip
"""What comes of files that are not as they should be."""


@dataclass(frozen=True, eq=False)
class Tileset:
    """t tiles, parents before their children, in the scene's frame (y up), wherever that is on the
    earth.

    file: path of each; None of a tile without content, in whose place its children are drawn.
    origin: (t, 3) metres. low, high: (t, 3) metres, of their boxes. error_m: (t,). children: (t, 2)
    int64, the first of each, and the one after the last. plants: (t,) int64, that stand on each.
    feet_m: (t, 2), the lowest and highest of their feet. depth: (t,) int64, of each below the root.
    surfels: (t,) int64, that each is drawn as, 0 of others. seen_px: pixels that errors are to be
    seen as. made_for: whose tiles alone there are, or None.
    """

    file: tuple[str | None, ...]  # half a million paths would take seconds
    origin: FloatArray
    low: FloatArray
    high: FloatArray
    error_m: FloatArray
    children: LongArray
    plants: LongArray
    feet_m: FloatArray
    depth: LongArray
    surfels: LongArray
    seen_px: float = CLIENT_PX
    made_for: MadeFor | None = None

    @cached_property
    def shown(self) -> np.ndarray:
        """(t,) bool: whether a tile has content."""
        return np.array([file is not None for file in self.file])

    @cached_property
    def deepest(self) -> int:
        """Depth of the finest tiles."""
        return int(self.depth.max())

    def below(self, tiles: LongArray) -> LongArray:
        """(n,) the children of tiles (m,), in their order."""
        first, end = self.children[tiles].T
        count = end - first
        start = np.cumsum(count) - count
        return np.asarray(np.repeat(first - start, count) + np.arange(count.sum()))


@dataclass(frozen=True, eq=False)
class Copies:
    """A plant that a tile draws n times. file: where it was read. place: (n, 3) metres from the
    tile's origin. yaw: (n,) radians. scale: (n,). tint: (n, 3)."""

    file: Path
    plant: Plant
    place: FloatArray
    yaw: FloatArray
    scale: FloatArray
    tint: FloatArray


def read_tileset(file: Path) -> Tileset:
    """The tree of a tileset.json as vegtool writes it, with the files that it refers to.

    Raises InputError for what is missing or broken, and for what others wrote in other ways.
    """
    parts: list[_Part] = []
    outside = [_Outside(file, None, 0, (0.0, 0.0, 0.0), 0)]
    met: set[Path] = set()
    count = 1
    for one in outside:  # which grows; a file's tiles are let go before the next is read
        part = _part(one, count)
        if one.file.resolve() in met:
            raise InputError(
                f"{one.by}: expected a tileset that no other refers to, and not itself, "
                f"found {one.file}. Make the tiles again"
            )
        met.add(one.file.resolve())
        outside += part.outside
        parts.append(part)
        count = max(count, part.end)
    tiles = _joined(parts)
    missing = _missing(tiles)
    if missing:
        raise InputError(
            f"{file}: expected the tile {missing[0]}, found none, of {len(missing):,} that are "
            "missing. Make the tiles again"
        )
    return tiles


Point = tuple[float, float, float]


@dataclass(frozen=True)
class _Outside:
    """A file whose root is a tile of another. by: which refers to it; None for the first. number:
    of that tile. origin: metres. depth: below the root of all."""

    file: Path
    by: Path | None
    number: int
    origin: Point
    depth: int


@dataclass(frozen=True, eq=False)
class _Part:
    """The n tiles of one file. number: (n,) int64 among all. end: the number after those that they
    and their children have. feet_m, seen_px, made_for: as told. Others as of Tileset."""

    number: LongArray
    file: list[str | None]
    origin: FloatArray
    low: FloatArray
    high: FloatArray
    error_m: FloatArray
    children: LongArray
    plants: LongArray
    feet_m: FloatArray
    depth: LongArray
    surfels: LongArray
    outside: list[_Outside]
    end: int
    seen_px: float
    made_for: MadeFor | None


def _part(at: _Outside, free: int) -> _Part:
    """A file's tiles. free: the first number that no tile has yet."""
    try:
        return _tiles_of(at, json.loads(at.file.read_bytes())["root"], free)
    except FileNotFoundError as error:
        if at.by is None:
            raise InputError(f"{at.file}: cannot be read ({error.strerror})") from error
        raise InputError(
            f"{at.by}: expected the tileset {at.file}, found none. Make the tiles again"
        ) from error
    except OSError as error:
        raise InputError(f"{at.file}: cannot be read ({error.strerror})") from error
    except BROKEN as error:
        raise InputError(
            f"{at.file}: expected a tileset as vegtool tiles writes it, with a box and extras in "
            f"every tile, and a content or children ({error!r}). Those of others are for their own "
            "viewers; one of vegtool's can be made again"
        ) from error


def _tiles_of(at: _Outside, root: dict[str, Any], free: int) -> _Part:
    folder, origin = at.file.parent, at.origin
    if at.by is None:  # where it is on the earth changes nothing of what is seen
        x, y, z = _numbers([root["extras"]["origin_m"]], 3)[0].tolist()
        origin = (x, y, z)
    outside: list[_Outside] = []
    rows: list[tuple[int, int, int, int]] = []
    shown: list[tuple[dict[str, Any], str | None, Point]] = []
    found = [(root, at.number, origin, at.depth)]
    for tile, number, origin, depth in found:  # which grows
        content, below = tile.get("content"), tile.get("children", [])
        file = None if content is None else f"{folder}/{content['uri']}"
        if file is not None and file.endswith(".json"):
            if below:
                raise ValueError("a tile that refers to a tileset, and has children")
            outside.append(_Outside(Path(file), at.file, number, origin, depth))
            continue
        if file is None and not below:
            raise ValueError("a tile with neither content nor children")
        rows.append((number, depth, free, free + len(below)))
        shown.append((tile, file, origin))
        for child in below:
            found.append((child, free, _moved(origin, child["transform"]), depth + 1))
            free += 1
    seen_px = float(root["extras"].get("seen_px", CLIENT_PX))
    if not 0 < seen_px < float("inf"):
        raise ValueError(f"errors to be seen as {seen_px:g} pixels")
    scene = root["extras"].get("scene")
    boxes = _numbers([tile["boundingVolume"]["box"] for tile, _, _ in shown], 12)
    origins = _numbers([origin for _, _, origin in shown], 3)
    center = origins + boxes[:, [0, 2, 1]] * [1, 1, -1]
    half = np.abs(boxes[:, 3:].reshape(-1, 3, 3)).sum(axis=1)[:, [0, 2, 1]]
    numbers = np.array(rows, np.int64).reshape(-1, 4)
    return _Part(
        numbers[:, 0],
        [file for _, file, _ in shown],
        origins,
        center - half,
        center + half,
        _numbers([[tile["geometricError"]] for tile, _, _ in shown], 1)[:, 0],
        numbers[:, 2:],
        np.array([tile["extras"]["plants"] for tile, _, _ in shown], np.int64),
        _numbers([tile["extras"]["feet_m"] for tile, _, _ in shown], 2),
        numbers[:, 1],
        np.array([tile["extras"].get("surfels", 0) for tile, _, _ in shown], np.int64),
        outside,
        free,
        seen_px,
        None if scene is None else made_for(scene),
    )


def _moved(origin: Point, transform: list[float]) -> Point:
    """The origin of a tile, of which others than the root are moved alone."""
    if transform[:12] != UNTURNED:
        raise ValueError("a tile that is turned or scaled")
    x, y, z, _ = transform[12:]
    return origin[0] + x, origin[1] + z, origin[2] - y


def _numbers(values: Sequence[Any], width: int) -> FloatArray:
    """(n, width) float64, finite."""
    found = np.array(values, np.float64).reshape(len(values), -1 if values else width)
    if found.shape[1] != width:
        raise ValueError(f"{found.shape[1]} numbers in place of {width}")
    if not np.isfinite(found).all():
        raise ValueError("numbers that are none")
    return found


def _joined(parts: Sequence[_Part]) -> Tileset:
    """All tiles, by their numbers."""
    order = np.argsort(np.concatenate([part.number for part in parts]))

    def joined(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in parts])[order]

    files = [file for part in parts for file in part.file]
    return Tileset(
        tuple(files[index] for index in order),
        joined("origin"),
        joined("low"),
        joined("high"),
        joined("error_m"),
        joined("children"),
        joined("plants"),
        joined("feet_m"),
        joined("depth"),
        joined("surfels"),
        parts[0].seen_px,
        parts[0].made_for,
    )


def _missing(tiles: Tileset) -> list[Path]:
    """The files that are not there. Folders are listed: of many files that is quicker."""
    names: dict[str, set[str]] = {}
    missing = []
    for file in tiles.file:
        if file is not None:
            folder, _, name = file.rpartition("/")
            if folder not in names:
                names[folder] = _files_in(folder)
            if name not in names[folder]:
                missing.append(Path(file))
    return missing


def _files_in(folder: str) -> set[str]:
    try:
        with os.scandir(folder) as found:
            return {one.name for one in found if one.is_file()}
    except (OSError, ValueError):  # a name with a NUL is none
        return set()


def read_tile(path: Path, model: Callable[[Path], Plant]) -> list[Copies]:
    """What a tile draws. model: reads a model that tiles share.

    Raises InputError for what is missing or broken.
    """
    try:
        return _read(path, model)
    except OSError as error:
        raise InputError(
            f"{error.filename or path}: cannot be read ({error.strerror}). Make the tiles again"
        ) from error
    except BROKEN as error:
        raise InputError(
            f"{path}: expected a tile as vegtool tiles writes it ({error!r}). Make it again"
        ) from error


def read_model(path: Path) -> Plant:
    """A plant with all of its pictures. Raises InputError where one is missing."""
    for image in open_gltf(path).json.get("images", []):
        uri = image.get("uri")
        if uri is not None and find_beside(path, uri, percent_encoded=True) is None:
            raise InputError(
                f"{path}: expected the picture {uri} beside it, found none. Make the tiles again"
            )
    return read_plant(path)


def _read(path: Path, model: Callable[[Path], Plant]) -> list[Copies]:
    file = open_gltf(path)
    nodes = [n for n in file.json.get("nodes", []) if INSTANCING in n.get("extensions", {})]
    if not nodes:
        plant = read_model(path)
        materials = tuple(replace(one, role="leaf") for one in plant.materials)
        one = np.zeros((1, 3)), np.zeros(1), np.ones(1), np.ones((1, 3))
        return [Copies(path, replace(plant, materials=materials), *one)]
    return [_copies(file, node, model) for node in nodes]


def _copies(file: GltfFile, node: dict[str, Any], model: Callable[[Path], Plant]) -> Copies:
    """Of a node with instances: its mesh lies in a buffer beside which the model is by itself."""
    mesh = file.entry("meshes", node.get("mesh"))
    view = file.entry("accessors", mesh["primitives"][0].get("indices")).get("bufferView")
    buffer = file.entry("buffers", file.entry("bufferViews", view).get("buffer"))
    path = (file.path.parent / str(buffer.get("uri"))).with_suffix(".gltf")
    indices = node["extensions"][INSTANCING]["attributes"]
    arrays = {name: file.accessor(at).astype(np.float64) for name, at in indices.items()}
    turn = arrays["ROTATION"]
    return Copies(
        path,
        model(path),
        arrays["TRANSLATION"],
        2 * np.arctan2(turn[:, 1], turn[:, 3]),
        arrays["SCALE"][:, 0],
        arrays["_COLOR_0"],
    )
