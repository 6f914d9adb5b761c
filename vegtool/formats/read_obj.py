"""Wavefront OBJ: points, polygons, materials and groups.

Read by ourselves: trimesh (5.2) reads one mtllib, drops normals whose indices differ from the
points', splits a file by group at a cost that grows with groups times points, and swallows errors.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import InputError
from vegtool.formats.beside import find_beside
from vegtool.formats.parts import Declared, IndexArray, Parsed, Part
from vegtool.formats.polygons import triangulate
from vegtool.formats.read_mtl import ObjMaterial, read_mtl
from vegtool.formats.vertex_colors import settle_colors
from vegtool.plant import Material
from vegtool.srgb import linear_from_srgb

BRANCH_NAME = re.compile(r"(?:^|[_\-. ])L(?:evel|vl)?[_\-. ]?(\d+)[_\-. ](\d+)$", re.IGNORECASE)
"""One group per branch: level and number, `branch_L2_17`."""
PATH_NAME = re.compile(r"^(.+)[/.:|_\-](\d+)$")
"""One group per branch: the parent's name and a number, `0`, `0.3`, `0.3.1`."""


@dataclass(eq=False)
class _Statements:
    """The lines of a file by kind.

    faces: text of each; group, material: (f,) index into the name lists. points_before: numbers of
    v, vt, vn read before a face with negative (relative) indices.
    """

    v: list[str] = field(default_factory=list)
    vt: list[str] = field(default_factory=list)
    vn: list[str] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    group: list[int] = field(default_factory=list)
    material: list[int] = field(default_factory=list)
    groups: dict[str, int] = field(default_factory=lambda: {"": 0})
    materials: dict[str, int] = field(default_factory=lambda: {"": 0})
    libraries: list[str] = field(default_factory=list)
    points_before: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    others: int = 0


@dataclass(frozen=True, eq=False)
class _Triangles:
    """corners: (f, 3, 3) indices of v, vt, vn per corner, -1 for none. face: (f,) its statement."""

    corners: IndexArray
    face: IndexArray


def parse(path: Path) -> Parsed:
    """Read an OBJ file and its MTL files. Raises InputError where it is broken."""
    notes: list[str] = []
    text = path.read_bytes().decode("utf-8", errors="replace")
    if "\0" in text[:4096]:
        raise InputError(f"{path}: expected OBJ text, found binary data; check the file's type")
    lines = _sort_lines(text)
    if not lines.v:
        raise InputError(f"{path}: expected OBJ vertices ('v x y z'), found none; export it again")
    points, colors = _points(path, lines.v)
    uvs = _table(path, "vt", lines.vt, 2)
    normals = _table(path, "vn", lines.vn, 3)
    triangles = _read_faces(path, lines, points, len(uvs), len(normals), notes)
    materials = _read_materials(path, lines, notes)
    if lines.others:
        notes.append(f"left out {lines.others} lines, points or curved surfaces")
    group = np.array(lines.group, dtype=np.int64)[triangles.face]
    material = np.array(lines.material, dtype=np.int64)[triangles.face]
    parts = [
        _part(
            triangles.corners[chosen],
            points,
            uvs,
            normals,
            colors,
            index,
            materials[index],
            group[chosen],
            list(lines.groups),
            notes,
        )
        for index in np.unique(material)
        if (chosen := material == index).any()
    ]
    return Parsed(
        name=path.stem,
        parts=parts,
        materials=[m.material for m in materials],
        declared=_declared(list(lines.groups)),
        notes=list(dict.fromkeys(notes)),
    )


def _sort_lines(text: str) -> _Statements:
    found = _Statements()
    group = material = 0
    tables = {"v": found.v, "vt": found.vt, "vn": found.vn}
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").replace("\t", " ").splitlines():
        key, _, rest = line.lstrip().partition(" ")
        if key in tables:
            tables[key].append(rest)
        elif key == "f":
            if "-" in rest:
                found.points_before[len(found.faces)] = (
                    len(found.v),
                    len(found.vt),
                    len(found.vn),
                )
            found.faces.append(rest)
            found.group.append(group)
            found.material.append(material)
        elif key in ("g", "o"):
            group = found.groups.setdefault(rest.strip(), len(found.groups))
        elif key == "usemtl":
            material = found.materials.setdefault(rest.strip(), len(found.materials))
        elif key == "mtllib":
            found.libraries.append(rest.strip())
        elif key in ("l", "p", "curv", "curv2", "surf"):
            found.others += 1
    return found


def _points(path: Path, lines: list[str]) -> tuple[FloatArray, FloatArray | None]:
    """(v, 3) points and, where written behind them, (v, 3) linear colours."""
    table = _table(path, "v", lines, 3, most=7)
    if table.shape[1] < 6:
        return table[:, :3], None
    colors = np.nan_to_num(table[:, 3:6], nan=1.0, posinf=1.0, neginf=0.0)
    return table[:, :3], linear_from_srgb(colors / 255 if colors.max() > 1 else colors)


def _table(path: Path, kind: str, lines: list[str], least: int, most: int = 0) -> FloatArray:
    """(n, least or up to most) numbers of the lines of one kind."""
    if not lines:
        return np.zeros((0, least))
    width = len(lines[0].split())
    words = " ".join(lines).split()
    if len(words) != width * len(lines) or width < least:
        rows = [line.split("#")[0].split() for line in lines]
        width = min(len(row) for row in rows)
        if width < least:
            bad = next(k for k, row in enumerate(rows) if len(row) < least)
            raise InputError(
                f"{path}: expected {least} numbers in every {kind!r} line, found {lines[bad]!r} "
                f"as number {bad + 1}; export it again"
            )
        words = [word for row in rows for word in row[:width]]
    try:
        table = np.array(words, dtype=np.float64).reshape(len(lines), width)
    except ValueError:
        table = np.array([_number(word) for word in words]).reshape(len(lines), width)
    return table[:, : max(least, most)]


def _number(word: str) -> float:
    """A float; NaN for what C libraries print instead of one (-1.#IND, 1.#QNAN) and other junk."""
    try:
        return float(word)
    except ValueError:
        return float("nan")


def _read_faces(
    path: Path, lines: _Statements, points: FloatArray, uvs: int, normals: int, notes: list[str]
) -> _Triangles:
    """All faces as triangles, in the order of the file."""
    shapes: dict[tuple[int, int, bool], list[int]] = {}
    for index, rest in enumerate(lines.faces):
        shape = (len(rest.split()), rest.count("/"), "//" in rest)
        shapes.setdefault(shape, []).append(index)
    corners: list[IndexArray] = []
    faces: list[IndexArray] = []
    for (size, slashes, skips), members in shapes.items():
        if size < 3:
            notes.append(f"dropped {len(members)} faces with fewer than three corners")
            continue
        texts = [lines.faces[k] for k in members]
        try:
            polygons = _corner_indices(texts, size, slashes, skips)
        except (ValueError, OverflowError):
            raise InputError(
                f"{path}: expected faces like 'f 1/1/1 2/2/2 3/3/3', found 'f {texts[0]}' or one "
                "like it; export it again"
            ) from None
        member = np.array(members)
        polygons = _absolute(polygons, member, lines, (len(points), uvs, normals))
        _check_corners(path, polygons, len(points), texts)
        places = triangulate(polygons[..., 0], points)
        owner = np.repeat(np.arange(len(member)), size - 2)
        corners.append(polygons[owner[:, None], places])
        faces.append(member[owner])
    if not corners:
        raise InputError(f"{path}: expected faces ('f 1 2 3'), found none; export it as a mesh")
    face = np.concatenate(faces)
    order = np.argsort(face, kind="stable")
    corner = np.concatenate(corners)[order]
    for column, count, what in ((1, uvs, "texture coordinates"), (2, normals, "normals")):
        wild = corner[..., column] >= count
        if wild.any():
            notes.append(f"{wild.sum()} corners name {what} that the file does not have; ignored")
            corner[..., column][wild] = -1
    return _Triangles(corner, face[order])


def _corner_indices(texts: list[str], size: int, slashes: int, skips: bool) -> IndexArray:
    """(n, size, 3) indices as written, 0 for none, of faces of one shape."""
    joined = " ".join(texts)
    found = np.zeros((len(texts), size, 3), dtype=np.int64)
    if slashes == 0:
        columns = [0]
    elif slashes == size:
        columns = [0, 1]
    elif slashes == 2 * size and skips and joined.count("//") == size * len(texts):
        columns, joined = [0, 2], joined.replace("//", " ")
    elif slashes == 2 * size and not skips:
        columns = [0, 1, 2]
    else:  # corners of different kinds in one face
        for row, text in enumerate(texts):
            for place, corner in enumerate(text.split()):
                for column, number in enumerate(corner.split("/")[:3]):
                    found[row, place, column] = int(number or 0)
        return found
    numbers = np.array(joined.replace("/", " ").split(), dtype=np.int64)
    found[..., columns] = numbers.reshape(len(texts), size, len(columns))
    return found


def _absolute(
    polygons: IndexArray, member: IndexArray, lines: _Statements, totals: tuple[int, int, int]
) -> IndexArray:
    """Indices from 0; -1 for none; relative ones counted back from where they stand."""
    result = polygons - 1
    relative = polygons < 0
    if relative.any():
        before = np.array([lines.points_before.get(int(k), totals) for k in member])
        counted = polygons + before[:, None, :]
        result = np.where(relative, np.where(counted >= 0, counted, np.iinfo(np.int64).max), result)
    return result


def _check_corners(path: Path, polygons: IndexArray, count: int, texts: list[str]) -> None:
    """Refuse faces that name missing points: what is left of such a file is not to be trusted."""
    wild = ((polygons[..., 0] < 0) | (polygons[..., 0] >= count)).any(axis=1)
    if wild.any():
        raise InputError(
            f"{path}: expected faces to name vertices 1 to {count}, found "
            f"'f {texts[int(wild.argmax())]}' ({wild.sum()} such faces); export it again"
        )


def _read_materials(path: Path, lines: _Statements, notes: list[str]) -> list[ObjMaterial]:
    """One per name used, from the file's libraries, or plain where they do not know it."""
    known: dict[str, ObjMaterial] = {}
    for reference in lines.libraries:
        found = find_beside(path, reference)
        if found is not None:
            known.update(read_mtl(found, path, notes))
        elif len(reference.split()) > 1:  # several names in one line
            for name in reference.split():
                if (found := find_beside(path, name)) is not None:
                    known.update(read_mtl(found, path, notes))
        if found is None:
            notes.append(f"material library {reference} is missing; plain colours instead")
    unknown = [name for name in lines.materials if name and name not in known]
    if unknown:
        notes.append(f"no material description for {', '.join(unknown)}; plain colours instead")
    return [
        known.get(name) or ObjMaterial(Material(name or "default", double_sided=True))
        for name in lines.materials
    ]


def _part(
    corners: IndexArray,
    points: FloatArray,
    uvs: FloatArray,
    normals: FloatArray,
    colors: FloatArray | None,
    index: int,
    material: ObjMaterial,
    group: IndexArray,
    groups: list[str],
    notes: list[str],
) -> Part:
    """The triangles of one material, their corners merged into vertices where all indices agree."""
    flat = corners.reshape(-1, 3)
    sizes = np.array([len(points), len(uvs), len(normals)], dtype=np.int64) + 1
    key = ((flat[:, 0] + 1) * sizes[1] + flat[:, 1] + 1) * sizes[2] + flat[:, 2] + 1
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    point, uv, normal = flat[first].T

    def taken(table: FloatArray, at: IndexArray) -> FloatArray:
        return np.where((at >= 0)[:, None], table[np.maximum(at, 0)], 0.0)

    laid = None
    if len(uvs):
        with np.errstate(invalid="ignore", over="ignore"):  # infinite ones are set to 0 later
            laid = taken(uvs, uv)[:, :2] * material.uv_scale + material.uv_offset
    tint = None
    if colors is not None:
        textured = material.material.color_texture is not None
        tint = settle_colors(colors[point], textured, material.material.name, notes)
    return Part(
        positions=points[point],
        faces=inverse.reshape(-1, 3),
        material=index,
        name=" ".join(groups[k] for k in np.unique(group)[:4]),
        normals=taken(normals, normal) if len(normals) else None,
        without_normal=normal < 0,
        uvs=None if laid is None else laid * [1, -1] + [0, 1],
        colors=tint,
        point=point,
        branch=group,
    )


def _declared(groups: list[str]) -> Declared | None:
    """Branches where groups are named one per branch: by level and number, or by their path."""
    matches = [BRANCH_NAME.search(name) for name in groups]
    if sum(match is not None for match in matches) >= 3:
        level = [int(match[1]) if match else -1 for match in matches]
        return Declared("groups", level=np.array(level))
    index = {name: k for k, name in enumerate(groups)}
    paths = [PATH_NAME.match(name) for name in groups]
    parent = [index.get(match[1], -1) if match else -1 for match in paths]
    if sum(k >= 0 for k in parent) >= 2:
        return Declared("groups", parent=np.array(parent))
    return None
