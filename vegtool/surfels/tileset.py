"""A model of surfel billboards as a 3D Tiles tileset: its parts, and the pictures that they share.

Source: OGC 22-025r4, 3D Tiles 1.1. A tile's geometric error is the largest of its billboards, which
is d sqrt(theta (2 - theta)) metres, and of its triangles (Holst, Schumann (2007), eq. 8 and 16). It
is seen as epsilon pixels at z_min: a client that goes on to the children where it is more than that
draws billboards where they are valid.

Billboards are drawn from one side. Where something is seen from behind there is a second quad, with
the picture of that side, or the front's where that serves both: one that is mirrored, normals and
all (baking/sides.py), which a material drawn from both sides would not do. So all are one primitive
with one material.

Pictures are a few texels large, with gaps between them. Clients are told not to average them (no
mips): they would be mixed with the gaps, and what is small would be gone before its tile is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats import png
from vegtool.formats.gltf_tile import SheetFiles, part_glb
from vegtool.formats.ramp import RAMP
from vegtool.formats.shared_model import ENDINGS, plain_name
from vegtool.formats.tileset import TileEntry, tileset_files
from vegtool.lod import Level, Triangles, billboard_quads
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.surfels.margin import billboards_of
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.tiling import SurfelTile

FAR = 16.0
"""Plant radii from zero: vertices of a plant that is farther away are relative to its middle."""


def surfel_tileset(
    model: SurfelModel, root: SurfelTile, name: str, progress: Progress = silent
) -> Iterator[tuple[str, bytes]]:
    """The files of a model, by their names, in one folder: pictures, tiles NAME_0.glb, NAME_1.glb,
    ..., and tileset.json. The same model, the same bytes.

    root: of its tiles (tiling.py).
    """
    writer = _Writer(model, plain_name(name))
    yield from writer.pictures.items()
    tiles = list(root.all())
    entries: dict[int, TileEntry] = {}
    for number in range(len(tiles) - 1, -1, -1):  # children before their parents
        progress("tiles", 1 - number / len(tiles))
        tile, file = tiles[number], f"{writer.stem}_{number}.glb"
        bounds, data = writer.content(tile, number)
        children = [entries.pop(id(child)) for child in tile.children]
        entries[id(tile)] = writer.entry(file, bounds, tile, children)
        yield file, data
    gone_m = max(2 * model.plant.radius, 2 * root.error)
    whole = replace(entries[id(root)], plants=1)  # of which all others are parts
    files = tileset_files(whole, None, model.options.epsilon, gone_m)
    yield from files.items()


@dataclass(frozen=True, eq=False)
class _Writer:
    """What the tiles of a model have in common. stem: of all names."""

    model: SurfelModel
    stem: str

    @cached_property
    def origin(self) -> FloatArray:
        """(3,) metres: one for all tiles, so that vertices that they share are the same in all."""
        bounds, radius = self.model.plant.bounds, self.model.plant.radius
        return bounds.mean(axis=0) if np.abs(bounds).max() > FAR * radius else np.zeros(3)

    @cached_property
    def plant(self) -> Plant:
        """The original about the origin."""
        plant = self.model.plant
        return replace(plant, positions=plant.positions - self.origin)

    @cached_property
    def quads(self) -> Triangles:
        """Of b billboards 2 b quads, with four vertices each: all fronts, then all backs."""
        billboards, atlas = billboards_of(self.model.hierarchy), self.model.textures.atlas
        moved = replace(billboards, center=billboards.center - self.origin)
        level = Level("billboards", billboards=moved, atlas=atlas, double_sided=False)
        return billboard_quads(level)

    @cached_property
    def sheet(self) -> SheetFiles:
        """The pictures of all billboards; where none of the plant is lit, they are not either."""
        unlit = all(material.unlit for material in self.plant.materials)
        bumped = self.model.textures.atlas.normal is not None and not unlit
        color, normal = f"{self.stem}_color.png", f"{self.stem}_normal.png"
        return SheetFiles(
            color, normal if bumped else None, double_sided=False, unlit=unlit, averaged=False
        )

    @cached_property
    def _of_plant(self) -> dict[str, tuple[int, bytes]]:
        """The original's pictures: ids and bytes, by the names of files."""
        plant, found = self.plant, {}
        textures = {id(t): t for material in plant.materials for t in material.textures}
        for number, (key, texture) in enumerate(textures.items()):
            data, kind = png.encode_texture(texture)
            found[f"{self.stem}_picture_{number}{ENDINGS[kind]}"] = key, data
        if plant.exposure is not None:
            found[f"{self.stem}_exposure.png"] = id(RAMP), png.encode(RAMP)
        return found

    @cached_property
    def pictures(self) -> dict[str, bytes]:
        """All, by the names of their files."""
        atlas, files = self.model.textures.atlas, {}
        if len(self.model.hierarchy):
            files[str(self.sheet.color)] = png.encode(atlas.color)
            if atlas.normal is not None and self.sheet.normal is not None:
                files[self.sheet.normal] = png.encode(atlas.normal)
        return files | {file: data for file, (_, data) in self._of_plant.items()}

    def content(self, tile: SurfelTile, number: int) -> tuple[FloatArray, bytes]:
        """(2, 3) metres, bounds of what a tile draws; and its file."""
        quads, mesh = self._quads(tile), self._mesh(tile)
        points = [quads.positions] if quads is not None else []
        if mesh is not None:
            points.append(mesh.corners.reshape(-1, 3))
        bounds = [f.reduce([f.reduce(p) for p in points]) for f in (np.minimum, np.maximum)]
        beside = {key: file for file, (key, _) in self._of_plant.items()}
        data = part_glb(quads, self.sheet, mesh, beside, f"{self.stem}_{number}")
        return np.stack(bounds) + self.origin, data

    def entry(
        self, file: str, bounds: FloatArray, tile: SurfelTile, children: list[TileEntry]
    ) -> TileEntry:
        """A tile as it is listed. bounds: (2, 3) metres, of what it draws itself."""
        low, high = zip(bounds, *(child.bounds for child in children), strict=True)
        foot_m = float(self.model.plant.bounds[0, 1])
        held = np.stack([np.min(low, axis=0), np.max(high, axis=0)])
        return TileEntry(
            file, self.origin, held, tile.error, feet_m=(foot_m, foot_m), children=children
        )

    def _quads(self, tile: SurfelTile) -> Triangles | None:
        """Fronts, and such backs as show something."""
        count, shown = len(self.model.hierarchy), tile.billboards
        if not len(shown):
            return None
        quads = self.quads
        behind = shown[self.model.textures.behind[shown]]
        which = np.concatenate([shown, count + behind]).astype(np.int64)
        vertices = (4 * which[:, None] + np.arange(4)).ravel()
        moved = 4 * (np.arange(len(which)) - which)[:, None]
        return Triangles(
            quads.positions[vertices],
            quads.normals[vertices],
            quads.tangents[vertices],
            quads.uvs[vertices],
            (quads.indices.reshape(-1, 6)[which] + moved).ravel().astype(np.int32),
        )

    def _mesh(self, tile: SurfelTile) -> Plant | None:
        """Triangles, in the original's materials."""
        mt, rows = self.model.triangles, tile.triangles
        if not len(rows):
            return None
        material = np.repeat(mt.material, mt.sizes)[rows]
        return replace(self.plant, faces=mt.faces[rows], face_material=material, branches=None)
