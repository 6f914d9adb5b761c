"""glTF 2.0 (.glb, .gltf): scene, meshes, skins and instances as parts in world space.

Sources: glTF 2.0 specification, 3.7 (meshes and skins); extensions KHR_mesh_quantization,
KHR_draco_mesh_compression, EXT_mesh_gpu_instancing. Nodes: gltf_nodes.py; materials and textures:
gltf_material.py; bytes: gltf_data.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import CapabilityError, InputError
from vegtool.formats.clean import bounds, usable_rows
from vegtool.formats.gltf_data import GltfFile, meshopt_missing, open_gltf
from vegtool.formats.gltf_material import UvSource, read_materials
from vegtool.formats.gltf_nodes import Node, scene_nodes
from vegtool.formats.parts import Declared, IndexArray, Parsed, Part, check_face_count
from vegtool.formats.vertex_colors import settle_colors, texture_spread

UNDERSTOOD = {
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_draco_mesh_compression",
    "KHR_texture_basisu",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "EXT_mesh_gpu_instancing",
    "KHR_materials_unlit",
    "KHR_materials_diffuse_transmission",
}
HARMLESS = {
    "MSFT_lod",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "KHR_xmp_json_ld",
    "KHR_techniques_webgl",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_structural_metadata",
}
"""Extensions that a file may require although a plant's shape and colours do without them."""

TRIANGLES, STRIP, FAN = 4, 5, 6
OVERFLOW = 2**16
"""Vertices that 16-bit indices can reach."""
FLOAT32_STEP = 2.0**-23
BEYOND = 0.01
"""Of a texture's side: as far as its coordinates may leave it without another texel to see."""
COARSE = 1e-3
"""Fraction of a mesh's extent: coordinates rounded to coarser steps are worth a warning."""


@dataclass(frozen=True, eq=False)
class _Primitive:
    """A primitive in its mesh's own space. joints, weights: (v, 4k) or None.

    tags: (v,) values of its _BRANCH* attributes by name.
    """

    part: Part
    joints: IndexArray | None
    weights: FloatArray | None
    tags: dict[str, IndexArray]


def parse(path: Path) -> Parsed:
    """Read a glTF file.

    Raises InputError where it is broken, CapabilityError where it cannot be decoded here.
    """
    file = open_gltf(path)
    try:
        return _parse(file)
    except (AttributeError, TypeError, KeyError, IndexError, ValueError, AssertionError) as error:
        # JSON that is not shaped as glTF: a list where an object belongs, a name for a number
        raise InputError(
            f"{path}: expected JSON as glTF 2.0 describes it, found a part that is not "
            f"({type(error).__name__}: {error}); export it again"
        ) from error


def _parse(file: GltfFile) -> Parsed:
    _check_extensions(file)
    notes: list[str] = []
    materials = read_materials(file, notes)
    uv_sources = [material.uvs for material in materials]
    textured = [material.material.color_texture is not None for material in materials]
    nodes = scene_nodes(file, notes)
    meshes: dict[int, list[_Primitive]] = {}
    parts: list[Part] = []
    tags: list[dict[str, IndexArray]] = []
    count = 0
    for node in nodes.values():
        if node.mesh is None:
            continue
        if node.mesh not in meshes:
            meshes[node.mesh] = _read_mesh(file, node.mesh, uv_sources, textured, notes)
        for primitive in meshes[node.mesh]:
            copies = 1 if node.instances is None else len(node.instances)
            count += copies * len(primitive.part.faces)
            check_face_count(file.path, count)
            parts.append(_place(file, nodes, node, primitive))
            tags.append(primitive.tags)
    drawn = [node.mesh for node in nodes.values() if node.mesh is not None]
    once = len(drawn) == len(set(drawn)) and all(n.instances is None for n in nodes.values())
    declared, parts = _declared(file, nodes, parts, tags, once)
    if file.json.get("animations"):
        notes.append("animations are left out; the plant is drawn at rest")
    return Parsed(
        name=file.path.stem,
        parts=parts,
        materials=[material.material for material in materials],
        up="y",
        declared=declared,
        notes=list(dict.fromkeys(notes)),
    )


def _check_extensions(file: GltfFile) -> None:
    """Refuse what cannot be decoded before anything else is read."""
    for name in file.json.get("extensionsRequired", []):
        if name in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
            raise meshopt_missing(file.path, name)
        if name not in UNDERSTOOD | HARMLESS and not name.startswith("KHR_materials_"):
            raise CapabilityError(
                f"{file.path}: it requires the glTF extension {name}, which vegtool does not know; "
                "export it without"
            )


def _read_mesh(
    file: GltfFile, index: int, uv_sources: list[UvSource], textured: list[bool], notes: list[str]
) -> list[_Primitive]:
    mesh = file.entry("meshes", index)
    name = str(mesh.get("name", ""))
    if any("targets" in primitive for primitive in mesh["primitives"]):
        notes.append("morph targets are left out; meshes are drawn in their base shape")
    found = []
    for primitive in mesh["primitives"]:
        mode = primitive.get("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP, FAN):
            notes.append("points and lines are left out")
            continue
        material = primitive.get("material", len(uv_sources) - 1)
        if not isinstance(material, int) or not 0 <= material < len(uv_sources):
            raise file.broken(f"a material below {len(uv_sources) - 1}", repr(material))
        found.append(
            _read_primitive(
                file, primitive, mode, name, material, uv_sources[material], textured, notes
            )
        )
    return found


def _read_primitive(
    file: GltfFile,
    primitive: dict[str, Any],
    mode: int,
    name: str,
    material: int,
    uv_source: UvSource,
    textured: list[bool],
    notes: list[str],
) -> _Primitive:
    attributes, indices = _attributes(file, primitive)
    if "POSITION" not in attributes:
        raise file.broken(f"positions in mesh {name!r}", "none")
    positions = attributes["POSITION"]
    count = len(positions)
    for key, values in attributes.items():
        if len(values) != count:
            raise file.broken(f"{count} values of {key} in mesh {name!r}", str(len(values)))
    if indices is None:
        indices = np.arange(count)
    if len(indices) and int(indices.max()) >= count:
        raise file.broken(
            f"indices below {count} in mesh {name!r} (accessors[{primitive.get('indices')}])",
            str(int(indices.max())),
        )
    _check_overflow(file, primitive, indices, count, name)
    uvs = _uvs(attributes.get(f"TEXCOORD_{uv_source.set}"), uv_source)
    if uvs is not None and not uv_source.repeats and (np.abs(uvs - 0.5) > 0.5 + BEYOND).any():
        notes.append(
            f"mesh {name}: its texture is to be clamped or mirrored beyond its edges; it repeats"
        )
    faces = _triangles(indices.astype(np.int64), mode)
    colors = attributes.get("COLOR_0")
    if colors is not None:
        tints = textured[material] and (uvs is None or texture_spread(uvs, faces))
        colors = settle_colors(colors, tints, f"mesh {name}", notes)
    _warn_of_rounding(positions, name, notes)
    part = Part(
        positions=_floats(positions),
        faces=faces,
        material=material,
        name=name,
        normals=_floats(attributes["NORMAL"]) if "NORMAL" in attributes else None,
        uvs=uvs,
        colors=colors,
    )
    return _Primitive(
        part,
        _joined(attributes, "JOINTS"),
        _joined(attributes, "WEIGHTS"),
        {
            key.upper(): _identities(values)
            for key, values in attributes.items()
            if key.upper().startswith("_BRANCH") and values.shape[1] == 1
        },
    )


def _attributes(
    file: GltfFile, primitive: dict[str, Any]
) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """The primitive's attributes by name, and its indices or None."""
    if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
        from vegtool.formats.gltf_draco import decode_draco

        return decode_draco(file, primitive)
    attributes = {key: file.accessor(index) for key, index in primitive["attributes"].items()}
    if "indices" not in primitive:
        return attributes, None
    indices = file.accessor(primitive["indices"])
    if indices.dtype.kind != "u" or indices.shape[1] != 1:
        raise file.broken("indices as unsigned integers", f"{indices.dtype} x {indices.shape[1]}")
    return attributes, indices[:, 0]


def _check_overflow(
    file: GltfFile, primitive: dict[str, Any], indices: np.ndarray, count: int, name: str
) -> None:
    """Refuse 16-bit indices into a vertex array of this mesh alone that is too long for them."""
    if indices.dtype.itemsize != 2 or count <= OVERFLOW:
        return
    position = primitive["attributes"]["POSITION"]
    users = sum(
        other.get("attributes", {}).get("POSITION") == position
        for mesh in file.json["meshes"]
        for other in mesh["primitives"]
    )
    if users == 1:
        raise file.broken(
            f"indices that reach all {count} vertices of mesh {name!r}",
            "16-bit ones, which overflowed at 65536 and tie triangles across the whole plant",
        )


def _warn_of_rounding(positions: np.ndarray, name: str, notes: list[str]) -> None:
    """Note where 32-bit coordinates lie so far from 0 that a plant's detail is rounded away."""
    if positions.dtype != np.float32 or not len(positions):
        return
    low, high = bounds(positions)
    if not usable_rows(_floats(np.array([low, high]))).all():
        return  # broken vertices are another matter
    step = float(np.abs([low, high]).max()) * FLOAT32_STEP
    if step > COARSE * float((high - low).max()):
        notes.append(
            f"mesh {name}: its coordinates are so large that the file rounds them to steps of "
            f"{step:.2g}; export it near its own origin and place it by its node"
        )


def _triangles(indices: IndexArray, mode: int) -> IndexArray:
    """(f, 3) triangles of a list, strip or fan; left-over indices are ignored, as glTF asks."""
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    count = max(len(indices) - 2, 0)
    step = np.arange(count)
    if mode == FAN:
        order = np.stack([step + 1, step + 2, np.zeros_like(step)], axis=1)
    else:
        odd = step % 2
        order = np.stack([step, step + 1 + odd, step + 2 - odd], axis=1)
    return np.asarray(indices[order])


def _floats(values: np.ndarray) -> FloatArray:
    with np.errstate(invalid="ignore"):  # signalling NaN
        return np.asarray(values, dtype=np.float64)


def _identities(values: np.ndarray) -> IndexArray:
    """(v,) whole numbers of a scalar attribute, -1 where it holds none."""
    numbers = np.nan_to_num(_floats(values)[:, 0], nan=-1, posinf=-1, neginf=-1)
    return np.round(numbers.clip(-1, 2**31)).astype(np.int64)


def _uvs(values: np.ndarray | None, source: UvSource) -> FloatArray | None:
    if values is None:
        return None
    uvs = _floats(values)
    if source.transform is not None:
        uvs = uvs @ source.transform[:, :2].T + source.transform[:, 2]
    return uvs


def _joined(attributes: dict[str, np.ndarray], kind: str) -> np.ndarray | None:
    """JOINTS_0, JOINTS_1, ... side by side."""
    sets = [attributes[f"{kind}_{k}"] for k in range(8) if f"{kind}_{k}" in attributes]
    return np.concatenate(sets, axis=1) if sets else None


def _place(file: GltfFile, nodes: dict[int, Node], node: Node, primitive: _Primitive) -> Part:
    """The primitive in world space, once per instance; its branch is its node or its joint."""
    part = replace(primitive.part, name=f"{node.name} {primitive.part.name}".strip())
    if node.skin is not None and primitive.joints is not None and primitive.weights is not None:
        return _skinned(file, nodes, node, part, primitive.joints, primitive.weights)
    instances = np.eye(4)[None] if node.instances is None else node.instances
    return replace(_copied(part, node.world @ instances), branch=node.index)


def _copied(part: Part, matrices: FloatArray) -> Part:
    """The part under each of (n, 4, 4) affine transforms. A mirror turns its triangles round."""
    if np.array_equal(matrices, np.eye(4)[None]):
        return part
    linear = matrices[:, :3, :3]
    sign = np.where(np.linalg.det(linear) < 0, -1, 1)
    cofactors = np.cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]]) * sign[:, None, None]
    # of quantised files the scale is tiny, and its square no length that a normal may have
    largest = np.abs(cofactors).max(axis=(1, 2), keepdims=True)
    cofactors = np.divide(cofactors, largest, out=cofactors, where=largest > 0)
    with np.errstate(invalid="ignore", over="ignore"):  # broken coordinates, dropped later
        positions = np.einsum("nij,vj->nvi", linear, part.positions) + matrices[:, None, :3, 3]
        normals = None
        if part.normals is not None:
            normals = np.einsum("nij,vj->nvi", cofactors, part.normals).reshape(-1, 3)
    faces = np.where(sign[:, None, None] < 0, part.faces[:, ::-1], part.faces)
    first = len(part.positions) * np.arange(len(matrices))[:, None, None]
    copies = (len(matrices), 1)
    return replace(
        part,
        positions=positions.reshape(-1, 3),
        normals=normals,
        uvs=None if part.uvs is None else np.tile(part.uvs, copies),
        colors=None if part.colors is None else np.tile(part.colors, copies),
        faces=(faces + first).reshape(-1, 3),
    )


def _skinned(
    file: GltfFile,
    nodes: dict[int, Node],
    node: Node,
    part: Part,
    joints: IndexArray,
    weights: FloatArray,
) -> Part:
    """The part in the pose in which the file's joints stand; the node's own place is ignored.

    Branch: the joint that pulls most at each face, as its node.
    """
    skin = file.entry("skins", node.skin)
    joint_nodes = skin["joints"]
    inverse = np.broadcast_to(np.eye(4), (len(joint_nodes), 4, 4))
    if "inverseBindMatrices" in skin:
        stored = file.accessor(skin["inverseBindMatrices"]).astype(np.float64)
        inverse = stored.reshape(-1, 4, 4).transpose(0, 2, 1)
    if len(inverse) < len(joint_nodes) or int(joints.max(initial=0)) >= len(joint_nodes):
        raise file.broken(f"joints below {len(joint_nodes)}", str(int(joints.max(initial=0))))
    missing = [joint for joint in joint_nodes if joint not in nodes]
    if missing:
        raise file.broken("the skin's joints in the scene", f"node {missing[0]} outside it")
    pose = np.stack([nodes[j].world @ inverse[k] for k, j in enumerate(joint_nodes)])
    pull = weights.astype(np.float64)
    total = pull.sum(axis=1, keepdims=True)
    pull = np.divide(pull, total, out=np.zeros_like(pull), where=total > 0)
    pull[total[:, 0] <= 0, 0] = 1.0
    blend = np.einsum("vk,vkij->vij", pull, pose[joints])
    positions = np.einsum("vij,vj->vi", blend[:, :3, :3], part.positions) + blend[:, :3, 3]
    normals = part.normals
    if normals is not None:
        normals = np.einsum("vij,vj->vi", blend[:, :3, :3], normals)
    strongest = joints[np.arange(len(joints)), pull.argmax(axis=1)].astype(np.int64)
    mirrored = np.linalg.det(blend[:, :3, :3].mean(axis=0)) < 0 if len(blend) else False
    return replace(
        part,
        positions=positions,
        normals=normals,
        faces=part.faces[:, ::-1] if mirrored else part.faces,
        branch=np.asarray(joint_nodes)[_majority(strongest[part.faces])],
    )


def _majority(corners: IndexArray) -> IndexArray:
    """(f,) of (f, 3): the value that two corners share, else the middle one."""
    return np.asarray(np.sort(corners, axis=1)[:, 1])


def _declared(
    file: GltfFile,
    nodes: dict[int, Node],
    parts: list[Part],
    tags: list[dict[str, IndexArray]],
    placed_once: bool,
) -> tuple[Declared | None, list[Part]]:
    """What the file says of branches: an attribute, else its skeleton, else its node tree."""
    names = {name for tag in tags for name in tag}
    identity = next((n for n in ("_BRANCH", "_BRANCH_ID") if n in names), None)
    if identity and placed_once:
        return _declared_by_attribute(parts, tags, identity)
    joints = {j for skin in file.json.get("skins", []) for j in skin["joints"] if j in nodes}
    skinned = any(isinstance(part.branch, np.ndarray) for part in parts)
    if skinned:
        members = sorted(joints)
    else:
        members = sorted(nodes)
    index = {member: k for k, member in enumerate(members)}
    parent = np.full(len(members), -1, dtype=np.int64)
    for member, k in index.items():
        above = nodes[member].parent
        while above >= 0 and above not in index:
            above = nodes[above].parent
        parent[k] = index.get(above, -1)
    lookup = np.full(max(nodes, default=-1) + 1, -1, dtype=np.int64)
    lookup[members] = np.arange(len(members))
    parts = [replace(part, branch=lookup[part.branch]) for part in parts]
    return Declared("skeleton" if skinned else "nodes", parent=parent), parts


def _declared_by_attribute(
    parts: list[Part], tags: list[dict[str, IndexArray]], identity: str
) -> tuple[Declared | None, list[Part]]:
    """Branches by the vertex attribute `identity`, with _BRANCH_LEVEL and _BRANCH_PARENT if any."""
    ids = np.unique(np.concatenate([tag[identity] for tag in tags if identity in tag]))
    ids = ids[ids >= 0]
    named = [
        replace(part, branch=_majority(_index_of(tag[identity], ids)[part.faces]))
        if identity in tag
        else replace(part, branch=-1)
        for part, tag in zip(parts, tags, strict=True)
    ]

    def per_branch(name: str) -> IndexArray | None:
        values = np.full(len(ids), -1, dtype=np.int64)
        for tag in tags:
            if identity in tag and name in tag:
                branch = _index_of(tag[identity], ids)
                values[branch[branch >= 0]] = tag[name][branch >= 0]
        return values if any(name in tag for tag in tags) else None

    parent = per_branch("_BRANCH_PARENT")
    if parent is not None:
        parent = _index_of(parent, ids)
    return Declared("attribute", parent=parent, level=per_branch("_BRANCH_LEVEL")), named


def _index_of(values: IndexArray, ids: IndexArray) -> IndexArray:
    """Positions of values in sorted ids, -1 where absent."""
    if not len(ids):
        return np.full(values.shape, -1, dtype=np.int64)
    at = np.searchsorted(ids, values).clip(0, len(ids) - 1)
    return np.where(ids[at] == values, at, -1)
