"""What all tiles draw with: models for their instances, sheets of pictures for merged groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.formats import png
from vegtool.formats.gltf_tile import SheetFiles
from vegtool.formats.shared_model import SharedModel, plain_name, shared_model
from vegtool.tiles.pyramid import Pyramid, used_levels
from vegtool.tiles.sheet import Sheet, sheet_of

FOLDER = "shared"
"""In that of the tiles: readers that keep to a file's own folder find it too."""


@dataclass(frozen=True, eq=False)
class Shared:
    """models: by species and level. sheets: by the height of the squares that are drawn with them.
    files: by name, what is to be written."""

    models: dict[tuple[int, int], SharedModel]
    sheets: dict[int, MergedSheet]
    files: dict[str, bytes] = field(default_factory=dict)


def file_names(names: Sequence[str]) -> list[str]:
    """Names that no two have, whatever the file system thinks of capitals."""
    plain = [plain_name(name).lower() for name in names]
    return [
        name if plain.count(own) == 1 else f"{name}_{index}"
        for index, (name, own) in enumerate(zip(names, plain, strict=True))
    ]


@dataclass(frozen=True, eq=False)
class MergedSheet:
    """A sheet, where its textures are, and (s, l) int32 the parts that levels are; -1 for none."""

    sheet: Sheet
    files: SheetFiles
    part: IntArray

    @property
    def triangles(self) -> FloatArray:
        """(s, l) of each level as the sheet has it; 0 where it has none."""
        count = np.array([len(part.indices) // 3 for part in self.sheet.parts], np.float64)
        return np.where(self.part >= 0, count[self.part], 0.0)


def shared_of(pyramid: Pyramid, heights: range, folder: str = f"{FOLDER}/") -> Shared:
    """All that squares of these heights draw with; folder: where it is, as seen from a tile."""
    near = [height for height in heights if pyramid.instanced(height)]
    names = file_names([one.name for one in pyramid.species])
    models = {
        (kind, level): shared_model(
            pyramid.species[kind].levels[level], f"{names[kind]}_LOD{level}", folder
        )
        for kind, level in used_levels(pyramid, near)
    }
    files = {name: data for model in models.values() for name, data in model.files.items()}
    sheets = {}
    for height in heights:
        if pyramid.instanced(height):
            continue
        pairs = used_levels(pyramid, [height])
        sheet = sheet_of(
            [pyramid.species[kind].levels[level] for kind, level in pairs],
            pyramid.options.max_texture,
        )
        name = f"sheet_{height}"
        part = np.full(pyramid.of_level.shape, -1, np.int32)
        part[tuple(np.array(pairs).T)] = np.arange(len(pairs))
        files[f"{name}_color.png"] = png.encode(sheet.color)
        normal = None
        if sheet.normal is not None:
            normal = f"{folder}{name}_normal.png"
            files[f"{name}_normal.png"] = png.encode(sheet.normal[..., :3])
        found = SheetFiles(f"{folder}{name}_color.png", normal, sheet.double_sided, sheet.unlit)
        sheets[height] = MergedSheet(sheet, found, part)
    return Shared(models, sheets, files)
