"""What all tiles draw with: models for their instances, sheets of pictures for merged groups."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vegtool.arrays import IntArray
from vegtool.formats import png
from vegtool.formats.gltf_tile import SheetFiles
from vegtool.formats.shared_model import SharedModel, shared_model
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


@dataclass(frozen=True, eq=False)
class MergedSheet:
    """A sheet, where its textures are, and (s, l) int32 the parts that levels are; -1 for none."""

    sheet: Sheet
    files: SheetFiles
    part: IntArray


def shared_of(pyramid: Pyramid, heights: range, folder: str = f"{FOLDER}/") -> Shared:
    """All that squares of these heights draw with; folder: where it is, as seen from a tile."""
    near = [height for height in heights if pyramid.instanced(height)]
    models = {
        (kind, level): shared_model(
            pyramid.species[kind].levels[level], f"{pyramid.species[kind].name}_LOD{level}", folder
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
        found = SheetFiles(f"{folder}{name}_color.png", normal, sheet.double_sided)
        sheets[height] = MergedSheet(sheet, found, part)
    return Shared(models, sheets, files)
