"""Parsed file -> Plant: cleaned, in metres, y up, its leaves told from its wood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, unit
from vegtool.errors import InputError
from vegtool.formats import ReadOptions
from vegtool.formats.clean import (
    bounds,
    flat_faces,
    last_face_normals,
    repeated_faces,
    smooth_normals,
    usable_rows,
)
from vegtool.formats.declared import resolve_branches
from vegtool.formats.parts import IndexArray, Parsed, Part, check_face_count
from vegtool.formats.roles import guess_role, named_roles
from vegtool.formats.upright import UPRIGHT, guess_up, turned
from vegtool.plant import Material, Plant

Mask = npt.NDArray[np.bool_]

SHORTEST_NORMAL = 1e-6
"""A stored normal shorter than this says nothing."""
LOOSE_IMAGES = {".png", ".jpg", ".jpeg", ".webp", ".tga"}
WIDEST_UV = 1e9
"""Texture coordinates beyond are as broken as infinite ones."""

LEAST_SIZE, GREATEST_SIZE = 0.005, 150.0
"""Metres: no plant that is drawn one by one is smaller or larger; the unit is wrong, rather."""


@dataclass(frozen=True, eq=False)
class _Mesh:
    """All parts as one mesh, in the file's unit relative to `origin`.

    normals: (v, 3), zero where the file gives none. point: see Part. material, branch, part: (f,).
    """

    origin: FloatArray
    positions: FloatArray
    normals: FloatArray
    uvs: FloatArray
    colors: FloatArray | None
    point: IndexArray
    faces: IndexArray
    material: IndexArray
    branch: IndexArray
    part: IndexArray


def assemble(parsed: Parsed, path: Path, options: ReadOptions) -> Plant:
    """The Plant in a parsed file. Raises InputError where nothing drawable is left."""
    notes = list(parsed.notes)
    mesh = _join(parsed.parts, path)
    mesh = _drop_broken_faces(mesh, path, notes)
    mesh = _with_normals(mesh, _without_normal(parsed.parts), notes)
    mesh = _only_used_vertices(mesh)
    up = options.up if options.up != "auto" else parsed.up
    turn = UPRIGHT[up or guess_up(mesh.positions + mesh.origin, mesh.faces, notes)]
    materials = _without_lost_textures(parsed.materials, parsed.parts, notes)
    mesh, materials = _only_used_materials(mesh, materials)
    plant = Plant(
        name=parsed.name,
        positions=turned(mesh.positions + mesh.origin, turn) * options.metres,
        normals=turned(mesh.normals, turn),
        uvs=mesh.uvs,
        colors=mesh.colors,
        faces=mesh.faces.astype(np.int32),
        face_material=mesh.material.astype(np.int32),
        materials=_with_roles(materials, mesh, parsed.parts, options, path),
        source=str(path),
    )
    _note_loose_images(plant, path, notes)
    _note_size(plant, notes)
    branches = resolve_branches(plant, mesh.branch, parsed.declared, notes)
    return replace(plant, branches=branches, notes=tuple(notes))


def _note_size(plant: Plant, notes: list[str]) -> None:
    if not LEAST_SIZE <= plant.extent <= GREATEST_SIZE:
        notes.append(
            f"{plant.extent:,.4g} metres across: is that so? --unit says what the file counts in"
        )


def _join(parts: list[Part], path: Path) -> _Mesh:
    """All parts in one mesh, in double precision around the middle of their bounds."""
    sizes = np.array([len(part.positions) for part in parts])
    counts = np.array([len(part.faces) for part in parts])
    if counts.sum() == 0:
        raise InputError(f"{path}: expected triangles, found none; export the plant as a mesh")
    check_face_count(path, int(counts.sum()))
    start = np.cumsum(sizes) - sizes
    positions = np.concatenate([part.positions for part in parts])
    usable = usable_rows(positions)
    if not usable.all():
        positions = np.where(usable[:, None], positions, np.inf)
    if not usable.any():
        raise InputError(
            f"{path}: expected coordinates, found only NaN or infinite ones; export it again"
        )
    origin = bounds(positions if usable.all() else positions[usable]).mean(axis=0)
    colored = any(part.colors is not None for part in parts)

    def or_else(value: FloatArray | None, part: Part, width: int, fill: float) -> FloatArray:
        return np.full((len(part.positions), width), fill) if value is None else value

    points, base = [], 0
    for part in parts:
        point = np.arange(len(part.positions)) if part.point is None else part.point
        points.append(point + base)
        base += int(point.max(initial=-1)) + 1
    return _Mesh(
        origin=origin,
        positions=positions - origin,
        normals=np.concatenate([or_else(p.normals, p, 3, 0.0) for p in parts]),
        uvs=np.concatenate([or_else(p.uvs, p, 2, 0.0) for p in parts]),
        colors=np.concatenate([or_else(p.colors, p, 4, 1.0) for p in parts]) if colored else None,
        point=np.concatenate(points),
        faces=np.concatenate([p.faces + s for p, s in zip(parts, start, strict=True)]),
        material=np.repeat([p.material for p in parts], counts),
        branch=np.concatenate([np.broadcast_to(p.branch, len(p.faces)) for p in parts]),
        part=np.repeat(np.arange(len(parts)), counts),
    )


def _drop_broken_faces(mesh: _Mesh, path: Path, notes: list[str]) -> _Mesh:
    """Without faces that use broken coordinates, have no area or repeat another."""
    total = len(mesh.faces)
    usable = usable_rows(mesh.positions)
    if not usable.all():
        mesh = replace(mesh, positions=np.where(usable[:, None], mesh.positions, 0.0))
    laid = usable_rows(mesh.uvs, WIDEST_UV)
    if not laid.all():
        notes.append(f"set {(~laid).sum()} NaN or infinite texture coordinates to 0")
        mesh = replace(mesh, uvs=np.where(laid[:, None], mesh.uvs, 0.0))
    found = {}
    steps: tuple[tuple[str, Callable[[_Mesh], Mask]], ...] = (
        ("with NaN or infinite coordinates", lambda m: _use_any(m.faces, ~usable)),
        ("without area", lambda m: flat_faces(m.positions, m.faces)),
        ("repeated", lambda m: repeated_faces(m.positions, m.uvs, m.faces, m.material)),
    )
    for what, broken in steps:
        drop: Mask = broken(mesh)
        if drop.any():
            found[what] = int(drop.sum())
            notes.append(f"dropped {found[what]} of {total} faces {what}")
            mesh = _only_faces(mesh, ~drop)
        if not len(mesh.faces):
            listed = ", ".join(f"{n} {what}" for what, n in found.items())
            raise InputError(
                f"{path}: expected triangles, found none that can be drawn ({listed}); export the "
                "model again"
            )
    return mesh


def _use_any(faces: IndexArray, marked: Mask) -> Mask:
    """(f,) bool: faces that use a marked vertex."""
    if not marked.any():
        return np.zeros(len(faces), dtype=np.bool_)
    return np.asarray(marked[faces].any(axis=1))


def _without_normal(parts: list[Part]) -> Mask:
    """(v,) bool: vertices of all parts that the file gives no normal."""
    return np.concatenate(
        [
            np.full(len(part.positions), part.normals is None)
            if part.without_normal is None
            else part.without_normal
            for part in parts
        ]
    )


def _with_normals(mesh: _Mesh, absent: Mask, notes: list[str]) -> _Mesh:
    """Every vertex with a unit normal: its own, else the smooth one, else its face's.

    absent: (v,) vertices that the file gives none.
    """
    finite = usable_rows(mesh.normals, np.inf)
    own = np.where(finite[:, None], mesh.normals, 0.0)
    largest = np.abs(own).max(axis=1, keepdims=True)
    own = unit(np.divide(own, largest, out=np.zeros_like(own), where=largest > SHORTEST_NORMAL))
    used = np.zeros(len(own), dtype=bool)
    used[mesh.faces] = True
    missing = used & ~own.any(axis=1)
    if missing.any():
        kinds = {
            "without any in the file": missing & absent,
            "of length zero": missing & finite & ~absent,
            "not a number": missing & ~finite,
        }
        listed = ", ".join(f"{rows.sum()} {kind}" for kind, rows in kinds.items() if rows.any())
        notes.append(f"computed the normals of {missing.sum()} of {used.sum()} vertices: {listed}")
        own[missing] = smooth_normals(mesh.positions, mesh.faces, mesh.point)[missing]
        cancelled = used & ~own.any(axis=1)  # where two sides of a card share their points
        own[cancelled] = last_face_normals(mesh.positions, mesh.faces)[cancelled]
    return replace(mesh, normals=own)


def _note_loose_images(plant: Plant, path: Path, notes: list[str]) -> None:
    """Note the images beside a plant that has texture coordinates and no texture to lay on them."""
    if not plant.uvs.any() or any(m.color_texture is not None for m in plant.materials):
        return
    images = sorted(p.name for p in path.parent.iterdir() if p.suffix.lower() in LOOSE_IMAGES)
    if images:
        notes.append(
            f"the file names no texture; {len(images)} images beside it are not used "
            f"({', '.join(images[:4])}{', ...' if len(images) > 4 else ''})"
        )


def _only_faces(mesh: _Mesh, keep: np.ndarray) -> _Mesh:
    return replace(
        mesh,
        faces=mesh.faces[keep],
        material=mesh.material[keep],
        branch=mesh.branch[keep],
        part=mesh.part[keep],
    )


def _only_used_vertices(mesh: _Mesh) -> _Mesh:
    used = np.zeros(len(mesh.positions), dtype=bool)
    used[mesh.faces] = True
    return replace(
        mesh,
        positions=mesh.positions[used],
        normals=mesh.normals[used],
        uvs=mesh.uvs[used],
        colors=None if mesh.colors is None else mesh.colors[used],
        point=mesh.point[used],
        faces=(np.cumsum(used) - 1)[mesh.faces],
    )


def _without_lost_textures(
    materials: list[Material], parts: list[Part], notes: list[str]
) -> list[Material]:
    """The materials, plain where no face that wears them says where on the texture it lies."""
    worn = {part.material for part in parts if len(part.faces)}
    laid = {part.material for part in parts if part.uvs is not None}
    found = list(materials)
    for index in sorted(worn - laid):
        material = found[index]
        if material.color_texture is not None or material.normal_texture is not None:
            notes.append(f"material {material.name}: no texture coordinates; drawn without texture")
            found[index] = replace(
                material, color_texture=None, normal_texture=None, alpha_mode="opaque"
            )
    return found


def _only_used_materials(mesh: _Mesh, materials: list[Material]) -> tuple[_Mesh, list[Material]]:
    used = np.unique(mesh.material)
    return replace(mesh, material=np.searchsorted(used, mesh.material)), [
        materials[k] for k in used
    ]


def _with_roles(
    materials: list[Material], mesh: _Mesh, parts: list[Part], options: ReadOptions, path: Path
) -> tuple[Material, ...]:
    """The materials with their roles: as the user says, else guessed."""
    if options.leaf_materials:
        roles = named_roles(materials, options.leaf_materials, str(path))
    else:
        roles = [
            guess_role(
                material, _wearers(mesh, parts, index), partial(_faces_per_point, mesh, index)
            )
            for index, material in enumerate(materials)
        ]
    return tuple(replace(m, role=r) for m, r in zip(materials, roles, strict=True))


def _wearers(mesh: _Mesh, parts: list[Part], material: int) -> set[str]:
    """Names of the parts that wear a material."""
    return {parts[k].name for k in np.unique(mesh.part[mesh.material == material])}


def _faces_per_point(mesh: _Mesh, material: int) -> float:
    """Faces of a material per distinct point."""
    worn = mesh.material == material
    points = mesh.positions[np.unique(mesh.faces[worn])]
    return float(worn.sum() / len(np.unique(points, axis=0)))
