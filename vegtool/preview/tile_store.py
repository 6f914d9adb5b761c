"""Tiles on the GPU: those that are drawn, and of those that were as many as there is room for.

Tiles are read when they are first drawn. What was drawn longest ago is forgotten first, and read
again where it comes back. What tiles share stays for as long as any of them is there.

Bytes are those of vertices, indices and textures on the GPU, and of what they were made of, which
is kept beside them.
"""

from __future__ import annotations

import zlib
from collections import Counter, OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from weakref import WeakValueDictionary

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.elements import unordered
from vegtool.formats.gltf_tile import read_surfels_tile
from vegtool.gl.context import OnGpu
from vegtool.gl.instances import INSTANCE, WHOLE, InstancedPlant
from vegtool.gl.landscape import Landscape
from vegtool.gl.upload import Textures
from vegtool.plant import Plant, Texture
from vegtool.preview.palette import PALETTE
from vegtool.preview.tileset import Copies, Tileset, read_model, read_tile

MOST_BYTES = 1 << 30
"""Bytes that are kept, on the GPU and beside it; more where what is drawn is more."""
TEXEL_BYTES = 4
SURFEL_BYTES = 9 * (4 + 8)
"""On the GPU, and beside it."""
Key = tuple[int, bool, float | None]
"""Of a texture among Textures."""
ALL_TEXELS = (2.0, 1.0, 1.0)
"""INSTANCE's `shown` of what does not fade."""


@dataclass(frozen=True, eq=False)
class Held:
    """A tile on the GPU: rows of INSTANCE, places relative to the tile's origin, of each model.
    models: their indices in the landscape. files: where they were read. kinds: numbers of their
    species; 0 where several are merged. surfels: index in the landscape of the set that is drawn in
    place of models, or None. bounds: (2, 3) metres from the tile's origin, of those."""

    rows: tuple[np.ndarray, ...] = ()
    models: tuple[int, ...] = ()
    files: tuple[Path, ...] = ()
    kinds: tuple[int, ...] = ()
    surfels: int | None = None
    bounds: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))
    surfel_bytes: int = 0

    @property
    def bytes(self) -> int:
        """Of its rows alone, and of its surfels."""
        return sum(rows.nbytes for rows in self.rows) + self.surfel_bytes


@dataclass(frozen=True, eq=False)
class _Model:
    """What tiles draw. index: in the landscape. bytes: without textures. textures: that it is drawn
    with, each once."""

    index: int
    plant: Plant
    bytes: int
    textures: tuple[Key, ...]


class TileStore(OnGpu):
    """The tiles of a tileset in a landscape, which releases their models. A context manager:
    leaving releases their textures."""

    def __init__(self, tileset: Tileset, landscape: Landscape) -> None:
        self.tileset, self.landscape = tileset, landscape
        self.bytes = 0
        self._held: OrderedDict[int, Held] = OrderedDict()
        self._last: frozenset[int] = frozenset()
        self._models: dict[Path, _Model] = {}
        self._users: Counter[Path] = Counter()
        self._textures: Textures = {}
        self._shown: Counter[Key] = Counter()
        self._images: WeakValueDictionary[tuple[int, ...], Texture] = WeakValueDictionary()

    def __len__(self) -> int:
        return len(self._held)

    def release(self) -> None:
        """Free what tiles share."""
        for texture in self._textures.values():
            texture.release()
        for kept in (self._held, self._models, self._users, self._textures, self._shown):
            kept.clear()
        self.bytes, self._last = 0, frozenset()

    @property
    def texture_bytes(self) -> int:
        """On the GPU, mips counted."""
        return sum(_with_mips(TEXEL_BYTES * t.width * t.height) for t in self._textures.values())

    def held(self, tiles: Sequence[int]) -> list[Held]:
        """Tiles that are to be drawn now, in their order. Those drawn before last may be forgotten;
        not the last, as a frame that compares is drawn twice.

        Raises InputError for what is missing or broken.
        """
        needed = self._last | set(tiles)
        for tile in tiles:
            if tile in self._held:
                self._held.move_to_end(tile)
        for tile in tiles:
            if tile not in self._held:
                self._load(tile)
            self._forget(needed)
        self._last = frozenset(tiles)
        return [self._held[tile] for tile in tiles]

    def _load(self, tile: int) -> None:
        file = self.tileset.file[tile]
        assert file is not None, "only tiles with content are drawn"
        if self.tileset.surfels[tile]:
            surfels = read_surfels_tile(Path(file))
            index = self.landscape.add_surfels(surfels)
            size = SURFEL_BYTES * len(surfels)
            self._held[tile] = Held(surfels=index, bounds=surfels.bounds, surfel_bytes=size)
            self.bytes += size
            return
        copies = read_tile(Path(file), self._model)
        models = tuple(self._uploaded(one) for one in copies)
        held = Held(
            tuple(_rows(one) for one in copies),
            tuple(model.index for model in models),
            tuple(one.file for one in copies),
            tuple(_kind(one.file) for one in copies),
        )
        self._users.update(held.files)
        self._held[tile] = held
        self.bytes += held.bytes

    def _forget(self, needed: frozenset[int]) -> None:
        """Tiles that are not needed, the longest unseen first, until the rest is small enough."""
        while self.bytes > MOST_BYTES and (tile := next(iter(self._held))) not in needed:
            held = self._held.pop(tile)
            self.bytes -= held.bytes
            if held.surfels is not None:
                self.landscape.remove_surfels(held.surfels)
            self._users.subtract(held.files)
            for file in set(held.files):
                if not self._users[file]:
                    self._remove(file)

    def _remove(self, file: Path) -> None:
        """A model that no tile has any more, and textures that no other model is drawn with."""
        model = self._models.pop(file)
        del self._users[file]
        self.landscape.remove(model.index)
        self.bytes -= model.bytes
        self._shown.subtract(model.textures)
        for key in model.textures:
            if not self._shown[key]:  # goes before its image, whose id may be another's one day
                self.bytes -= self._both(key)
                self._textures.pop(key).release()
                del self._shown[key]

    def _both(self, key: Key) -> int:
        """Bytes of a texture and of the image that it was made of."""
        image = TEXEL_BYTES * int(self._textures[key].width * self._textures[key].height)
        return image + _with_mips(image)

    def _model(self, path: Path) -> Plant:
        """A model that tiles share, read once."""
        known = self._models.get(path)
        return read_model(path) if known is None else known.plant

    def _uploaded(self, copies: Copies) -> _Model:
        if copies.file not in self._models:
            plant = self._with_images(copies.plant)
            index = self.landscape.add(plant, unordered(plant), shared=self._textures)
            made = self.landscape.plants[-1]
            model = _Model(index, plant, _model_bytes(made), self._textures_of(made))
            self.bytes += model.bytes
            self.bytes += sum(self._both(key) for key in model.textures if key not in self._shown)
            self._shown.update(model.textures)
            self._models[copies.file] = model
        return self._models[copies.file]

    def _textures_of(self, made: InstancedPlant) -> tuple[Key, ...]:
        maps = {m for g in made.buffers.groups for m in (g.color_map, g.normal_map, g.light_map)}
        return tuple(key for key, texture in self._textures.items() if texture in maps)

    def _with_images(self, plant: Plant) -> Plant:
        """The same, with the images of another where they are the same bytes."""

        def one(image: Texture | None) -> Texture | None:
            if image is None:
                return None
            key = (zlib.crc32(image.pixels.tobytes()), *image.pixels.shape)
            known = self._images.setdefault(key, image)
            return known if np.array_equal(known.pixels, image.pixels) else image

        materials = tuple(
            replace(
                material,
                color_texture=one(material.color_texture),
                normal_texture=one(material.normal_texture),
                light_texture=one(material.light_texture),
            )
            for material in plant.materials
        )
        return replace(plant, materials=materials)


def _with_mips(image_bytes: int) -> int:
    return image_bytes * 4 // 3


def _model_bytes(made: InstancedPlant) -> int:
    """Of its arrays, and of its buffers."""
    arrays = [getattr(of, field.name) for of in (made.plant, made.elements) for field in fields(of)]
    return made.buffer_bytes + sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))


def _kind(file: Path) -> int:
    """A number of the species, whichever level of it a shared model is: NAME_1.gltf."""
    name = file.stem.rpartition("_")[0]
    return 1 + zlib.crc32(name.encode()) % (len(PALETTE) - 1) if file.suffix == ".gltf" else 0


def _rows(copies: Copies) -> np.ndarray:
    rows = np.zeros(len(copies.place), INSTANCE)
    rows["place"][:, :3], rows["place"][:, 3] = copies.place, copies.scale
    rows["turn"][:, 0], rows["turn"][:, 1] = np.cos(copies.yaw), np.sin(copies.yaw)
    rows["turn"][:, 2:] = WHOLE, 1.0
    rows["shown"] = ALL_TEXELS
    rows["tint"][:, :3] = np.clip(np.rint(127.5 * copies.tint), 0, 255)
    rows["tint"][:, 3] = 255
    return rows
