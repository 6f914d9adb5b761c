"""A folder of tiles as a client reads it: the tree of tileset.json, and what each tile draws."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import InputError
from vegtool.formats import read_plant
from vegtool.formats.beside import find_beside
from vegtool.formats.gltf_data import GltfFile, open_gltf
from vegtool.formats.gltf_tile import INSTANCING
from vegtool.plant import Plant

TILESET = "tileset.json"
TURNED = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""From a tile's axes, z up, to the scene's: rows times this."""
BROKEN = (
    ValueError, KeyError, TypeError, IndexError, AttributeError, AssertionError, OverflowError,
    RecursionError,
)  # fmt: skip
"""What comes of files that are not as they should be."""


@dataclass(frozen=True, eq=False)
class Tileset:
    """t tiles, parents before their children, in the scene's frame (y up); where the tileset has a
    place on the earth, in that of its root.

    file: of each. origin: (t, 3) metres. low, high: (t, 3) metres, of their boxes. error_m: (t,).
    children: of each. plants: (t,) int64, that stand on each. feet_m:
    (t, 2), the lowest and highest of their feet. depth: (t,) int64, of each below the root.
    """

    file: tuple[Path, ...]
    origin: FloatArray
    low: FloatArray
    high: FloatArray
    error_m: FloatArray
    children: tuple[tuple[int, ...], ...]
    plants: np.ndarray
    feet_m: FloatArray
    depth: np.ndarray


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


def tileset_at(path: Path) -> Path | None:
    """The tileset.json that a path is, or that lies in it; None for anything else."""
    file = path / TILESET if path.is_dir() else path
    return file if file.name == TILESET and file.exists() else None


def read_tileset(file: Path) -> Tileset:
    """The tree of a tileset.json as vegtool writes it.

    Raises InputError for what is missing or broken, and for what others wrote in other ways.
    """
    try:
        tiles = _tree(file.parent, json.loads(file.read_bytes())["root"])
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from error
    except BROKEN as error:
        raise InputError(
            f"{file}: expected a tileset as vegtool tiles writes it, with a box, a content and "
            f"extras in every tile ({error!r}). Those of others are for their own viewers; one of "
            "vegtool's can be made again"
        ) from error
    missing = [path for path in tiles.file if not path.is_file()]
    if missing:
        raise InputError(
            f"{file}: expected the tile {missing[0]}, found none, of {len(missing):,} that are "
            "missing. Make the tiles again"
        )
    return tiles


def _tree(folder: Path, root: dict[str, Any]) -> Tileset:
    placed = np.array(root.get("transform", np.eye(4).ravel()), np.float64).reshape(4, 4).T
    flat = np.array_equal(placed[:3, :3], np.eye(3))
    start = placed[:3, 3] @ TURNED if flat else np.zeros(3)
    found: list[tuple[dict[str, Any], FloatArray, int]] = [(root, start, 0)]
    children: list[tuple[int, ...]] = []
    for tile, origin, depth in found:  # which grows
        below = tile.get("children", [])
        children.append(tuple(range(len(found), len(found) + len(below))))
        for child in below:
            x, y, z = child["transform"][12:15]
            found.append((child, origin + np.array([x, y, z]) @ TURNED, depth + 1))
    boxes = np.array([tile["boundingVolume"]["box"] for tile, _, _ in found], np.float64)
    origins = np.array([origin for _, origin, _ in found])
    center = origins + boxes[:, [0, 2, 1]] * [1, 1, -1]
    half = np.abs(boxes[:, 3:].reshape(-1, 3, 3)).sum(axis=1)[:, [0, 2, 1]]
    feet = np.array([tile["extras"]["feet_m"] for tile, _, _ in found], np.float64).reshape(-1, 2)
    errors = np.array([tile["geometricError"] for tile, _, _ in found], np.float64)
    if not all(np.isfinite(values).all() for values in (boxes, origins, feet, errors)):
        raise ValueError("numbers that are none")
    return Tileset(
        tuple(folder / tile["content"]["uri"] for tile, _, _ in found),
        origins,
        center - half,
        center + half,
        errors,
        tuple(children),
        np.array([tile["extras"]["plants"] for tile, _, _ in found], np.int64),
        feet - (0.0 if flat else placed[2, 3]),
        np.array([depth for _, _, depth in found], np.int64),
    )


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
