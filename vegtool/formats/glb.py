"""The GLB container: glTF 2.0 objects and one binary chunk, put together and serialised.

Source: glTF 2.0 specification, sections 3.6 (binary data storage) and 4 (GLB file format).
What goes into a document is gltf.py's business; this file knows indices, alignment and bytes.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

import vegtool

ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963

COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
ELEMENT_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_ALIGNMENT = 4  # bytes: enough for every component type, and what the chunks ask for


class Document:
    """A glTF document that grows object by object; every `add` returns the object's index."""

    def __init__(self) -> None:
        self._objects: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"vegtool {vegtool.__version__}"}
        }
        self._parts: list[bytes] = []
        self._length = 0
        self._files: list[dict[str, Any]] = []

    def add(self, kind: str, **properties: Any) -> int:
        """Append an object to the array `kind` ("nodes", "meshes", ...); return its index."""
        objects = self._objects.setdefault(kind, [])
        objects.append(properties)
        return len(objects) - 1

    def change(self, kind: str, index: int, **properties: Any) -> None:
        """Give an object that was added before more properties."""
        self._objects[kind][index].update(properties)

    def add_view(
        self,
        data: bytes,
        target: int | None = None,
        stride: int | None = None,
        alignment: int = _ALIGNMENT,
    ) -> int:
        """Append bytes as a buffer view that starts at a multiple of so many; return its index."""
        padding = -self._length % alignment
        offset = self._length + padding
        self._parts += [bytes(padding), data]
        self._length = offset + len(data)
        view = {"buffer": 0, "byteOffset": offset, "byteLength": len(data)}
        more = {"target": target, "byteStride": stride}
        return self.add("bufferViews", **view, **{k: v for k, v in more.items() if v is not None})

    def add_accessor(
        self,
        array: npt.NDArray[Any],
        target: int | None = ARRAY_BUFFER,
        bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Append an array (n,) or (n, 2..4) of one of COMPONENT_TYPES; return its index.

        `bounds` writes min and max, exactly as stored. Rows of vertices that are no multiples of
        four bytes are filled up to them. target: None for what is neither vertices nor indices.
        """
        little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        width = 1 if little.ndim == 1 else little.shape[1]
        stored, stride = little, None
        if target == ARRAY_BUFFER and (size := width * little.itemsize) % _ALIGNMENT:
            stride = size + -size % _ALIGNMENT
            stored = np.zeros((len(little), stride // little.itemsize), little.dtype)
            stored[:, :width] = little.reshape(-1, width)
        accessor: dict[str, Any] = {
            "bufferView": self.add_view(stored.tobytes(), target, stride),
            "componentType": COMPONENT_TYPES[little.dtype.str[1:]],
            "count": len(little),
            "type": ELEMENT_TYPES[width],
        }
        if normalized:
            accessor["normalized"] = True
        if bounds:
            rows = little.reshape(-1, width)
            accessor["min"] = rows.min(axis=0).tolist()
            accessor["max"] = rows.max(axis=0).tolist()
        return self.add("accessors", **accessor)

    def extend(self, name: str, value: Any) -> None:
        """Give the document itself an extension."""
        self._objects.setdefault("extensions", {})[name] = value

    def use_extension(self, name: str, required: bool = False) -> None:
        """List an extension as used, or as required too."""
        for kind in ("extensionsUsed", *(["extensionsRequired"] if required else [])):
            names = self._objects.setdefault(kind, [])
            if name not in names:
                names.append(name)

    def add_file(self, uri: str, length: int) -> int:
        """Append a buffer that is a file of its own, beside this one; return its index."""
        self._files.append({"uri": uri, "byteLength": length})
        return len(self._files)

    @property
    def objects(self) -> dict[str, Any]:
        """What was added, by kind."""
        return self._objects

    @property
    def binary(self) -> bytes:
        """What buffer views lie in."""
        binary = b"".join(self._parts)
        return binary + bytes(-len(binary) % _ALIGNMENT)

    def show(self, *nodes: int) -> None:
        """Make a scene of these root nodes the one that clients open with."""
        self._objects["scene"] = self.add("scenes", nodes=list(nodes))

    def glb(self) -> bytes:
        """The document as the bytes of a .glb file: the same objects give the same bytes."""
        binary = self.binary
        objects = {**self._objects, "buffers": [{"byteLength": len(binary)}, *self._files]}
        text = json.dumps(objects, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        chunk = text.encode(errors="replace")  # half a surrogate pair, from a file or its name
        chunk += b" " * (-len(chunk) % _ALIGNMENT)
        total = 12 + 8 + len(chunk) + 8 + len(binary)
        return b"".join(
            [
                struct.pack("<4sII", b"glTF", 2, total),
                struct.pack("<I4s", len(chunk), b"JSON"),
                chunk,
                struct.pack("<I4s", len(binary), b"BIN\0"),
                binary,
            ]
        )
