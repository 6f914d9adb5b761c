"""What the tests of the writers share: the smallest plant and level, and a reader of .glb files.

The reader is a second, independent reading of the glTF specification, so that a mistake in the
writer is not repeated by the code that checks it.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

from vegtool.lod import Atlas, Billboards, Display, Level, LodChain
from vegtool.plant import Material, Plant, Texture

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass
class Glb:
    """A parsed .glb: its JSON and its binary chunk."""

    json: dict[str, Any]
    binary: bytes

    def accessor(self, index: int) -> np.ndarray:
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        dtype, width = COMPONENTS[accessor["componentType"]], WIDTHS[accessor["type"]]
        size = accessor["count"] * width * np.dtype(dtype).itemsize
        assert view["byteLength"] == size
        start = view["byteOffset"]
        values = np.frombuffer(self.binary[start : start + size], dtype)
        return values if width == 1 else values.reshape(-1, width)

    def primitive(self, mesh: int = 0, index: int = 0) -> dict[str, np.ndarray]:
        """Attribute arrays by name, and "indices"."""
        primitive = self.json["meshes"][mesh]["primitives"][index]
        arrays = {name: self.accessor(i) for name, i in primitive["attributes"].items()}
        return {**arrays, "indices": self.accessor(primitive["indices"])}

    def material(self, mesh: int = 0, index: int = 0) -> dict[str, Any]:
        return self.json["materials"][self.json["meshes"][mesh]["primitives"][index]["material"]]

    def image_bytes(self, texture: int) -> bytes:
        image = self.json["images"][self.json["textures"][texture]["source"]]
        view = self.json["bufferViews"][image["bufferView"]]
        return self.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]

    def pixels(self, texture: int) -> np.ndarray:
        with Image.open(BytesIO(self.image_bytes(texture))) as image:
            return np.asarray(image)


def parse(data: bytes) -> Glb:
    """Parse a .glb; fails where lengths, padding or alignment break the specification."""
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    json_length, json_kind = struct.unpack_from("<I4s", data, 12)
    assert json_kind == b"JSON"
    assert json_length % 4 == 0
    text = data[20 : 20 + json_length]
    length, kind = struct.unpack_from("<I4s", data, 20 + json_length)
    assert kind == b"BIN\0"
    assert length % 4 == 0
    binary = data[28 + json_length :]
    assert len(binary) == length
    values = json.loads(text)
    assert values["buffers"] == [{"byteLength": length}]
    end = 0
    for view in values["bufferViews"]:
        assert view["byteOffset"] % 4 == 0
        assert view["byteOffset"] >= end
        end = view["byteOffset"] + view["byteLength"]
    assert length - 3 <= end <= length
    return Glb(values, binary)


def upright_square(z: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a unit square facing +z, counter-clockwise, and its texture coordinates."""
    corners = np.array([[0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z]], float)
    return corners, np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)


def flat_normals(size: int = 4) -> np.ndarray:
    return np.tile(np.array([128, 128, 255, 255], np.uint8), (size, size, 1))


def leafy_plant(**changes: Any) -> Plant:
    """Two squares: bark with a normal texture at z = 0, a cut-out leaf at z = 1."""
    rng = np.random.default_rng(1)
    (bark, uvs), (leaf, _) = upright_square(), upright_square(1.0)
    materials = (
        Material(
            "bark",
            base_color=np.array([0.5, 0.4, 0.3, 1.0]),
            normal_texture=Texture("bark_normal", flat_normals()),
            normal_scale=0.5,
            metallic=0.1,
            roughness=0.7,
        ),
        Material(
            "leaf",
            color_texture=Texture("leaf", rng.integers(0, 256, (8, 8, 4), dtype=np.uint8)),
            alpha_mode="mask",
            alpha_cutoff=0.3,
            double_sided=True,
            role="leaf",
        ),
    )
    values: dict[str, Any] = {
        "name": "two squares",
        "positions": np.concatenate([bark, leaf]),
        "normals": np.tile([0.0, 0.0, 1.0], (8, 1)),
        "uvs": np.concatenate([uvs, uvs]),
        "faces": np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]),
        "face_material": np.array([0, 0, 1, 1]),
        "materials": materials,
    }
    return Plant(**{**values, **changes})


def billboard_level(
    count: int = 3, near: float = 10.0, double_sided: bool = True, move: float = 0.0
) -> Level:
    """Billboards facing +z at random places, all showing one picture; their backs another."""
    rng = np.random.default_rng(count)
    front = np.tile(np.array([1, 1, 14, 14], np.int32), (count, 1))
    back = front if double_sided else front + np.array([16, 0, 0, 0], np.int32)
    size = (16, 32)
    return Level(
        "billboards",
        billboards=Billboards(
            center=rng.random((count, 3)) + move,
            u=np.tile([1.0, 0.0, 0.0], (count, 1)),
            v=np.tile([0.0, 1.0, 0.0], (count, 1)),
            half_size=np.full((count, 2), 0.25),
            half_depth=np.zeros(count),
            cluster=np.arange(count),
        ),
        atlas=Atlas(
            color=rng.integers(0, 256, (*size, 4), dtype=np.uint8),
            normal=np.tile(np.array([128, 128, 255], np.uint8), (*size, 1)),
            depth=rng.integers(1, 65536, size).astype(np.uint16),
            front=front,
            back=back,
        ),
        double_sided=double_sided,
        near_distance_m=near,
    )


BARK = np.array([0.1, 0.06, 0.02, 1.0])
"""Linear, and dark as bark is; as a tint, its channels would be too unlike for a colour."""


def wood() -> Plant:
    """A square at z = 0.5, half of it single-sided bark, the other half a paler double-sided
    ribbon; the corners that they share have one vertex each."""
    corners, _ = upright_square(0.5)
    shades = np.array([[0.5], [1.0], [0.7], [0.9]])
    return Plant(
        "wood",
        corners,
        np.tile([0.0, 0.0, 1.0], (4, 1)),
        np.zeros((4, 2)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.array([0, 1]),
        (Material("bark"), Material("ribbon", base_color=[0.5, 0.5, 0.5, 1], double_sided=True)),
        colors=shades * BARK,
    )


def hybrid_level(count: int = 3, near: float = 10.0, double_sided: bool = True) -> Level:
    """The same billboards, on an atlas with a white block, and the wood."""
    level = billboard_level(count, near, double_sided)
    atlas = level.atlas
    assert atlas is not None

    def below(image: np.ndarray, value: int) -> np.ndarray:
        return np.concatenate([image, np.full_like(image[:8], value)])

    atlas = replace(
        atlas,
        color=below(atlas.color, 255),
        normal=np.tile(np.array([128, 128, 255], np.uint8), (24, 32, 1)),
        depth=below(atlas.depth, 0),
        white=np.array([2, 18, 4, 4]),
    )
    return replace(level, kind="hybrid", mesh=wood(), atlas=atlas)


def small_chain(**changes: Any) -> LodChain:
    """The plant and two billboard levels, from 10 and 20 metres."""
    values: dict[str, Any] = {
        "name": "tree",
        "levels": (
            Level("mesh", mesh=leafy_plant()),
            billboard_level(3, 10.0),
            billboard_level(1, 20.0, double_sided=False),
        ),
        "display": Display(),
        "seed": 7,
        "options": {"method": "kmeans", "billboards": 3},
    }
    return LodChain(**{**values, **changes})
