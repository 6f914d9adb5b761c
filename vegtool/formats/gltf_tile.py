"""Tiles as .glb files: of a landscape, merged groups, instances of models that tiles share, and
squares that were clustered anew or are surfels; of one plant, parts of its billboards and of its
surface.

Sources: glTF 2.0 specification; KHR_mesh_quantization and EXT_mesh_gpu_instancing (extensions,
Khronos glTF repository). Textures of merged groups, and the vertices of instanced models, are files
of their own, which clients load once; pictures of one square alone lie within its file. Positions
are in metres from the tile's centre.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray
from vegtool.errors import InputError
from vegtool.formats import png
from vegtool.formats.glb import ELEMENT_ARRAY_BUFFER, Document
from vegtool.formats.gltf import ALPHA_CUTOFF, plant_document
from vegtool.formats.gltf_material import UNLIT
from vegtool.formats.gltf_surfels import add_surfels, read_surfel_set
from vegtool.formats.plant_table import (
    PlantTable,
    add_tables,
    of_instances,
    of_vertices,
    vertex_ids,
)
from vegtool.formats.shared_model import SharedModel
from vegtool.lod import Triangles
from vegtool.plant import Plant
from vegtool.surfel_set import SurfelSet

QUANTIZATION, INSTANCING = "KHR_mesh_quantization", "EXT_mesh_gpu_instancing"
STEPS = 65535
"""Of 16 bits."""
LARGEST_STEP_M = 1e-3
"""Metres: where steps of 16 bits would be larger, that is in tiles of more than 65 m, positions are
floats, so that plants stay where they are beside each other."""
FINE = 8
"""Steps at least to the side of half of a far square's triangles: where plants are so small and so
far apart that there would be fewer, positions are floats, so that something is left of them."""
SHORT_INDICES = 65535
"""Vertices; index 65535 itself is reserved for primitive restart."""
LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071
DULL = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
"""Foliage seen from afar has no highlight of its own."""


@dataclass(frozen=True)
class SheetFiles:
    """Where a group's textures are, relative to the tile: color, and normal or None; None for both
    where all is opaque in the colours of its vertices. And of its material whether it is drawn from
    both sides, whether light is in its colours, and whether clients are to average textures where
    these are seen smaller than they are."""

    color: str | None
    normal: str | None
    double_sided: bool
    unlit: bool = False
    averaged: bool = True


@dataclass(frozen=True, eq=False)
class GroupPlants:
    """The plants of a merged group: what is known of each, and (v,) int64 which of them each vertex
    is of."""

    table: PlantTable
    of_vertex: npt.NDArray[np.int64]


def merged_glb(
    group: Triangles, sheet: SheetFiles, name: str, plain: bool = False,
    plants: GroupPlants | None = None,
) -> bytes:  # fmt: skip
    """A merged group: one node, one mesh, one primitive, one material.

    plain: float32 in place of KHR_mesh_quantization. plants: for clients that ask which is which.
    """
    document = Document()
    images = [None if uri is None else {"uri": uri} for uri in (sheet.color, sheet.normal)]
    textured, bumped = sheet.color is not None, sheet.normal is not None
    attributes, placed = _vertices(document, group, textured, bumped, plain, LARGEST_STEP_M)
    more: dict[str, Any] = {}
    if plants is not None:
        add_tables(document, [plants.table])
        attributes["_FEATURE_ID_0"] = document.add_accessor(vertex_ids(plants.of_vertex))
        more["extensions"] = of_vertices(document, 0, len(plants.table))
    primitive = {
        "attributes": attributes,
        **_indices(document, group),
        "material": _material(document, name, images, sheet.double_sided, sheet.unlit),
        **more,
    }
    return _shown(document, primitive, name, placed)


@dataclass(frozen=True, eq=False)
class OwnPictures:
    """Pictures of one square alone. color: (h, w, 4) uint8, sRGB, straight alpha, cut off at one
    half. normal: (h, w, 3) uint8 tangent space, or None."""

    color: ByteArray
    normal: ByteArray | None


def far_glb(
    group: Triangles,
    pictures: OwnPictures | None,
    name: str,
    unlit: bool = False,
    plain: bool = False,
) -> bytes:
    """A square clustered anew, drawn from both sides: one node, one mesh, one primitive, one
    material.

    pictures: written into the file; None for opaque triangles, which then have the colours of their
    vertices and no texture coordinates. plain: float32 in place of KHR_mesh_quantization.
    """
    document = Document()
    color, normal = (None, None) if pictures is None else (pictures.color, pictures.normal)
    attributes, placed = _vertices(
        document, group, color is not None, normal is not None, plain, _side(group) / FINE
    )
    images = [_image(document, color, name, "color"), _image(document, normal, name, "normal")]
    primitive = {
        "attributes": attributes,
        **_indices(document, group),
        "material": _material(document, name, images, True, unlit),
    }
    return _shown(document, primitive, name, placed)


def part_glb(
    quads: Triangles | None,
    sheet: SheetFiles,
    mesh: Plant | None,
    beside: Mapping[int, str],
    name: str,
) -> bytes:
    """A part of a plant: one node, one mesh; billboards are one primitive with one material, and
    so is each material of the mesh beside them. Vertices are floats, so that parts meet.

    beside: URIs of the mesh's pictures, by the id of their texture or pixels. Raises ValueError for
    neither quads nor mesh.
    """
    primitives: list[dict[str, Any]] = []
    document = Document()
    if mesh is not None:
        document = plant_document(mesh, name, np.zeros(3), beside)
        primitives = document.objects["meshes"][0]["primitives"]
    if quads is not None:
        images = [None if uri is None else {"uri": uri} for uri in (sheet.color, sheet.normal)]
        attributes = _plain(document, quads, sheet.color is not None, sheet.normal is not None)
        material = _material(
            document, name, images, sheet.double_sided, sheet.unlit, sheet.averaged
        )
        indices = _indices(document, quads)
        primitives.append({"attributes": attributes, **indices, "material": material})
    if mesh is None:
        if quads is None:
            raise ValueError("part_glb: expected quads or a mesh")
        return _shown(document, primitives[0], name, {})
    return document.glb()


def surfels_glb(surfels: SurfelSet, name: str, plain: bool = False) -> bytes:
    """A square's surfels, whose positions are in metres from its centre, in progressive order: one
    node, one mesh, one primitive of points. plain: float32 in place of KHR_mesh_quantization."""
    document = Document()
    document.show(add_surfels(document, surfels, name, np.zeros(3), not plain))
    return document.glb()


def read_surfels_tile(path: Path) -> SurfelSet:
    """What `surfels_glb` wrote, in metres from the tile's origin. Raises InputError for a file that
    is missing or anything else."""
    try:
        return read_surfel_set(path)
    except InputError as error:
        reason = str(error).removeprefix(f"{path}: ").removesuffix(" Convert the plant again.")
        raise InputError(f"{path}: {reason} It is a tile: make the tiles again") from error
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}). Make the tiles again"
        ) from error


def _indices(document: Document, group: Triangles) -> dict[str, int]:
    """None where no two triangles share a vertex: clients then take them as they come."""
    count = len(group.positions)
    if np.array_equal(group.indices, np.arange(count)):
        return {}
    kind = np.uint16 if count <= SHORT_INDICES else np.uint32
    return {"indices": document.add_accessor(group.indices.astype(kind), ELEMENT_ARRAY_BUFFER)}


def _side(group: Triangles) -> float:
    """Metres: the square root of twice the median area of its triangles."""
    a, b, c = np.moveaxis(group.positions[group.indices.reshape(-1, 3)], 1, 0)
    return float(np.sqrt(np.median(np.linalg.norm(np.cross(b - a, c - a), axis=1))))


def _shown(
    document: Document, primitive: dict[str, Any], name: str, placed: dict[str, list[float]]
) -> bytes:
    mesh = document.add("meshes", name=name, primitives=[primitive])
    document.show(document.add("nodes", name=name, mesh=mesh, **placed))
    return document.glb()


@dataclass(frozen=True, eq=False)
class Instances:
    """Plants that are drawn as one model. place: (n, 3) metres. yaw: (n,) radians about +y. scale:
    (n,). tint: (n, 3) linear factors. plants: what is known of each, for clients that ask."""

    model: SharedModel
    place: FloatArray
    yaw: FloatArray
    scale: FloatArray
    tint: npt.NDArray[np.float32]
    plants: PlantTable | None = None


def instanced_glb(drawn: Sequence[Instances], name: str) -> bytes:
    """Instances of shared models: a node and a mesh for each model. What is known of plants is
    written where it is known of all. Raises ValueError for none."""
    if not drawn:
        raise ValueError("instanced_glb: expected instances")
    document = Document()
    document.use_extension(INSTANCING, required=True)
    nodes = []
    tables = [one.plants for one in drawn if one.plants is not None]
    with_plants = len(tables) == len(drawn)
    if with_plants:
        add_tables(document, tables)
    for index, one in enumerate(drawn):
        half = one.yaw / 2
        rotation = np.zeros((len(half), 4), np.float32)
        rotation[:, 1], rotation[:, 3] = np.sin(half), np.cos(half)
        scale = np.repeat(one.scale[:, None], 3, axis=1).astype(np.float32)
        values = {
            "TRANSLATION": one.place.astype(np.float32),
            "ROTATION": rotation,
            "SCALE": scale,
            "_COLOR_0": one.tint.astype(np.float32),
        }
        attributes = {key: document.add_accessor(v, None) for key, v in values.items()}
        mesh = one.model.add_to(document)
        extension: dict[str, Any] = {INSTANCING: {"attributes": attributes}}
        if with_plants:
            extension |= of_instances(document, index, len(half))
        nodes.append(document.add("nodes", name=one.model.name, mesh=mesh, extensions=extension))
    document.show(document.add("nodes", name=name, children=nodes))
    return document.glb()


def _vertices(
    document: Document,
    group: Triangles,
    textured: bool,
    with_tangents: bool,
    plain: bool,
    most_step_m: float = np.inf,
) -> tuple[dict[str, int], dict[str, list[float]]]:
    """Attributes, and what places the node that draws them."""
    if plain:
        return _plain(document, group, textured, with_tangents), {}
    document.use_extension(QUANTIZATION, required=True)
    return _quantized(document, group, textured, with_tangents, most_step_m)


def _plain(
    document: Document, group: Triangles, textured: bool, with_tangents: bool
) -> dict[str, int]:
    attributes = {
        "POSITION": document.add_accessor(group.positions.astype(np.float32), bounds=True),
        "NORMAL": document.add_accessor(group.normals.astype(np.float32)),
    }
    if with_tangents:
        attributes["TANGENT"] = document.add_accessor(group.tangents.astype(np.float32))
    if textured:
        attributes["TEXCOORD_0"] = document.add_accessor(group.uvs.astype(np.float32))
    return attributes | _colors(document, group)


def _quantized(
    document: Document, group: Triangles, textured: bool, with_tangents: bool, most_step_m: float
) -> tuple[dict[str, int], dict[str, list[float]]]:
    """Attributes in 8 and 16 bits, and the node's place that undoes it: one factor for all axes, as
    normals want it. Positions are floats where a step would be more than so many metres."""
    low, high = group.positions.min(axis=0), group.positions.max(axis=0)
    step = float((high - low).max()) / STEPS or 1.0
    placed = {"translation": low.tolist(), "scale": [step] * 3}
    positions: npt.NDArray[Any] = np.rint((group.positions - low) / step).astype(np.uint16)
    if step > most_step_m:
        positions, placed = group.positions.astype(np.float32), {}
    attributes = {
        "POSITION": document.add_accessor(positions, bounds=True),
        "NORMAL": document.add_accessor(_bytes(group.normals), normalized=True),
    }
    if with_tangents:
        attributes["TANGENT"] = document.add_accessor(_bytes(group.tangents), normalized=True)
    if textured:
        uvs = np.rint(np.clip(group.uvs, 0, 1) * STEPS).astype(np.uint16)
        attributes["TEXCOORD_0"] = document.add_accessor(uvs, normalized=True)
    return attributes | _colors(document, group), placed


def _bytes(vectors: FloatArray) -> npt.NDArray[np.int8]:
    return np.rint(np.clip(vectors, -1, 1) * 127).astype(np.int8)


def _colors(document: Document, group: Triangles) -> dict[str, int]:
    if group.colors is None:
        return {}
    # 8 bits would round the linear colour of dark bark by a tenth
    colors = np.rint(np.clip(group.colors, 0, 1) * STEPS).astype(np.uint16)
    return {"COLOR_0": document.add_accessor(colors, normalized=True)}


def _material(
    document: Document,
    name: str,
    images: Sequence[dict[str, Any] | None],
    double_sided: bool,
    unlit: bool,
    averaged: bool = True,
) -> int:
    """images: of colours and of normals, or None; without any, what is drawn is opaque. Pictures
    have neighbours, or edges."""
    surface: dict[str, Any] = dict(DULL)
    more: dict[str, Any] = _unlit(document) if unlit else {}
    if any(images):
        sampler = document.add(
            "samplers", magFilter=LINEAR, minFilter=LINEAR_MIPMAP_LINEAR if averaged else LINEAR,
            wrapS=CLAMP_TO_EDGE, wrapT=CLAMP_TO_EDGE,
        )  # fmt: skip
        color, normal = (
            {"index": document.add("textures", source=document.add("images", **image),
                                   sampler=sampler)}
            if image else None
            for image in images
        )  # fmt: skip
        if color is not None:
            surface["baseColorTexture"] = color
            more |= {"alphaMode": "MASK", "alphaCutoff": ALPHA_CUTOFF}
        if normal is not None:
            more["normalTexture"] = normal
    return document.add(
        "materials", name=name, pbrMetallicRoughness=surface, doubleSided=double_sided, **more
    )


def _image(
    document: Document, pixels: ByteArray | None, name: str, kind: str
) -> dict[str, Any] | None:
    """A picture within the file."""
    if pixels is None:
        return None
    view = document.add_view(png.encode(pixels))
    return {"name": f"{name}_{kind}", "mimeType": "image/png", "bufferView": view}


def _unlit(document: Document) -> dict[str, Any]:
    document.use_extension(UNLIT)
    return {"extensions": {UNLIT: {}}}
