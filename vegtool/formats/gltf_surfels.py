"""Surfels in glTF 2.0: points in progressive order, whose first part a viewer may draw.

Sources: glTF 2.0 specification, 3.7.2 (points); KHR_mesh_quantization (extension, Khronos glTF
repository). What the length of that part follows from, and what it cannot know otherwise, is in the
mesh's extras, as `surfels`: p_m and r_m of Brandt et al. 2019, section 4.1. How large the disc of
each is, of the radius of all, is in the attribute _SIZE (SurfelSet.size). Where surfels have light
of their own, it is in the attribute _LIGHT, and in the extras the tint of what passes through.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.errors import InputError
from vegtool.formats.clean import usable_rows
from vegtool.formats.glb import Document
from vegtool.formats.gltf_data import GltfFile, open_gltf
from vegtool.formats.gltf_material import UNLIT
from vegtool.formats.gltf_nodes import scene_nodes
from vegtool.surfel_set import Spacing, SurfelSet

QUANTIZATION = "KHR_mesh_quantization"
POINTS = 0
"""Mode of a primitive."""
STEPS = 65535
"""Of 16 bits."""
EXTRAS = "surfels"
LIGHT = "_LIGHT"
_AGAIN = "Convert the plant again."


def add_surfels(
    document: Document, surfels: SurfelSet, name: str, origin: FloatArray, quantized: bool = False
) -> int:
    """Add surfels to a document, positions relative to an origin (3,); return their node.

    quantized: positions in 16 bits and normals in 8, for clients that know KHR_mesh_quantization:
    24 bytes each in place of 36. Light takes 4 more.
    """
    placed: dict[str, Any] = {}
    local = surfels.position - origin
    normal = unit(surfels.normal)
    color = np.round(np.clip(surfels.color, 0.0, 1.0) * STEPS).astype(np.uint16)
    size = np.round(surfels.size * 255).astype(np.uint8)
    if quantized:
        document.use_extension(QUANTIZATION, required=True)
        low = local.min(axis=0)
        scale = float((local.max(axis=0) - low).max()) or 1.0
        steps = np.round((local - low) / scale * STEPS).astype(np.uint16)
        position = document.add_accessor(steps, bounds=True, normalized=True)
        bytes_ = np.round(normal * 127).astype(np.int8)
        placed = {"translation": (origin + low).tolist(), "scale": [scale] * 3}
        normals = document.add_accessor(bytes_, normalized=True)
    else:
        position = document.add_accessor(local.astype(np.float32), bounds=True)
        placed = {"translation": origin.tolist()} if origin.any() else {}
        normals = document.add_accessor(normal.astype(np.float32))
    material: dict[str, Any] = {
        "name": name,
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9},
    }
    if surfels.unlit:
        document.use_extension(UNLIT)
        material["extensions"] = {UNLIT: {}}
    primitive: dict[str, Any] = {
        "mode": POINTS,
        "attributes": {
            "POSITION": position,
            "NORMAL": normals,
            "COLOR_0": document.add_accessor(color, normalized=True),
            "_SIZE": document.add_accessor(size, normalized=True),
        },
        "material": document.add("materials", **material, doubleSided=surfels.double_sided),
    }
    told: dict[str, Any] = {
        "p_m": surfels.spacing.length,
        "r_m": surfels.spacing.radius_m,
    }
    if surfels.light is not None:
        shares = np.round(surfels.light * 255).astype(np.uint8)
        primitive["attributes"][LIGHT] = document.add_accessor(shares, normalized=True)
        told["transmission_tint"] = surfels.transmission_tint.tolist()
    mesh = document.add("meshes", name=name, primitives=[primitive], extras={EXTRAS: told})
    return document.add("nodes", name=name, mesh=mesh, **placed)


def read_surfel_set(path: Path) -> SurfelSet:
    """The surfels of a file that `add_surfels` made. Raises InputError for anything else."""
    file = open_gltf(path)
    try:
        return _read(file)
    except (AttributeError, TypeError, KeyError, IndexError, ValueError, AssertionError) as error:
        raise InputError(
            f"{path}: expected surfels as vegtool writes them, found a part that is none "
            f"({type(error).__name__}: {error}). {_AGAIN}"
        ) from error


def _read(file: GltfFile) -> SurfelSet:
    nodes = [node for node in scene_nodes(file, []).values() if node.mesh is not None]
    meshes = [file.entry("meshes", node.mesh) for node in nodes]
    if len(meshes) != 1 or EXTRAS not in meshes[0].get("extras", {}):
        raise InputError(
            f"{file.path}: expected one mesh of points whose extras tell of {EXTRAS}, found "
            f"{len(meshes)} meshes without. {_AGAIN}"
        )
    (primitive,), told = meshes[0]["primitives"], meshes[0]["extras"][EXTRAS]
    lit = LIGHT in primitive["attributes"]
    values = {
        name: np.asarray(file.accessor(primitive["attributes"][name]), np.float64)
        for name in ("POSITION", "NORMAL", "COLOR_0", "_SIZE", *([LIGHT] if lit else []))
    }
    if not all(usable_rows(rows).all() for rows in values.values()) or not len(values["POSITION"]):
        raise file.broken("numbers for each surfel", "NaN, infinite ones or none")
    world = nodes[0].world
    length, radius = told["p_m"], float(told["r_m"])
    if not (isinstance(length, int) and length >= 1 and 0 <= radius < np.inf):
        raise file.broken("p_m of 1 or more and r_m of 0 or more metres", f"{length!r}, {radius}")
    material = file.entry("materials", primitive["material"])
    return SurfelSet(
        values["POSITION"] @ world[:3, :3].T + world[:3, 3],
        unit(values["NORMAL"]),
        values["COLOR_0"][:, :3],
        Spacing(length, radius, len(values["POSITION"])),
        values["_SIZE"][:, 0],
        UNLIT in material.get("extensions", {}),
        bool(material.get("doubleSided", False)),
        values[LIGHT] if lit else None,
        np.array(told["transmission_tint"] if lit else [1, 1, 1], np.float64),
    )
