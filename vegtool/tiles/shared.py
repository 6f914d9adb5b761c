"""What all tiles draw with: models for their instances, sheets of pictures for merged groups.

Tiles refer to both by the names of their files; they need no more of a model than how long its
vertices are, and of a sheet than where on it pictures are. So files are written once, and whoever
makes a tile makes none of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.errors import InputError
from vegtool.formats import png
from vegtool.formats.gltf_tile import SheetFiles
from vegtool.formats.shared_model import SharedModel, model_files, plain_name, read_shared
from vegtool.surfel_set import SurfelSet
from vegtool.tiles.levels import COARSEST, fitting
from vegtool.tiles.pyramid import Pyramid, used_levels
from vegtool.tiles.quadtree import Node
from vegtool.tiles.sheet import Sheet, sheet_of
from vegtool.tiles.textures import limited, resolved

FOLDER = "shared"
"""In that of the tiles: readers that keep to a file's own folder find it too."""


@dataclass(frozen=True, eq=False)
class MergedSheet:
    """A sheet, where its textures are, and (s, l) int32 the parts that levels are; -1 for none."""

    sheet: Sheet
    files: SheetFiles
    part: IntArray

    def files_for(self, part: IntArray) -> SheetFiles:
        """Those that a group of these parts, (n,), draws with: none where no part has a picture."""
        if self.sheet.textured[part].any():
            return self.files
        return replace(self.files, color=None, normal=None)

    @property
    def triangles(self) -> FloatArray:
        """(s, l) of each level as the sheet has it; 0 where it has none."""
        count = np.array([len(part.indices) // 3 for part in self.sheet.parts], np.float64)
        return np.where(self.part >= 0, count[self.part], 0.0)


class Shared:
    """What the tiles of a pyramid share. folder: that of the tiles' files. Everything is made, or
    read, when it is asked for first."""

    def __init__(self, pyramid: Pyramid, folder: Path) -> None:
        self.pyramid, self.folder = pyramid, folder
        self._models: dict[tuple[int, int], SharedModel] = {}
        self._sheets: dict[int, MergedSheet] = {}
        self._samples: dict[int, SurfelSet] = {}
        self._crowded: dict[int, float] = {}

    @cached_property
    def _names(self) -> list[str]:
        return file_names([one.name for one in self.pyramid.species])

    def model_name(self, kind: int, level: int) -> str:
        """Of a species' level. Not _LOD1: beside a node of that name, readers leave out others."""
        return f"{self._names[kind]}_{level}"

    def model_files(self, kind: int, level: int, per_metre: float = inf) -> dict[str, bytes]:
        """A level's files, by their names in FOLDER; without texels that are not seen where no
        metre of it is more than so many pixels."""
        plant = limited(self.pyramid.species[kind].levels[level], self.pyramid.options.near_texture)
        plant = resolved(plant, per_metre)
        return model_files(plant, self.model_name(kind, level))

    def model(self, kind: int, level: int) -> SharedModel:
        """A level whose files are written, as instances refer to it.

        Raises InputError where they are not.
        """
        if (kind, level) not in self._models:
            file = self.folder / FOLDER / f"{plain_name(self.model_name(kind, level))}.gltf"
            try:
                self._models[kind, level] = read_shared(file, f"{FOLDER}/")
            except FileNotFoundError as error:
                raise InputError(
                    f"expected {file}, which it draws, found none: that could not be made"
                ) from error
        return self._models[kind, level]

    def sample(self, kind: int) -> SurfelSet:
        """The surfels of a species. Raises InputError for a file that is missing or broken."""
        if kind not in self._samples:
            self._samples[kind] = self.pyramid.samples[kind].read()
        return self._samples[kind]

    def crowded(self, height: int) -> float:
        """How many times farther away than they are the plants of merged squares of a height are
        drawn as, at least: as on the square of the middle density they have to be. Finer levels
        would only take room on the sheet, of which clients keep a copy for every square."""
        if height not in self._crowded:
            self._crowded[height] = self._crowded_on(self._middle(height), height)
        return self._crowded[height]

    def levels(self, height: int) -> list[tuple[int, int]]:
        """Species and levels that the sheet of a height has, in order."""
        return used_levels(self.pyramid, height, self.crowded(height))

    def sheet(self, height: int) -> MergedSheet:
        """What merged squares of a height are drawn with."""
        if height not in self._sheets:
            self._sheets[height] = self._sheet_of(height)
        return self._sheets[height]

    def sheet_files(self, height: int) -> dict[str, bytes]:
        """A sheet's files, by their names in FOLDER."""
        sheet, named = self.sheet(height).sheet, self.sheet(height).files
        files = {}
        if named.color is not None:
            files[Path(named.color).name] = png.encode(sheet.color)
        if named.normal is not None and sheet.normal is not None:
            files[Path(named.normal).name] = png.encode(sheet.normal[..., :3])
        return files

    def _sheet_of(self, height: int) -> MergedSheet:
        pairs = self.levels(height)
        levels = [self.pyramid.species[kind].levels[level] for kind, level in pairs]
        sheet = sheet_of(levels, self.pyramid.options.max_texture)
        part = np.full(self.pyramid.of_level.shape, -1, np.int32)
        part[tuple(np.array(pairs).T)] = np.arange(len(pairs))
        stem = f"{FOLDER}/sheet_{height}"
        color = f"{stem}_color.png" if sheet.pictured else None
        normal = f"{stem}_normal.png" if sheet.with_normals else None
        named = SheetFiles(color, normal, sheet.double_sided, sheet.unlit)
        return MergedSheet(sheet, named, part)

    def _middle(self, height: int) -> Node:
        """The square of a height with more plants to each tile on it than half of the others."""
        tree, count = self.pyramid.tree, self.pyramid.placement.tiles.count
        nodes = tree.nodes(tree.depth - height)
        ordered = sorted(nodes, key=lambda node: (count[tree.tiles_of(node)].mean(), node))
        return ordered[len(ordered) // 2]

    def _crowded_on(self, node: Node, height: int) -> float:
        pyramid = self.pyramid
        _, times = fitting(
            pyramid.stand(node), pyramid.switch_m, pyramid.of_level, pyramid.made_for_m(height),
            pyramid.budget(node), pyramid.finest(height),
        )  # fmt: skip
        # Beyond the blocks, squares that are more crowded are clustered anew, and need no sheet.
        return times if height <= pyramid.options.near else min(times, COARSEST)


def file_names(names: Sequence[str]) -> list[str]:
    """Names that no two have, whatever the file system thinks of capitals."""
    plain = [plain_name(name).lower() for name in names]
    taken = {own for own in plain if plain.count(own) == 1}
    found = []
    for index, (name, own) in enumerate(zip(names, plain, strict=True)):
        if plain.count(own) > 1:
            name = f"{name}_{index}"
            while plain_name(name).lower() in taken:
                name += "_"
            taken.add(plain_name(name).lower())
        found.append(name)
    return found
