"""Writing glTF 2.0: a plant, one level, or a whole chain of levels as .glb files.

Sources: glTF 2.0 specification; KHR_materials_unlit, KHR_materials_diffuse_transmission, MSFT_lod
(extensions, Khronos glTF repository). A client that knows none of them still draws the file.

A file holds positions as float32, so a plant far from its origin (map coordinates) would lose
what its leaves are made of. Its vertices are then written relative to the plant's centre, and the
node's translation carries the offset.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.formats import png
from vegtool.formats.atomic import FileSet
from vegtool.formats.glb import ELEMENT_ARRAY_BUFFER, Document
from vegtool.formats.gltf_material import TRANSMISSION, UNLIT
from vegtool.formats.gltf_surfels import add_surfels
from vegtool.formats.manifest import LevelFile, encode, manifest, screen_height_fraction
from vegtool.formats.ramp import RAMP, on_ramp
from vegtool.lod import Level, LodChain, level_triangles
from vegtool.plant import Branches, Material, Plant, Texture
from vegtool.tangents import tangents

ALPHA_CUTOFF = 0.5  # of a billboard: what baking/coverage.py fits its alpha to
ROUGHNESS = 0.9  # of a billboard: foliage seen from afar has no highlight of its own
FAR_FROM_ORIGIN = 16.0  # plant radii: float32 rounds by 2^-24 of it, a millionth of a radius


_SHORT_INDICES = 65535  # vertices; index 65535 itself is reserved for primitive restart
_LINEAR, _LINEAR_MIPMAP_LINEAR = 9729, 9987
_REPEAT, _CLAMP_TO_EDGE = 10497, 33071

EncodedImages = dict[int, tuple[bytes, str]]
"""File bytes and MIME type of images already encoded, by the id of their texture or pixels."""


def plant_glb(plant: Plant) -> bytes:
    """A plant as a .glb file: one node, one mesh, one primitive per material that has faces.

    Where the plant knows its branches, vertices carry the attributes _BRANCH and _BRANCH_PARENT
    (indices of branches, -1 for no parent), which vegtool reads back. Where it knows its exposure,
    TEXCOORD_1 lays that on a RAMP, whose red is the materials' occlusion.
    """
    writer = _Writer(_local_origin(plant.bounds), {})
    writer.document.show(writer.add_plant(plant, plant.name, plant.branches))
    return writer.document.glb()


def plant_document(
    plant: Plant,
    name: str,
    origin: FloatArray | None = None,
    beside: Mapping[int, str] | None = None,
) -> Document:
    """A plant as the objects of a .glb file whose node is called `name`, without its branches.

    origin: (3,) metres, which vertices are relative to; None where the file is to choose. beside:
    URIs of pictures that are files of their own, by the id of their texture or pixels.
    """
    writer = _Writer(_local_origin(plant.bounds) if origin is None else origin, {}, beside)
    writer.document.show(writer.add_plant(plant, name))
    return writer.document


def level_glb(
    level: Level, name: str, images: EncodedImages | None = None, quantized: bool = False
) -> bytes:
    """One level as a .glb file whose node is called `name`.

    Billboards are one mesh with one primitive and one material, alpha-tested; the mesh of a hybrid
    level is in the same primitive, coloured by COLOR_0. Surfels are points (gltf_surfels.py), in
    fewer bits where `quantized`. `images` carries encoded images from one call to the next for the
    same chain.
    """
    origin = _local_origin(_bounds(level))
    writer = _Writer(origin, {} if images is None else images, quantized=quantized)
    writer.document.show(writer.add_level(level, name))
    return writer.document.glb()


def chain_glb(
    chain: LodChain, images: EncodedImages | None = None, quantized: bool = False
) -> bytes:
    """All levels as one .glb file, tied together by MSFT_lod.

    The scene holds the finest level alone, so a client that does not know the extension shows
    that one. `extras.MSFT_screencoverage` holds for each level the least share of the image's
    height at which it is drawn (the metric that Unity's importer expects).
    """
    bounds = [_bounds(level) for level in chain.levels]
    origin = _local_origin(np.stack([np.min(bounds, (0, 1)), np.max(bounds, (0, 1))]))
    writer = _Writer(origin, {} if images is None else images, quantized=quantized)
    names = [level_name(chain, index) for index in range(len(chain.levels))]
    nodes = [writer.add_level(*pair) for pair in zip(chain.levels, names, strict=True)]
    if len(nodes) > 1:
        writer.document.use_extension("MSFT_lod")
        writer.document.change(
            "nodes",
            nodes[0],
            extensions={"MSFT_lod": {"ids": nodes[1:]}},
            extras={"MSFT_screencoverage": screen_coverage(chain)},
        )
    writer.document.show(nodes[0])
    return writer.document.glb()


def write_chain(
    chain: LodChain,
    folder: Path,
    force: bool = False,
    depth: bool = False,
    extra: Mapping[str, bytes] | None = None,
    inputs: Iterable[Path] = (),
    packed: bool = False,
    quantized: bool = False,
) -> list[Path]:
    """Write NAME_LOD1.glb, ..., NAME.glb (all levels), NAME_shadow.glb where the chain has one,
    NAME.lod.json and `extra`: all or none.

    depth: also NAME_LOD1_depth.png, ...: 16 bit grey, as Atlas.depth.
    extra: bytes of further files by name, which appear with the others.
    inputs: files that the chain was made from; nothing in their folders is overwritten.
    packed: also NAME_LOD1_leaf.png, ..., of levels with Atlas.light: RGBA, as that.
    quantized: surfels in fewer bits.
    Returns the paths of the files. Raises OutputError as FileSet does.
    """
    images: EncodedImages = {}
    with FileSet(folder, force, inputs) as files:
        levels: list[LevelFile] = []
        for index, level in enumerate(chain.levels[1:], start=1):
            name = level_name(chain, index)
            data = level_glb(level, name, images, quantized)
            files.add(f"{name}.glb", data)
            depth_name = leaf_name = None
            if depth and level.atlas is not None:
                depth_name = f"{name}_depth.png"
                files.add(depth_name, png.encode(level.atlas.depth))
            if packed and level.atlas is not None and level.atlas.light is not None:
                leaf_name = f"{name}_leaf.png"
                files.add(leaf_name, png.encode(level.atlas.light))
            levels.append(LevelFile(f"{name}.glb", len(data), depth_name, leaf_name))
        data = chain_glb(chain, images, quantized)
        combined = LevelFile(f"{chain.name}.glb", len(data))
        files.add(combined.name, data)
        shadow = None
        if chain.shadow is not None:
            name = f"{chain.name}_shadow"
            data = level_glb(chain.shadow.level, name, images)
            shadow = LevelFile(f"{name}.glb", len(data))
            files.add(shadow.name, data)
        for name, data in (extra or {}).items():
            files.add(name, data)
        text = encode(manifest(chain, [combined, *levels], shadow))
        files.add(f"{chain.name}.lod.json", text)
        return files.paths


def file_names(
    name: str, levels: int, depth: bool = False, packed: bool = False, shadow: bool = False
) -> list[str]:
    """The files that `write_chain` may write for a chain of that many levels, the original counted.

    Images beside them (depth, packed) are written of the levels that have them.
    """
    lower = [f"{name}_LOD{index}" for index in range(1, levels)]
    endings = [".glb", *(["_depth.png"] if depth else []), *(["_leaf.png"] if packed else [])]
    beside = [f"{each}{ending}" for ending in endings for each in lower]
    caster = [f"{name}_shadow.glb"] if shadow else []
    return [*beside, *caster, f"{name}.glb", f"{name}.lod.json"]


def level_name(chain: LodChain, index: int) -> str:
    """NAME_LOD0, NAME_LOD1, ...: of a level's node and, with .glb, of its file."""
    return f"{chain.name}_LOD{index}"


def screen_coverage(chain: LodChain) -> list[float]:
    """For each level the least share of the image's height that the plant has while it is drawn.

    Strictly decreasing, at most 1. A level gives way where the next one may be used; the last is
    drawn until the plant is one pixel high.
    """
    shares = [screen_height_fraction(chain, level.near_distance_m) for level in chain.levels[1:]]
    coverage: list[float] = []
    limit = 1.0
    for share in [*shares, 1.0 / chain.display.image_height_px]:
        coverage.append(min(share, limit))
        limit = 0.99 * coverage[-1]
    return coverage


class _Writer:
    """Puts levels into one document, relative to one origin; each image goes in once."""

    def __init__(
        self, origin: FloatArray, images: EncodedImages, beside: Mapping[int, str] | None = None,
        *, quantized: bool = False,
    ) -> None:  # fmt: skip
        self.document = Document()
        self._quantized = quantized
        self._origin = origin
        self._images = images
        self._beside = beside or {}
        self._textures: dict[int, int] = {}
        self._samplers: dict[int, int] = {}

    def add_level(self, level: Level, name: str) -> int:
        """Add a level of any kind; return its node."""
        if level.kind == "mesh":
            assert level.mesh is not None
            return self.add_plant(level.mesh, name)
        if level.surfels is not None:
            return add_surfels(self.document, level.surfels, name, self._origin, self._quantized)
        return self.add_atlas_level(level, name)

    def add_plant(self, plant: Plant, name: str, branches: Branches | None = None) -> int:
        """Add a plant, with the branch of each vertex if `branches` are given; return its node."""
        used = np.unique(plant.face_material).tolist()
        return self._add_node(name, [self._add_part(plant, index, branches) for index in used])

    def add_atlas_level(self, level: Level, name: str) -> int:
        """Add a level of billboards, with or without a mesh beside them; return its node."""
        drawn = level_triangles(level)
        assert level.atlas is not None
        attributes = {
            "POSITION": self._add_positions(drawn.positions),
            "NORMAL": self._add_floats(_unit_normals(drawn.normals)),
        }
        if level.atlas.normal is not None:
            attributes["TANGENT"] = self._add_floats(drawn.tangents)
        attributes["TEXCOORD_0"] = self._add_floats(drawn.uvs)
        if drawn.colors is not None:
            attributes["COLOR_0"] = self._add_shares(drawn.colors)
        primitive = {
            "attributes": attributes,
            "indices": self._add_indices(drawn.indices, len(drawn.positions)),
            "material": self._add_atlas_material(level, name),
        }
        return self._add_node(name, [primitive])

    def _add_node(self, name: str, primitives: list[dict[str, Any]]) -> int:
        mesh = self.document.add("meshes", name=name, primitives=primitives)
        moved = {"translation": self._origin.tolist()} if self._origin.any() else {}
        return self.document.add("nodes", name=name, mesh=mesh, **moved)

    def _add_part(self, plant: Plant, index: int, branches: Branches | None) -> dict[str, Any]:
        """The faces of one material as a primitive with vertices of its own."""
        material, chosen = plant.materials[index], plant.face_material == index
        faces = plant.faces[chosen]
        if branches is None:
            vertices, faces = _compact(faces, len(plant.positions))
            owner = None
        else:
            vertices, faces, owner = _split_by_group(faces, branches.face_branch[chosen])
        frames = None
        if material.normal_texture is not None:
            frames, origin, faces = tangents(
                plant.positions[vertices],
                _unit_normals(plant.normals[vertices]),
                plant.uvs[vertices],
                faces,
            )
            vertices, owner = vertices[origin], None if owner is None else owner[origin]
        attributes = {
            "POSITION": self._add_positions(plant.positions[vertices]),
            "NORMAL": self._add_floats(_unit_normals(plant.normals[vertices])),
        }
        if frames is not None:
            attributes["TANGENT"] = self._add_floats(frames)
        exposure = None if material.unlit else plant.exposure
        textured = material.color_texture is not None or material.normal_texture is not None
        if textured or exposure is not None or plant.uvs.any():
            attributes["TEXCOORD_0"] = self._add_floats(plant.uvs[vertices])
        if exposure is not None:
            attributes["TEXCOORD_1"] = self._add_shares(on_ramp(exposure[vertices]))
        if plant.colors is not None:
            attributes["COLOR_0"] = self._add_shares(plant.colors[vertices])
        if branches is not None and owner is not None:
            attributes["_BRANCH"] = self._add_floats(owner)
            attributes["_BRANCH_PARENT"] = self._add_floats(branches.parent[owner])
        return {
            "attributes": attributes,
            "indices": self._add_indices(faces.ravel(), len(vertices)),
            "material": self._add_material(material, exposure is not None, _mean(plant, chosen)),
        }

    def _add_positions(self, positions: FloatArray) -> int:
        local = (positions - self._origin).astype(np.float32)
        return self.document.add_accessor(local, bounds=True)

    def _add_floats(self, values: FloatArray | IntArray) -> int:
        return self.document.add_accessor(values.astype(np.float32))

    def _add_shares(self, values: FloatArray) -> int:
        """Values of 0 to 1 in 16 bits: 8 would round the colour of dark bark by a tenth."""
        shorts = np.round(np.clip(values, 0.0, 1.0) * 65535).astype(np.uint16)
        return self.document.add_accessor(shorts, normalized=True)

    def _add_indices(self, indices: IntArray, vertices: int) -> int:
        dtype = np.uint16 if vertices <= _SHORT_INDICES else np.uint32
        return self.document.add_accessor(indices.astype(dtype), ELEMENT_ARRAY_BUFFER)

    def _add_material(self, material: Material, exposed: bool, mean: FloatArray) -> int:
        """exposed: whether TEXCOORD_1 lays the exposure of vertices on the RAMP. mean: (3,) of the
        vertices' colours, which light that passes through has for want of a texture: unlike the
        base colour, glTF does not multiply it by COLOR_0."""
        color = np.clip(material.base_color, 0.0, 1.0)
        surface: dict[str, Any] = {
            "baseColorFactor": color.tolist(),
            "metallicFactor": min(max(material.metallic, 0.0), 1.0),
            "roughnessFactor": min(max(material.roughness, 0.0), 1.0),
        }
        properties: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": surface}
        if material.color_texture is not None:
            surface["baseColorTexture"] = {"index": self._add_texture(material.color_texture)}
        if material.normal_texture is not None:
            index = self._add_texture(material.normal_texture)
            properties["normalTexture"] = {"index": index, "scale": material.normal_scale}
        if material.alpha_mode == "mask":
            properties |= {"alphaMode": "MASK", "alphaCutoff": material.alpha_cutoff}
        if exposed:
            ramp = self._add_pixels(RAMP, "exposure_ramp")
            properties["occlusionTexture"] = {"index": ramp, "texCoord": 1}
        if material.unlit:
            properties |= self._extension(UNLIT)
        elif material.transmission > 0:
            passed = material.base_color[:3] * material.transmission_tint
            if material.color_texture is None:
                passed = passed * mean
            through = _through(material.transmission, passed, surface.get("baseColorTexture"))
            properties |= self._extension(TRANSMISSION, through)
        return self.document.add("materials", **properties, doubleSided=material.double_sided)

    def _add_atlas_material(self, level: Level, name: str) -> int:
        atlas = level.atlas
        assert atlas is not None
        color = {"index": self._add_pixels(atlas.color, f"{name}_color")}
        properties: dict[str, Any] = {
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorTexture": color,
                "metallicFactor": 0.0,
                "roughnessFactor": ROUGHNESS,
            },
        }
        if atlas.normal is not None:
            index = self._add_pixels(atlas.normal, f"{name}_normal")
            properties["normalTexture"] = {"index": index}
        if level.unlit:
            properties |= self._extension(UNLIT)
        elif atlas.light is not None:
            light = {"index": self._add_pixels(atlas.light, f"{name}_light")}
            properties["occlusionTexture"] = light
            if atlas.light[..., 3].any():
                through = _through(1.0, atlas.transmission_tint, color)
                through["diffuseTransmissionTexture"] = light
                properties |= self._extension(TRANSMISSION, through)
        return self.document.add(
            "materials",
            **properties,
            alphaMode="MASK",
            alphaCutoff=ALPHA_CUTOFF,
            doubleSided=level.double_sided,
        )

    def _extension(self, name: str, values: dict[str, Any] | None = None) -> dict[str, Any]:
        """The property `extensions` of an object that uses one extension, now listed as used."""
        self.document.use_extension(name)
        return {"extensions": {name: values or {}}}

    def _add_texture(self, texture: Texture) -> int:
        if id(texture) not in self._images and id(texture) not in self._beside:
            self._images[id(texture)] = png.encode_texture(texture)
        return self._add_image(id(texture), texture.name, _REPEAT)

    def _add_pixels(self, pixels: npt.NDArray[np.uint8], name: str) -> int:
        if id(pixels) not in self._images and id(pixels) not in self._beside:
            self._images[id(pixels)] = (png.encode(pixels), "image/png")
        return self._add_image(id(pixels), name, _CLAMP_TO_EDGE)

    def _add_image(self, key: int, name: str, wrap: int) -> int:
        """A texture that shows the image `key`, encoded or beside the file; the same one for the
        same key."""
        if key not in self._textures:
            source = self.document.add("images", name=name, **self._image(key))
            sampler = self._add_sampler(wrap)
            self._textures[key] = self.document.add("textures", source=source, sampler=sampler)
        return self._textures[key]

    def _image(self, key: int) -> dict[str, Any]:
        """Where it is."""
        if key in self._beside:
            return {"uri": self._beside[key]}
        data, mime_type = self._images[key]
        return {"mimeType": mime_type, "bufferView": self.document.add_view(data)}

    def _add_sampler(self, wrap: int) -> int:
        if wrap not in self._samplers:
            self._samplers[wrap] = self.document.add(
                "samplers",
                magFilter=_LINEAR,
                minFilter=_LINEAR_MIPMAP_LINEAR,
                wrapS=wrap,
                wrapT=wrap,
            )
        return self._samplers[wrap]


def _bounds(level: Level) -> FloatArray:
    """(2, 3) metres: least and greatest corner of what the level draws."""
    if level.mesh is not None and level.kind == "mesh":
        return level.mesh.bounds
    if level.surfels is not None:
        return level.surfels.bounds
    positions = level_triangles(level).positions
    return np.stack([positions.min(axis=0), positions.max(axis=0)])


def _local_origin(bounds: FloatArray) -> FloatArray:
    """(3,) metres, exact in float32: zero, or the centre of bounds that lie far from zero."""
    radius = 0.5 * np.linalg.norm(bounds[1] - bounds[0])
    if np.abs(bounds).max() <= FAR_FROM_ORIGIN * radius:
        return np.zeros(3)
    return np.asarray(bounds.mean(axis=0).astype(np.float32).astype(np.float64))


def _compact(faces: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """The vertices of 0..count-1 that `faces` use, in order, and the faces renumbered to them."""
    used = np.zeros(count, dtype=bool)
    used[faces] = True
    renumbered = np.cumsum(used, dtype=np.int32) - 1
    return np.flatnonzero(used).astype(np.int32), renumbered[faces].astype(np.int32)


def _split_by_group(faces: IntArray, group: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Vertices such that no two faces (f, 3) of different groups (f,) share one.

    Returns (n,) the old vertex of each new one, in order; (f, 3) faces of new vertices; (n,) the
    group of each new vertex.
    """
    groups = int(group.max(initial=0)) + 1
    keys, renumbered = np.unique(
        faces.astype(np.int64) * groups + group[:, None], return_inverse=True
    )
    vertices, owner = np.divmod(keys, groups)
    return (
        vertices.astype(np.int32),
        renumbered.reshape(-1, 3).astype(np.int32),
        owner.astype(np.int32),
    )


def _mean(plant: Plant, chosen: npt.NDArray[np.bool_]) -> FloatArray:
    """(3,) mean of the vertex colours of some faces, (f,) bool, by area; white where there are
    none."""
    area = plant.face_areas[chosen]
    if plant.colors is None or not area.sum() > 0:
        return np.ones(3)
    return np.asarray(area @ plant.colors[plant.faces[chosen], :3].mean(axis=1) / area.sum())


def _through(share: float, color: FloatArray, texture: dict[str, Any] | None) -> dict[str, Any]:
    """The extension TRANSMISSION: a share of the light passes through, coloured by `color` (3,)
    times the texture."""
    values = {
        "diffuseTransmissionFactor": share,
        "diffuseTransmissionColorFactor": np.clip(color, 0.0, 1.0).tolist(),
    }
    return values if texture is None else {**values, "diffuseTransmissionColorTexture": texture}


def _unit_normals(normals: FloatArray) -> FloatArray:
    """Unit vectors; straight up where there is no direction, since glTF allows no zero normal."""
    result = unit(normals)
    result[~result.any(axis=1)] = (0.0, 1.0, 0.0)
    return result
