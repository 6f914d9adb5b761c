"""The node tree of a glTF scene: where each mesh stands, in double precision.

Sources: glTF 2.0 specification, 3.5 (scenes) and 3.7.3 (skins); EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.formats.clean import LARGEST
from vegtool.formats.gltf_data import GltfFile

MAX_PLACEMENTS = 1_000_000
"""Meshes drawn by all nodes and instances together."""
LOD_NAME = re.compile(r"^(.*?)[_\-. ]?LOD[_\-. ]?(\d+)$", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Node:
    """A node of the scene: its world matrix (4, 4), its parent's index or -1."""

    index: int
    name: str
    parent: int
    world: FloatArray
    mesh: int | None
    skin: int | None
    instances: FloatArray | None


def scene_nodes(file: GltfFile, notes: list[str]) -> dict[int, Node]:
    """The nodes of the file's scene by index, parents before children.

    Raises InputError where nodes form a cycle, hang on two parents, or place absurdly many meshes.
    """
    found: dict[int, Node] = {}
    waiting = [(index, -1, np.eye(4)) for index in reversed(_roots(file, notes))]
    placed = 0
    while waiting:
        index, parent, above = waiting.pop()
        entry = file.entry("nodes", index)
        if index in found:
            raise file.broken("every node to have one parent", f"node {index} reached twice")
        name = str(entry.get("name", ""))
        instances = _instances(file, entry)
        mesh = entry.get("mesh")
        found[index] = node = Node(
            index, name, parent, above @ _local(file, entry), mesh, entry.get("skin"), instances
        )
        placed += 0 if mesh is None else 1 if instances is None else len(instances)
        if placed > MAX_PLACEMENTS:
            raise file.broken(f"at most {MAX_PLACEMENTS} placed meshes", f"{placed}")
        children = entry.get("children", [])
        waiting.extend((child, index, node.world) for child in reversed(children))
    return _without_lower_lods(found, notes)


def _roots(file: GltfFile, notes: list[str]) -> list[int]:
    scenes = file.json.get("scenes", [])
    if scenes:
        chosen = file.json.get("scene", 0)
        if len(scenes) > 1:
            notes.append(
                f"read scene {chosen} of {len(scenes)}, the file's default; not the others"
            )
        roots: list[int] = list(file.entry("scenes", chosen).get("nodes", []))
        return roots
    nodes = file.json.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    return [index for index in range(len(nodes)) if index not in children]


def _without_lower_lods(nodes: dict[int, Node], notes: list[str]) -> dict[int, Node]:
    """Without the coarser levels of detail that a file draws on top of its LOD0."""
    names = {index: LOD_NAME.match(node.name) for index, node in nodes.items()}
    finest = {m[1] for m in names.values() if m and int(m[2]) == 0}
    dropped: set[int] = set()
    for index, node in nodes.items():  # parents come first
        match = names[index]
        if node.parent in dropped or (match and int(match[2]) > 0 and match[1] in finest):
            dropped.add(index)
    if dropped:
        notes.append(f"left out {len(dropped)} nodes named as coarser levels of detail (LOD1, ...)")
    return {index: node for index, node in nodes.items() if index not in dropped}


def _local(file: GltfFile, entry: dict[str, Any]) -> FloatArray:
    """(4, 4): a node's own transform."""
    if "matrix" in entry:
        return _numbers(file, entry["matrix"], 16).reshape(4, 4).T
    matrix = np.eye(4)
    rotation = rotations(_numbers(file, entry.get("rotation", [0, 0, 0, 1]), 4)[None])[0]
    matrix[:3, :3] = rotation * _numbers(file, entry.get("scale", [1, 1, 1]), 3)
    matrix[:3, 3] = _numbers(file, entry.get("translation", [0, 0, 0]), 3)
    return matrix


def _instances(file: GltfFile, entry: dict[str, Any]) -> FloatArray | None:
    """(n, 4, 4): transforms of EXT_mesh_gpu_instancing within the node, or None."""
    extension = entry.get("extensions", {}).get("EXT_mesh_gpu_instancing")
    if extension is None:
        return None
    attributes = extension.get("attributes", {})
    stored = {
        name: np.asarray(file.accessor(attributes[name]), dtype=np.float64)
        for name in ("TRANSLATION", "ROTATION", "SCALE")
        if name in attributes
    }
    counts = {len(values) for values in stored.values()}
    if len(counts) != 1:
        raise file.broken("instance attributes of one length", str(sorted(counts)))
    count = counts.pop()
    matrices = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    if "ROTATION" in stored:
        matrices[:, :3, :3] = rotations(stored["ROTATION"])
    if "SCALE" in stored:
        matrices[:, :3, :3] *= stored["SCALE"][:, None, :]
    if "TRANSLATION" in stored:
        matrices[:, :3, 3] = stored["TRANSLATION"]
    return matrices


def rotations(quaternions: FloatArray) -> FloatArray:
    """(n, 3, 3) rotation matrices of (n, 4) quaternions x, y, z, w of any length; zero turns
    nothing."""
    finite = np.nan_to_num(quaternions, posinf=0.0, neginf=0.0)
    turning = finite.any(axis=1, keepdims=True)
    q = unit(np.where(turning, finite, np.array([0.0, 0, 0, 1])))
    x, y, z, w = q.T
    return np.asarray(
        np.stack(
            [
                np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], 1),
                np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], 1),
                np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], 1),
            ],
            axis=1,
        )
    )


def _numbers(file: GltfFile, values: Any, count: int) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != (count,) or not (np.abs(np.nan_to_num(array, nan=np.inf)) < LARGEST).all():
        raise file.broken(f"{count} finite numbers in a node's transform", f"{values!r}"[:60])
    return array
