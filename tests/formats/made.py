"""What the tests of the readers share: the smallest glTF files, images and OBJ texts."""

from __future__ import annotations

import io
import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
QUAD_UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
QUAD_FACES = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint16)


class Gltf:
    """A glTF file in the making: add arrays, then meshes and nodes, then write it."""

    def __init__(self) -> None:
        self.binary = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, data: bytes, **more: Any) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **more}
        )
        self.binary += data
        return len(self.json["bufferViews"]) - 1

    def array(self, values: np.ndarray, **more: Any) -> int:
        width = 1 if values.ndim == 1 else int(np.prod(values.shape[1:]))
        self.json["accessors"].append(
            {
                "bufferView": self.view(np.ascontiguousarray(values).tobytes()),
                "componentType": COMPONENTS[values.dtype.str[1:]],
                "count": len(values),
                "type": TYPES[width],
                **more,
            }
        )
        return len(self.json["accessors"]) - 1

    def image(self, data: bytes, mime: str = "image/png") -> int:
        """A texture whose image lies in the buffer."""
        self.json.setdefault("images", []).append({"bufferView": self.view(data), "mimeType": mime})
        self.json.setdefault("textures", []).append({"source": len(self.json["images"]) - 1})
        return len(self.json["textures"]) - 1

    def material(self, **entry: Any) -> int:
        self.json.setdefault("materials", []).append(entry)
        return len(self.json["materials"]) - 1

    def mesh(
        self,
        positions: np.ndarray = QUAD,
        indices: np.ndarray | None = QUAD_FACES,
        material: int | None = None,
        mode: int | None = None,
        name: str = "",
        **attributes: np.ndarray,
    ) -> int:
        primitive: dict[str, Any] = {
            "attributes": {
                "POSITION": self.array(positions),
                **{key: self.array(values) for key, values in attributes.items()},
            }
        }
        if indices is not None:
            primitive["indices"] = self.array(indices)
        if material is not None:
            primitive["material"] = material
        if mode is not None:
            primitive["mode"] = mode
        self.json["meshes"].append({"primitives": [primitive], "name": name})
        return len(self.json["meshes"]) - 1

    def node(self, parent: int | None = None, **entry: Any) -> int:
        self.json["nodes"].append(entry)
        index = len(self.json["nodes"]) - 1
        if parent is None:
            self.json["scenes"][0]["nodes"].append(index)
        else:
            self.json["nodes"][parent].setdefault("children", []).append(index)
        return index

    def bytes(self) -> bytes:
        tree = {"buffers": [{"byteLength": len(self.binary)}], **self.json}
        text = json.dumps(tree).encode()
        return glb(text, self.binary)

    def write(self, path: Path) -> Path:
        path.write_bytes(self.bytes())
        return path


def glb(text: bytes, binary: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def quad_file(path: Path, **mesh: Any) -> Path:
    """One quad, as a .glb."""
    made = Gltf()
    made.node(mesh=made.mesh(**mesh))
    return made.write(path)


def png(pixels: np.ndarray, palette: bool = False) -> bytes:
    """(h, w, 3 or 4) uint8 as PNG; as a palette with a transparent colour where asked."""
    image = Image.fromarray(pixels)
    stream = io.BytesIO()
    if palette:
        indexed = Image.fromarray((pixels[..., 3] > 127).astype(np.uint8), mode=None).convert("P")
        indexed.putpalette([0, 0, 0, 40, 160, 30])
        indexed.save(stream, "PNG", transparency=0)
    else:
        image.save(stream, "PNG")
    return stream.getvalue()


def leaf_pixels(size: int = 8) -> np.ndarray:
    """A green square whose left half is transparent."""
    pixels = np.zeros((size, size, 4), dtype=np.uint8)
    pixels[:] = (40, 160, 30, 255)
    pixels[:, : size // 2, 3] = 0
    return pixels


def png_header(width: int, height: int) -> bytes:
    """A PNG that announces a size and holds next to nothing."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    body = chunk(b"IDAT", zlib.compress(b"\0" * 100))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + body + chunk(b"IEND", b"")


def tube(start: np.ndarray, end: np.ndarray, radius: float, sides: int = 6) -> np.ndarray:
    """(2 * sides, 3) points of a prism, its first ring at `start`."""
    axis = (end - start) / np.linalg.norm(end - start)
    across = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.9 else [0, 1.0, 0])
    across /= np.linalg.norm(across)
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), np.cross(axis, across))
    return np.concatenate([start + radius * ring, end + 0.7 * radius * ring]).astype(np.float32)


def tube_faces(sides: int = 6) -> np.ndarray:
    """Indices of the sides of `tube`."""
    k = np.arange(sides)
    n = (k + 1) % sides
    return np.stack([k, n, k + sides, n, n + sides, k + sides], 1).ravel().astype(np.uint16)
