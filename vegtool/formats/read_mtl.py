"""MTL materials of OBJ files, with what trimesh leaves out: map_d, bump and normal maps, options.

Sources: Wavefront's MTL description (P. Bourke's copy); Blender writes Kd in linear light, others
in sRGB, which is told by Blender's name in the first line.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.alpha import settle_alpha
from vegtool.formats.beside import find_beside
from vegtool.formats.images import decode
from vegtool.plant import Material, Texture
from vegtool.srgb import linear_from_srgb

OPTION_VALUES = {
    "-blendu": 1,
    "-blendv": 1,
    "-bm": 1,
    "-boost": 1,
    "-cc": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-texres": 1,
    "-type": 1,
    "-mm": 2,
    "-o": 3,
    "-s": 3,
    "-t": 3,
}
"""Options of a map and how many values follow; -o, -s and -t may have fewer."""

NORMAL_MAP_BLUE = 0.6
"""Mean blue, of 1, above which a bump map is a normal map."""


@dataclass(frozen=True, eq=False)
class ObjMaterial:
    """A material and the scale and offset (2,) each that it puts on v-up texture coordinates."""

    material: Material
    uv_scale: FloatArray = field(default_factory=lambda: np.ones(2))
    uv_offset: FloatArray = field(default_factory=lambda: np.zeros(2))


@dataclass(frozen=True)
class _Map:
    """A texture reference: file name and options by name."""

    file: str
    options: dict[str, list[str]]

    def numbers(self, option: str, default: float) -> FloatArray:
        """(2,) first two values of -s or -o."""
        values = [float(v) for v in self.options.get(option, [])][:2]
        return np.array(values + [default] * (2 - len(values)))


def read_mtl(path: Path, model: Path, notes: list[str]) -> dict[str, ObjMaterial]:
    """The materials of an MTL file by name; textures are looked for beside `model`.

    Missing textures are noted, broken ones raise InputError.
    """
    text = path.read_bytes().decode("utf-8", errors="replace")
    linear = "blender" in text[:200].lower()
    textures: dict[str, Texture | None] = {}
    found: dict[str, ObjMaterial] = {}
    for name, entries in _materials(text).items():
        found[name] = _material(name, entries, linear, model, textures, notes)
    return found


def _materials(text: str) -> dict[str, dict[str, str]]:
    """Per material its entries by lower-case key."""
    found: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    for line in text.replace("\\\n", " ").splitlines():
        key, _, rest = line.strip().partition(" ")
        if key.lower() == "newmtl":
            current = found.setdefault(rest.strip(), {})
        elif rest and not key.startswith("#"):
            current[key.lower()] = rest.split(" #")[0].strip()
    return found


def _material(
    name: str,
    entries: dict[str, str],
    linear: bool,
    model: Path,
    textures: dict[str, Texture | None],
    notes: list[str],
) -> ObjMaterial:
    color_map = _map(entries.get("map_kd"))
    texture = _texture(color_map, model, textures, notes)
    color = np.array(_numbers(entries.get("kd"), [1.0, 1.0, 1.0]))
    if color_map is not None and not color.any():
        notes.append(f"material {name}: Kd 0 0 0 with a texture would be black; read as white")
        color = np.ones(3)
    if not linear:
        color = linear_from_srgb(color)
    base_color = np.append(color, _opacity(name, entries, notes))
    alpha_map = _map(entries.get("map_d"))
    if alpha_map is not None:
        texture = _with_alpha(texture, color_map, alpha_map, model, textures, notes)
    mode, cutoff, base_color = settle_alpha(name, "AUTO", 0.5, base_color, texture, notes)
    normal_map, scale = _normal_map(name, entries, model, textures, notes)
    material = Material(
        name=name,
        base_color=base_color,
        color_texture=texture,
        normal_texture=normal_map,
        normal_scale=scale,
        alpha_mode=mode,
        alpha_cutoff=cutoff,
        double_sided=True,  # OBJ knows no culling
    )
    placed = color_map or alpha_map
    if placed is None:
        return ObjMaterial(material)
    return ObjMaterial(material, placed.numbers("-s", 1.0), placed.numbers("-o", 0.0))


def _opacity(name: str, entries: dict[str, str], notes: list[str]) -> float:
    """d, or 1 - Tr; an opacity of 0 is an exporter's slip."""
    opacity = 1.0
    if "d" in entries:
        opacity = _numbers(entries["d"].removeprefix("-halo"), [1.0])[0]
    elif "tr" in entries:
        opacity = 1.0 - _numbers(entries["tr"], [0.0])[0]
    if opacity <= 0:
        notes.append(f"material {name}: opacity 0 would be invisible; read as opaque")
        return 1.0
    return min(opacity, 1.0)


def _normal_map(
    name: str,
    entries: dict[str, str],
    model: Path,
    textures: dict[str, Texture | None],
    notes: list[str],
) -> tuple[Texture | None, float]:
    """The normal map and its scale; bump maps that are heights are left out."""
    for key in ("norm", "map_kn", "map_bump", "bump"):
        reference = _map(entries.get(key))
        if reference is None:
            continue
        texture = _texture(reference, model, textures, notes)
        if texture is None:
            return None, 1.0
        blue = texture.pixels[::8, ::8, 2].mean() / 255
        red = texture.pixels[::8, ::8, 0].mean() / 255
        if key not in ("norm", "map_kn") and not (blue > NORMAL_MAP_BLUE and blue > red + 0.1):
            notes.append(f"material {name}: bump map {texture.name} holds heights; left out")
            return None, 1.0
        return texture, _numbers(" ".join(reference.options.get("-bm", [])), [1.0])[0]
    return None, 1.0


def _with_alpha(
    texture: Texture | None,
    color_map: _Map | None,
    alpha_map: _Map,
    model: Path,
    textures: dict[str, Texture | None],
    notes: list[str],
) -> Texture | None:
    """The colour texture with the alpha of map_d: its alpha channel, else its brightness."""
    if color_map is not None and _short(color_map.file) == _short(alpha_map.file):
        return texture
    mask = _texture(alpha_map, model, textures, notes)
    if mask is None:
        return texture
    has_alpha = bool((mask.pixels[..., 3] < 255).any())
    alpha = mask.pixels[..., 3] if has_alpha else mask.pixels[..., :3].max(axis=2)
    if texture is None:
        white = np.full((*alpha.shape, 4), 255, dtype=np.uint8)
        white[..., 3] = alpha
        return Texture(mask.name, white)
    height, width = texture.pixels.shape[:2]
    if alpha.shape != (height, width):
        from PIL import Image

        alpha = np.asarray(Image.fromarray(alpha).resize((width, height), Image.Resampling.BOX))
    return Texture(texture.name, np.dstack([texture.pixels[..., :3], alpha]))


def _texture(
    reference: _Map | None, model: Path, textures: dict[str, Texture | None], notes: list[str]
) -> Texture | None:
    if reference is None:
        return None
    name = _short(reference.file)
    if reference.file not in textures:
        path = find_beside(model, reference.file)
        if path is None:
            notes.append(f"texture {reference.file} is missing; drawn without it")
            textures[reference.file] = None
        else:
            textures[reference.file] = decode(path.read_bytes(), name, f"{model}: texture {name}")
    return textures[reference.file]


def _short(file: str) -> str:
    return re.split(r"[\\/]", file)[-1]


def _map(text: str | None) -> _Map | None:
    """`-bm 1 -o 0 0 0 leaf colour.png` -> file name (spaces allowed) and options."""
    if not text:
        return None
    words = text.split()
    options: dict[str, list[str]] = {}
    at = 0
    while at < len(words) - 1 and words[at].lower() in OPTION_VALUES:
        option = words[at].lower()
        at += 1
        values: list[str] = []
        while at < len(words) - 1 and len(values) < OPTION_VALUES[option]:
            if option in ("-o", "-s", "-t") and not _is_number(words[at]):
                break
            values.append(words[at])
            at += 1
        options[option] = values
    return _Map(text.split(None, at)[-1].strip().strip('"'), options)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _numbers(text: str | None, default: list[float]) -> list[float]:
    """As many leading numbers as the default has; the default where there are none."""
    values = []
    for word in (text or "").split():
        if not _is_number(word) or not np.isfinite(float(word)):
            break
        values.append(float(word))
    if len(values) == 1 and len(default) == 3:
        values = values * 3  # one number for all channels
    return values[: len(default)] if len(values) >= len(default) else default
