"""The binary side of glTF 2.0: containers, buffers and accessors as numpy arrays.

Source: glTF 2.0 specification, sections 3.6 (binary data storage) and 4 (GLB). trimesh is not used
here: it ignores sparse and normalised accessors, node instancing, skins and texture transforms, and
fills in zeros where it cannot decode.

Every size in the file is checked against the bytes that are really there before memory is taken.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from vegtool.errors import CapabilityError, InputError
from vegtool.formats.beside import find_beside

COMPONENTS: dict[int, str] = {
    5120: "i1",
    5121: "u1",
    5122: "<i2",
    5123: "<u2",
    5125: "<u4",
    5126: "<f4",
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
ZEROS_PER_BYTE = 256
"""A sparse accessor may claim this many times the file's size in zeros."""


@dataclass(eq=False)
class GltfFile:
    """A glTF file: its JSON and access to its bytes. buffers: those read so far."""

    path: Path
    json: dict[str, Any]
    binary: bytes | None
    buffers: dict[int, bytes] = field(default_factory=dict)

    def entry(self, kind: str, index: object) -> dict[str, Any]:
        """An element of a top-level array; InputError where there is none."""
        array = self.json.get(kind, [])
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(array):
            raise self.broken(f"an entry of {kind} below {len(array)}", f"{index!r}")
        if not isinstance(array[index], dict):
            raise self.broken(f"{kind}[{index}] to be an object", repr(array[index])[:40])
        entry: dict[str, Any] = array[index]
        return entry

    def broken(self, expected: str, found: str) -> InputError:
        """The error for a file that contradicts itself."""
        return InputError(
            f"{self.path}: expected {expected}, found {found}; export or download the file again"
        )

    def view(self, index: int) -> memoryview:
        """The bytes of a buffer view."""
        entry = self.entry("bufferViews", index)
        extensions = entry.get("extensions", {})
        data = self._buffer(entry.get("buffer"), extensions)
        offset, length = entry.get("byteOffset", 0), entry.get("byteLength", 0)
        if not _is_count(offset) or not _is_count(length) or offset + length > len(data):
            raise self.broken(
                f"bufferViews[{index}] inside its buffer of {len(data)} bytes",
                f"bytes {offset} to {offset}+{length}",
            )
        return memoryview(data)[offset : offset + length]

    def accessor(self, index: object) -> np.ndarray:
        """(count, width) values of an accessor: normalised ones as float64, others as stored."""
        assert isinstance(index, int) or index is None
        entry = self.entry("accessors", index)
        component, kind, count = entry.get("componentType"), entry.get("type"), entry.get("count")
        if component not in COMPONENTS or kind not in WIDTHS or not _is_count(count):
            raise self.broken(
                f"accessors[{index}] to have a type, a component type and a count",
                f"{kind!r}, {component!r}, {count!r}",
            )
        dtype, width = np.dtype(COMPONENTS[component]), WIDTHS[kind]
        if "bufferView" in entry:
            values = self._strided(
                f"accessors[{index}]", entry, entry["bufferView"], dtype, width, count
            )
        else:
            size = count * width * dtype.itemsize
            if size > ZEROS_PER_BYTE * self.path.stat().st_size:
                raise self.broken(f"accessors[{index}] to fit the file's size", f"{size} bytes")
            values = np.zeros((count, width), dtype)
        if "sparse" in entry:
            values = self._with_sparse(f"accessors[{index}].sparse", entry["sparse"], values)
        if entry.get("normalized") and dtype.kind in "iu":
            return np.maximum(values / float(np.iinfo(dtype).max), -1.0)
        return values

    def _with_sparse(self, name: str, sparse: dict[str, Any], values: np.ndarray) -> np.ndarray:
        """Values with those of a sparse accessor put over them."""
        at, over, count = sparse.get("indices", {}), sparse.get("values", {}), sparse.get("count")
        kind = COMPONENTS.get(at.get("componentType", -1))
        if kind is None or not _is_count(count):
            raise self.broken(f"{name} to have indices and a count", repr(sparse)[:80])
        rows = self._strided(name, at, at.get("bufferView"), np.dtype(kind), 1, count)[:, 0]
        if count and int(rows.max()) >= len(values):
            raise self.broken(f"{name} indices below {len(values)}", str(int(rows.max())))
        values = values.copy()
        values[rows] = self._strided(
            name, over, over.get("bufferView"), values.dtype, values.shape[1], count
        )
        return values

    def _strided(
        self, name: str, entry: dict[str, Any], view: Any, dtype: np.dtype, width: int, count: int
    ) -> np.ndarray:
        """(count, width) array over the bytes of a view, not copied."""
        data = self.view(view)
        offset = entry.get("byteOffset", 0)
        element = width * dtype.itemsize
        stride = self.entry("bufferViews", view).get("byteStride", element)
        if not _is_count(offset) or not _is_count(stride) or stride < element:
            raise self.broken(f"{name} to have a sane offset and stride", f"{offset}, {stride}")
        if count and offset + (count - 1) * stride + element > len(data):
            raise self.broken(
                f"{name} ({count} elements) inside its buffer view of {len(data)} bytes",
                f"its end at byte {offset + (count - 1) * stride + element}",
            )
        if not count:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def _buffer(self, index: object, extensions: dict[str, Any]) -> bytes:
        for name in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
            if name in extensions:
                raise meshopt_missing(self.path, name)
        entry = self.entry("buffers", index)
        assert isinstance(index, int)
        if index not in self.buffers:
            uri = entry.get("uri")
            if uri is None and (index != 0 or self.binary is None):
                raise self.broken(f"data for buffers[{index}]", "neither a uri nor a binary chunk")
            data = self.binary if uri is None else self.resource(uri, f"buffers[{index}]")
            if data is None:
                raise InputError(
                    f"{self.path}: expected the buffer {uri!r} beside it, found no such file; copy "
                    "it there"
                )
            self.buffers[index] = data
        return self.buffers[index]

    def resource(self, uri: Any, what: str) -> bytes | None:
        """The bytes behind a URI: a data URI, or a file beside the model; None if missing."""
        if not isinstance(uri, str):
            raise self.broken(f"{what} to have a uri", repr(uri)[:40])
        if uri.startswith("data:"):
            head, comma, body = uri.partition(",")
            try:
                if not comma or not head.endswith(";base64"):
                    raise ValueError("not base64")
                return base64.b64decode(body, validate=True)
            except (ValueError, binascii.Error) as error:
                raise self.broken(f"{what} to be a base64 data URI", str(error)) from None
        found = find_beside(self.path, uri, percent_encoded=True)
        return found.read_bytes() if found else None


def open_gltf(path: Path) -> GltfFile:
    """Read the container of a .glb or .gltf file, whichever its bytes say it is."""
    data = path.read_bytes()
    if data[:4] == b"glTF":
        text, binary = _glb_chunks(path, data)
    else:
        if path.suffix.lower() == ".glb":
            raise InputError(
                f"{path}: expected a binary glTF file (starting with 'glTF'), found "
                f"{'an empty file' if not data else repr(data[:12])}; export it as GLB, or rename "
                "it to what it is"
            )
        text, binary = data, None
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: expected glTF's JSON, found text that is not ({error}); export it again"
        ) from None
    file = GltfFile(path, tree if isinstance(tree, dict) else {}, binary)
    asset = file.json.get("asset")
    version = str(asset.get("version", "none")) if isinstance(asset, dict) else "none"
    if not version.startswith("2."):
        raise InputError(
            f"{path}: expected glTF version 2, found {version}; convert it, for example with "
            "Blender"
        )
    return file


def _glb_chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a GLB file."""
    length = struct.unpack_from("<I", data, 8)[0] if len(data) >= 12 else 12
    if len(data) < max(length, 20):
        raise InputError(
            f"{path}: expected {max(length, 20)} bytes, found {len(data)}: the file is truncated; "
            "download or export it again"
        )
    chunks: dict[bytes, bytes] = {}
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, offset)
        if offset + 8 + size > len(data):
            raise InputError(
                f"{path}: expected a chunk of {size} bytes at byte {offset}, found the file's end; "
                "download or export it again"
            )
        chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
        offset += 8 + size
    if b"JSON" not in chunks:
        raise InputError(f"{path}: expected a JSON chunk, found none; export it again")
    return chunks[b"JSON"], chunks.get(b"BIN\0")


def meshopt_missing(path: Path, name: str) -> CapabilityError:
    """The error for buffers compressed by meshoptimizer."""
    return CapabilityError(
        f"{path}: its buffers are compressed ({name}), which vegtool cannot decode; decompress it "
        "with `gltf-transform copy IN.glb OUT.glb` or `gltfpack -i IN.glb -o OUT.glb -noq`"
    )


def _is_count(value: object) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0
