"""A model whose vertices and pictures are files that many .glb files refer to.

EXT_mesh_gpu_instancing draws a mesh of its own file; but the mesh's buffers may be anywhere. So a
tile holds only its instances, and what a client has loaded once it need not load again.
"""

from __future__ import annotations

import json
import re
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vegtool.formats.glb import Document
from vegtool.formats.gltf import plant_document
from vegtool.plant import Plant

ENDINGS = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp"}


@dataclass(frozen=True, eq=False)
class SharedModel:
    """name: of its node. objects: glTF objects, by kind. uri, length: its buffer's file, relative
    to the tiles, and that file's bytes."""

    name: str
    objects: dict[str, Any]
    uri: str
    length: int

    def add_to(self, document: Document) -> int:
        """Add the model; returns its mesh."""
        first = {kind: len(document.objects.get(kind, [])) for kind in self.objects}
        buffer = document.add_file(self.uri, self.length)
        for name in self.objects.get("extensionsUsed", []):
            document.use_extension(name)
        for view in self.objects.get("bufferViews", []):
            document.add("bufferViews", **{**view, "buffer": buffer})
        for accessor in self.objects.get("accessors", []):
            view = accessor["bufferView"] + first["bufferViews"]
            document.add("accessors", **{**accessor, "bufferView": view})
        for kind in ("images", "samplers"):
            for one in self.objects.get(kind, []):
                document.add(kind, **one)
        for texture in self.objects.get("textures", []):
            moved = {
                "source": texture["source"] + first["images"],
                "sampler": texture["sampler"] + first["samplers"],
            }
            document.add("textures", **{**texture, **moved})
        for material in self.objects.get("materials", []):
            document.add("materials", **_moved(material, first.get("textures", 0)))
        mesh = deepcopy(self.objects["meshes"][0])
        for primitive in mesh["primitives"]:
            used = primitive["attributes"]
            used |= {key: index + first["accessors"] for key, index in used.items()}
            primitive["indices"] += first["accessors"]
            primitive["material"] += first["materials"]
        return document.add("meshes", **mesh)


def model_files(plant: Plant, name: str) -> dict[str, bytes]:
    """A plant or a level as files: NAME.gltf, its buffer NAME.bin, and its pictures."""
    stem = plain_name(name)
    document = plant_document(plant, name)
    binary, objects = document.binary, deepcopy(document.objects)
    files: dict[str, bytes] = {}
    for number, image in enumerate(objects.get("images", [])):
        view = objects["bufferViews"][image.pop("bufferView")]
        begin = view["byteOffset"]
        data = binary[begin : begin + view["byteLength"]]
        file = f"{stem}_{number}{ENDINGS[image.pop('mimeType')]}"
        files[file] = data
        image["uri"] = file
    used = {accessor["bufferView"] for accessor in objects["accessors"]}
    kept = bytearray()
    place: dict[int, int] = {}
    views: list[dict[str, Any]] = []
    for index, view in enumerate(objects["bufferViews"]):
        if index not in used:
            continue
        place[index] = len(views)
        begin = view["byteOffset"]
        kept += bytes(-len(kept) % 4)
        views.append({**view, "byteOffset": len(kept)})
        kept += binary[begin : begin + view["byteLength"]]
    kept += bytes(-len(kept) % 4)
    objects["bufferViews"] = views
    for accessor in objects["accessors"]:
        accessor["bufferView"] = place[accessor["bufferView"]]
    if any("translation" in node for node in objects["nodes"]):
        raise ValueError(f"model_files {name}: a model far from its origin cannot be instanced")
    files[f"{stem}.bin"] = bytes(kept)
    files[f"{stem}.gltf"] = _alone(objects, stem, len(kept))
    return files


def read_shared(path: Path, folder: str) -> SharedModel:
    """A model whose files are written: its .gltf file, and `folder`, a path from the tiles to it
    with a slash at its end."""
    objects = json.loads(path.read_bytes())
    (buffer,) = objects.pop("buffers")
    (node,) = objects["nodes"]
    for image in objects.get("images", []):
        image["uri"] = folder + image["uri"]
    for kind in ("scene", "scenes", "asset", "nodes"):
        del objects[kind]
    return SharedModel(node["name"], objects, folder + buffer["uri"], buffer["byteLength"])


def plain_name(name: str) -> str:
    """A name that is one in every file system, and as a part of a URI."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)


def _alone(objects: dict[str, Any], stem: str, length: int) -> bytes:
    """The model as a file of its own, beside its buffer and its pictures."""
    values = {**objects, "buffers": [{"uri": f"{stem}.bin", "byteLength": length}]}
    return (json.dumps(values, allow_nan=False, separators=(",", ":")) + "\n").encode()


def _moved(value: Any, first: int) -> Any:
    """A material whose textures are counted from `first` on."""
    if isinstance(value, list):
        return [_moved(one, first) for one in value]
    if not isinstance(value, dict):
        return value
    return {
        key: {**inner, "index": inner["index"] + first}
        if key.endswith("Texture")
        else _moved(inner, first)
        for key, inner in value.items()
    }
