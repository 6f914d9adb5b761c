"""Materials and textures of glTF 2.0.

Sources: glTF 2.0 specification, 3.9; KHR_texture_transform, KHR_texture_basisu, EXT_texture_webp,
KHR_materials_pbrSpecularGlossiness, KHR_techniques_webgl (its diffuse texture only),
KHR_materials_unlit, KHR_materials_diffuse_transmission.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import CapabilityError
from vegtool.formats.alpha import DEFAULT_CUTOFF, settle_alpha
from vegtool.formats.gltf_data import GltfFile
from vegtool.formats.images import decode
from vegtool.plant import Material, Texture
from vegtool.srgb import linear_from_srgb

REPEAT = 10497
STRONGEST_TINT = 4.0
"""Times the surface's own colour: a ratio beyond says that the two show different things."""
UNLIT, TRANSMISSION = "KHR_materials_unlit", "KHR_materials_diffuse_transmission"
_FACTOR, _COLOR_FACTOR = "diffuseTransmissionFactor", "diffuseTransmissionColorFactor"
_TEXTURE, _COLOR_TEXTURE = "diffuseTransmissionTexture", "diffuseTransmissionColorTexture"
_MOST = 1e18
"""Greatest number that can be meant."""


@dataclass(frozen=True, eq=False)
class UvSource:
    """Which texture coordinates a material reads, and the (2, 3) transform it puts on them.

    repeats: whether its sampler repeats the picture beyond the edges, as a Plant's textures do.
    """

    set: int = 0
    transform: FloatArray | None = None
    repeats: bool = True

    def same_as(self, other: UvSource) -> bool:
        """Whether both give the same coordinates."""
        mine = np.eye(2, 3) if self.transform is None else self.transform
        theirs = np.eye(2, 3) if other.transform is None else other.transform
        return self.set == other.set and np.allclose(mine, theirs)


@dataclass(frozen=True, eq=False)
class ReadMaterial:
    """A material and where its texture coordinates come from."""

    material: Material
    uvs: UvSource


def read_materials(file: GltfFile, notes: list[str]) -> list[ReadMaterial]:
    """The file's materials, and one more, glTF's default, for meshes without."""
    images: dict[int, Texture | None] = {}
    entries = file.json.get("materials", [])
    found = [
        _read_material(file, entry, str(entry.get("name") or f"material_{k}"), images, notes)
        for k, entry in enumerate(entries)
    ]
    return [*found, ReadMaterial(Material("default", metallic=0.0), UvSource())]


def _read_material(
    file: GltfFile,
    entry: dict[str, Any],
    name: str,
    images: dict[int, Texture | None],
    notes: list[str],
) -> ReadMaterial:
    surface = entry.get("pbrMetallicRoughness", {})
    extensions = entry.get("extensions", {})
    glossy = extensions.get("KHR_materials_pbrSpecularGlossiness")
    shader = extensions.get("KHR_techniques_webgl")
    factor = surface.get("baseColorFactor", [1, 1, 1, 1])
    info = surface.get("baseColorTexture")
    metallic, roughness = surface.get("metallicFactor", 1.0), surface.get("roughnessFactor", 1.0)
    if glossy is not None:
        factor = glossy.get("diffuseFactor", [1, 1, 1, 1])
        info = glossy.get("diffuseTexture")
        metallic, roughness = 0.0, 1.0 - glossy.get("glossinessFactor", 1.0)
    elif shader is not None and info is None:
        values = shader.get("values", {})
        info = next((v for k, v in values.items() if "diffuse" in k and "index" in v), None)
        metallic = 0.0
        notes.append(f"material {name}: its own shader is left out, its diffuse texture is kept")
    base_color = np.clip(np.array(factor, dtype=np.float64), 0.0, None)
    texture, uvs = _texture(file, info, images, notes)
    if "metallicRoughnessTexture" in surface and (metallic or roughness):
        mean = _texture(file, surface["metallicRoughnessTexture"], images, notes)[0]
        if mean is not None:
            _, green, blue = mean.pixels[..., :3].reshape(-1, 3).mean(axis=0) / 255
            metallic, roughness = metallic * blue, roughness * green
    bumps = entry.get("normalTexture")
    normal_texture, normal_uvs = _texture(file, bumps, images, notes)
    if normal_texture is not None and texture is None:
        uvs = normal_uvs
    elif normal_texture is not None and not uvs.same_as(normal_uvs):
        notes.append(f"material {name}: dropped its normal map, which has coordinates of its own")
        normal_texture = None
    mode, cutoff, base_color = settle_alpha(
        name,
        str(entry.get("alphaMode", "OPAQUE")),
        float(entry.get("alphaCutoff", DEFAULT_CUTOFF)),
        base_color,
        texture,
        notes,
    )
    unlit = UNLIT in extensions
    through = {} if unlit else _through(file, extensions.get(TRANSMISSION, {}), name, notes)
    transmission = _transmission(file, through, name, images, notes)
    tint = np.ones(3)
    if transmission:
        tint = _transmission_tint(file, through, name, base_color, texture, images, notes)
    material = Material(
        name=name,
        base_color=base_color,
        color_texture=texture,
        normal_texture=normal_texture,
        normal_scale=float(bumps.get("scale", 1.0)) if bumps else 1.0,
        alpha_mode=mode,
        alpha_cutoff=cutoff,
        double_sided=bool(entry.get("doubleSided", False)),
        metallic=float(metallic),
        roughness=float(roughness),
        transmission=transmission,
        transmission_tint=tint,
        unlit=unlit,
    )
    return ReadMaterial(material, uvs)


def _through(file: GltfFile, found: Any, name: str, notes: list[str]) -> dict[str, Any]:
    """The extension TRANSMISSION; empty, and noted, where its values are not of its kinds."""
    if not isinstance(found, dict):
        return _left_out("an object", found, name, notes)
    for key, count, expected in ((_FACTOR, 1, "a number"), (_COLOR_FACTOR, 3, "3 numbers")):
        if key in found and not _are_numbers(found[key], count):
            return _left_out(f"{expected} as {key}", found[key], name, notes)
    known, values = range(len(file.json.get("textures", []))), dict(found)
    for key in (_TEXTURE, _COLOR_TEXTURE):
        if key not in found:
            continue
        index = found[key].get("index") if isinstance(found[key], dict) else None
        if type(index) is not int or index not in known:
            return _left_out(f"one of the file's textures as {key}", found[key], name, notes)
        values[key] = {"index": index}  # means are taken of it, so that coordinates do not matter
    return values


def _are_numbers(value: Any, count: int) -> bool:
    """Whether a JSON value is so many finite numbers; one alone stands in no list."""
    numbers = [value] if count == 1 else value
    return (
        isinstance(numbers, list)
        and len(numbers) == count
        and all(type(n) in (int, float) and abs(n) <= _MOST for n in numbers)
    )


def _left_out(expected: str, value: Any, name: str, notes: list[str]) -> dict[str, Any]:
    """Nothing, and a note on what was expected and found, as it stands in the file."""
    text = json.dumps(value, ensure_ascii=False)
    text = text if len(text) <= 60 else f"{text[:57]}..."
    notes.append(f"material {name}: {TRANSMISSION} is left out: expected {expected}, found {text}")
    return {}


def _transmission(
    file: GltfFile,
    through: dict[str, Any],
    name: str,
    images: dict[int, Texture | None],
    notes: list[str],
) -> float:
    """The share of light that passes through, 0 to 1; of a texture of shares, its mean."""
    share = float(through.get(_FACTOR, 0.0))
    texture, _ = _texture(file, through.get(_TEXTURE), images, notes)
    if texture is not None and share > 0:
        share *= float(texture.pixels[..., 3].mean()) / 255
        notes.append(
            f"material {name}: how much light passes through is a texture; its mean, {share:.2g}, "
            "is taken"
        )
    return min(max(share, 0.0), 1.0)


def _transmission_tint(
    file: GltfFile,
    through: dict[str, Any],
    name: str,
    base_color: FloatArray,
    texture: Texture | None,
    images: dict[int, Texture | None],
    notes: list[str],
) -> FloatArray:
    """(3,) linear: the colour of light that passes through over the surface's own.

    Exact where both have the same texture or none; else the ratio of their means, which is noted.
    At most STRONGEST_TINT, and such that its product with the surface's own colour, which is what a
    file holds, lies in 0..1; what was more is noted.
    """
    factor = np.array(through.get(_COLOR_FACTOR, [1, 1, 1]), dtype=np.float64)
    factor = np.clip(factor, 0.0, None)
    other, _ = _texture(file, through.get(_COLOR_TEXTURE), images, notes)
    own = base_color[:3]
    same = other is texture
    if same:
        full = _ratio(factor, own)
    else:
        full = _ratio(factor * _mean_color(other), own * _mean_color(texture))
    most = np.minimum(_ratio(np.ones(3), own), STRONGEST_TINT)
    tint = np.minimum(full, most)
    times = f"it is coloured as the surface, times {_triple(tint)}"
    cut = bool((full > most * (1 + 1e-9)).any())
    brighter = f"{_triple(full)} would be brighter than a file can hold, or than can be meant"
    if not same:
        notes.append(
            f"material {name}: light that passes through has another texture than the surface; "
            f"{times}, the ratio of means{f'; {brighter}' if cut else ''}"
        )
    elif cut:
        notes.append(
            f"material {name}: light that passes through is too bright; {times}; {brighter}"
        )
    return tint


def _triple(color: FloatArray) -> str:
    return f"({', '.join(f'{channel:.2g}' for channel in color)})"


def _ratio(light: FloatArray, own: FloatArray) -> FloatArray:
    """(3,) light / own; 1 where the surface's own colour is 0, which no tint can change."""
    with np.errstate(over="ignore"):
        return np.divide(light, own, out=np.ones(3), where=own > 0)


def _mean_color(texture: Texture | None) -> FloatArray:
    """(3,) linear mean of all texels; white without a texture."""
    if texture is None:
        return np.ones(3)
    linear = linear_from_srgb(np.arange(256) / 255)
    channels = texture.pixels[..., :3].reshape(-1, 3).T
    return np.array([np.bincount(c, minlength=256) @ linear / len(c) for c in channels])


def _texture(
    file: GltfFile,
    info: dict[str, Any] | None,
    images: dict[int, Texture | None],
    notes: list[str],
) -> tuple[Texture | None, UvSource]:
    """The texture of a textureInfo and the coordinates that it is laid on."""
    if info is None:
        return None, UvSource()
    extension = info.get("extensions", {}).get("KHR_texture_transform", {})
    texture = file.entry("textures", info.get("index"))
    uvs = UvSource(
        int(extension.get("texCoord", info.get("texCoord", 0))),
        _uv_transform(extension),
        _repeats(file, texture),
    )
    image = _image_index(file, texture)
    if image is None:
        return None, uvs
    if image not in images:
        images[image] = _image(file, image, notes)
    return images[image], uvs


def _repeats(file: GltfFile, texture: dict[str, Any]) -> bool:
    if "sampler" not in texture:
        return True
    sampler = file.entry("samplers", texture["sampler"])
    return all(sampler.get(axis, REPEAT) == REPEAT for axis in ("wrapS", "wrapT"))


def _image_index(file: GltfFile, texture: dict[str, Any]) -> int | None:
    extensions = texture.get("extensions", {})
    source: int | None = texture.get("source")
    if "EXT_texture_webp" in extensions:
        return int(extensions["EXT_texture_webp"]["source"])
    if source is None:
        for name, what in (("KHR_texture_basisu", "KTX2"), ("EXT_texture_avif", "AVIF")):
            if name in extensions:
                raise CapabilityError(
                    f"{file.path}: its textures are {what} ({name}), which vegtool cannot decode; "
                    "convert them to PNG, for example with `gltf-transform png` or `ktx extract`"
                )
    return source


def _image(file: GltfFile, index: int, notes: list[str]) -> Texture | None:
    entry = file.entry("images", index)
    uri = entry.get("uri")
    short = uri if isinstance(uri, str) and not uri.startswith("data:") else ""
    name = str(entry.get("name") or short or f"image_{index}")
    if "bufferView" in entry:
        data: bytes | None = bytes(file.view(entry["bufferView"]))
    else:
        data = file.resource(uri, f"images[{index}]")
    if data is None:
        notes.append(f"texture {short} is missing; drawn without it")
        return None
    return decode(data, name, f"{file.path}: image {name}")


def _uv_transform(extension: dict[str, Any]) -> FloatArray | None:
    """(2, 3): translation x rotation x scale, as KHR_texture_transform writes it."""
    if not {"offset", "rotation", "scale"} & extension.keys():
        return None
    (u, v), (s, t) = extension.get("offset", (0, 0)), extension.get("scale", (1, 1))
    angle = float(extension.get("rotation", 0.0))
    c, d = np.cos(angle), np.sin(angle)
    matrix = np.array([[c * s, d * t, u], [-d * s, c * t, v]], dtype=np.float64)
    return None if np.array_equal(matrix, np.eye(2, 3)) else matrix
