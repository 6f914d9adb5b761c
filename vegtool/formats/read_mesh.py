"""PLY and STL through trimesh: bare meshes with one material."""

from __future__ import annotations

import io
import logging
import re
import struct
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import InputError
from vegtool.formats.alpha import settle_alpha
from vegtool.formats.beside import find_beside
from vegtool.formats.images import decode
from vegtool.formats.parts import Parsed, Part
from vegtool.formats.vertex_colors import settle_colors
from vegtool.plant import Material, Texture
from vegtool.srgb import linear_from_srgb

PLAIN = Material("default", double_sided=True)
HEADER = 65_536
"""Bytes in which a PLY header ends."""


def parse(path: Path) -> Parsed:
    """Read a PLY or STL file. Raises InputError where it is broken."""
    from trimesh.exchange.ply import load_ply
    from trimesh.exchange.stl import load_stl

    if not logging.getLogger("trimesh").handlers:  # else it would write to stderr
        logging.getLogger("trimesh").addHandler(logging.NullHandler())
    kind = path.suffix.lower()[1:].upper()
    data = path.read_bytes()
    _check_counts(path, kind, data)
    notes: list[str] = []
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", DeprecationWarning)  # numpy's word for "not a number"
            stream = io.BytesIO(data)
            loaded = load_ply(stream, skip_materials=True) if kind == "PLY" else load_stl(stream)
            solids = loaded.get("geometry", {"": loaded})
            parts = [
                _part(path, name, solid, notes)
                for name, solid in solids.items()
                if solid.get("faces") is not None
            ]
    except InputError:
        raise
    except Exception as error:  # trimesh raises whatever the broken file made it stumble over
        raise InputError(
            f"{path}: expected {kind} data, found something that is not "
            f"({type(error).__name__}: {error}); check the file's type or export it again"
        ) from error
    material = replace(PLAIN, color_texture=_texture(path, data, notes)) if kind == "PLY" else PLAIN
    return Parsed(
        name=path.stem, parts=parts, materials=[_with_alpha(material, notes)], notes=notes
    )


def _texture(path: Path, data: bytes, notes: list[str]) -> Texture | None:
    """The picture that a PLY header names in a comment, as MeshLab writes it."""
    match = re.search(rb"^comment TextureFile (.+?)\s*$", data[:HEADER], re.MULTILINE)
    if match is None:
        return None
    reference = match[1].decode("utf-8", errors="replace")
    found = find_beside(path, reference)
    if found is None:
        notes.append(f"texture {reference} is missing; drawn without it")
        return None
    return decode(found.read_bytes(), found.name, f"{path}: texture {found.name}")


def _with_alpha(material: Material, notes: list[str]) -> Material:
    mode, cutoff, base_color = settle_alpha(
        material.name, "AUTO", 0.5, material.base_color, material.color_texture, notes
    )
    return replace(material, alpha_mode=mode, alpha_cutoff=cutoff, base_color=base_color)


def _check_counts(path: Path, kind: str, data: bytes) -> None:
    """Refuse a header that claims more elements than the file could hold, before any is made."""
    if kind == "PLY":
        header = data[:HEADER].partition(b"end_header")[0]
        counts = [
            int(line.split()[2])
            for line in header.splitlines()
            if line.startswith(b"element") and len(line.split()) == 3 and line.split()[2].isdigit()
        ]
        claimed = sum(counts)
    else:
        binary = len(data) >= 84 and data.lstrip()[:5].lower() != b"solid"
        claimed = 50 * struct.unpack_from("<I", data, 80)[0] if binary else 0
    if claimed > len(data):
        raise InputError(
            f"{path}: expected the {claimed} {'elements' if kind == 'PLY' else 'bytes'} that its "
            f"header announces, found {len(data)} bytes: truncated, or not {kind}; export it again"
        )


def _part(path: Path, name: str, solid: dict[str, Any], notes: list[str]) -> Part:
    positions = np.asarray(solid["vertices"], dtype=np.float64).reshape(-1, 3)
    faces = np.asarray(solid["faces"], dtype=np.int64)
    if faces.ndim == 2 and faces.shape[1] == 4:
        faces = faces[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    if faces.size and (faces.min() < 0 or faces.max() >= len(positions)):
        raise InputError(
            f"{path}: expected faces to name vertices 0 to {len(positions) - 1}, found "
            f"{faces.min()} to {faces.max()}; export it again"
        )
    normals = solid.get("vertex_normals")
    if normals is None and solid.get("face_normals") is not None:
        normals = np.repeat(solid["face_normals"], 3, axis=0)
    colors = solid.get("vertex_colors")
    visual = solid.get("visual")
    return Part(
        positions=positions,
        faces=faces,
        material=0,
        name=name,
        normals=None if normals is None else np.asarray(normals, dtype=np.float64),
        uvs=None if visual is None else _flipped(visual.uv),
        colors=None if colors is None else settle_colors(_linear(colors), False, name, notes),
    )


def _flipped(uvs: FloatArray | None) -> FloatArray | None:
    return None if uvs is None else np.asarray(uvs, dtype=np.float64) * [1, -1] + [0, 1]


def _linear(colors: np.ndarray) -> FloatArray:
    """(v, 3 or 4) sRGB bytes or fractions -> linear; alpha as it is."""
    values = np.asarray(colors, dtype=np.float64)
    if colors.dtype.kind in "iu":
        values = values / 255
    return np.concatenate([linear_from_srgb(values[:, :3]), values[:, 3:]], axis=1)
