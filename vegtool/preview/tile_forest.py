"""A tileset drawn as clients draw it: a tile until its error can be seen, then its quarters.

Source: OGC 22-025r4, 3D Tiles 1.1, section 6.3: refinement REPLACE, geometric error in pixels.
Tiles are read when they are first drawn.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from vegtool.arrays import Picture
from vegtool.elements import unordered
from vegtool.gl.context import OnGpu
from vegtool.gl.draw import MSAA
from vegtool.gl.instances import INSTANCE, WHOLE
from vegtool.gl.landscape import Batch, Frame, GroundMesh, Landscape, picture
from vegtool.gl.upload import Textures
from vegtool.gl.window_client import Context
from vegtool.plant import Plant, Texture
from vegtool.preview.eye import Eye
from vegtool.preview.palette import PALETTE
from vegtool.preview.reveal import noise
from vegtool.preview.scenery import AS_IT_IS, VIEWS, FrameStats, Look
from vegtool.preview.tileset import Copies, Tileset, read_model, read_tile

CLIENT_PX = 16.0
"""Pixels that a tile's error may be seen as at detail 1, as clients have it."""
NEAREST_M = 0.1
"""An eye in a tile's box is no nearer."""
ALL_TEXELS = (2.0, 1.0, 1.0)
"""INSTANCE's `shown` of what does not fade."""


@dataclass(frozen=True, eq=False)
class Held:
    """A tile on the GPU: rows of INSTANCE, places relative to the tile's origin, of each model.
    kinds: numbers of their species; 0 where several are merged."""

    rows: tuple[np.ndarray, ...]
    models: tuple[int, ...]
    kinds: tuple[int, ...]


class TileForest(OnGpu):
    """A tileset and the ground, on the GPU. A context manager: leaving releases."""

    def __init__(self, tileset: Tileset, ground: GroundMesh | None = None) -> None:
        self.tileset, self.ground = tileset, ground
        self.total = int(tileset.plants[0])
        self._landscape: Landscape | None = None
        self._held: dict[int, Held] = {}
        self._models: dict[Path, int] = {}
        self._plants: dict[Path, Plant] = {}
        self._images: dict[tuple[int, ...], Texture] = {}
        self._textures: Textures = {}

    def load(self, ctx: Context | None = None) -> Iterator[float]:
        """Make ready; tiles are loaded when they are seen."""
        self._landscape = Landscape(noise(), self.ground, ctx=ctx)
        yield 1.0

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._landscape is not None:
            self._landscape.release()
            self._landscape = None
        for texture in self._textures.values():
            texture.release()
        for kept in (self._textures, self._held, self._models, self._plants, self._images):
            kept.clear()

    @property
    def texture_bytes(self) -> int:
        """On the GPU, mips counted."""
        return sum(4 * t.width * t.height * 4 // 3 for t in self._textures.values())

    def draw(self, eye: Eye, size: tuple[int, int], look: Look = AS_IT_IS) -> FrameStats:
        """Draw into the framebuffer in use, and wait until that is done."""
        landscape = self._loaded("draw")
        started = perf_counter()
        tiles = self.choose(eye, size, look)
        chosen = perf_counter()
        drawn_frame = self._frame(eye, tiles, look)
        loaded = perf_counter()
        view = VIEWS.get(look.color, "painted")
        drawn = landscape.draw(
            drawn_frame, eye.shot(*size), look.light, view, wireframe=look.wireframe
        )
        seconds = {
            "choose": chosen - started,
            "load": loaded - chosen,
            "draw": perf_counter() - loaded,
        }
        return FrameStats(
            len(tiles), int(self.tileset.plants[tiles].sum()), self.total, len(drawn_frame.rows),
            drawn.draws, drawn.triangles, drawn.samples // MSAA, look.detail, seconds,
        )  # fmt: skip

    def picture(
        self,
        eye: Eye,
        size: tuple[int, int],
        look: Look = AS_IT_IS,
        supersample: int = 1,
        samples: int = MSAA,
    ) -> Picture:
        """What `draw` draws, as light and coverage, the ground too: see gl.landscape.picture."""
        landscape = self._loaded("picture")
        drawn = self._frame(eye, self.choose(eye, size, look), look)
        return picture(landscape, drawn, eye.shot(*size), look.light, supersample, samples)

    def choose(self, eye: Eye, size: tuple[int, int], look: Look) -> list[int]:
        """The tiles that are drawn, nearest first."""
        tiles, planes = self.tileset, eye.planes(*size)
        low, high = tiles.low - eye.position, tiles.high - eye.position
        middle, half = (low + high) / 2, (high - low) / 2
        reach = middle @ planes[:, :3].T + half @ np.abs(planes[:, :3]).T + planes[:, 3]
        seen: np.ndarray = np.asarray((reach >= 0).all(axis=1))
        near = np.maximum(np.linalg.norm(np.clip(0.0, low, high), axis=1), NEAREST_M)
        pixels = look.detail * tiles.error_m * eye.focal_px(size[1]) / near
        refined: np.ndarray = np.asarray(pixels > CLIENT_PX)
        if look.level is not None:  # 0 is the finest
            refined = tiles.depth < tiles.depth.max() - look.level
        found: list[int] = []
        waiting = [0]
        while waiting:
            tile = waiting.pop()
            if not seen[tile]:
                continue
            if refined[tile] and tiles.children[tile]:
                waiting += tiles.children[tile]
            else:
                found.append(tile)
        return sorted(found, key=lambda tile: float(near[tile]))

    def _loaded(self, what: str) -> Landscape:
        if self._landscape is None:
            raise ValueError(f"TileForest.{what}: load it first")
        return self._landscape

    def _frame(self, eye: Eye, tiles: list[int], look: Look) -> Frame:
        """Rows relative to the eye, a batch for each model of each tile."""
        parts, batches, first = [np.zeros(0, INSTANCE)], [], 0
        for tile in tiles:
            held = self._on_gpu(tile)
            away = (self.tileset.origin[tile] - eye.position).astype(np.float32)
            for rows, model, kind in zip(held.rows, held.models, held.kinds, strict=True):
                moved = rows.copy()
                moved["place"][:, :3] += away
                if look.color not in VIEWS:
                    which = self._level(tile) if look.color == "by level" else kind
                    moved["tint"] = PALETTE[which % len(PALETTE)]
                parts.append(moved)
                batches.append(Batch(model, first, len(rows), WHOLE))
                first += len(rows)
        return Frame(np.concatenate(parts), tuple(batches))

    def _on_gpu(self, tile: int) -> Held:
        if tile not in self._held:
            copies = read_tile(self.tileset.file[tile], self._model)
            rows = tuple(_rows(one) for one in copies)
            models = tuple(self._uploaded(one) for one in copies)
            kinds = tuple(_kind(one.file) for one in copies)
            self._held[tile] = Held(rows, models, kinds)
        return self._held[tile]

    def _level(self, tile: int) -> int:
        """0 for the finest tiles."""
        return int(self.tileset.depth.max() - self.tileset.depth[tile])

    def _model(self, path: Path) -> Plant:
        """A model that tiles share, read once."""
        if path not in self._plants:
            self._plants[path] = read_model(path)
        return self._plants[path]

    def _uploaded(self, copies: Copies) -> int:
        """The model's index in the landscape."""
        if copies.file not in self._models:
            landscape = self._loaded("draw")
            plant = self._with_images(copies.plant)
            added = landscape.add(plant, unordered(plant), shared=self._textures)
            self._models[copies.file] = added
        return self._models[copies.file]

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


def _kind(file: Path) -> int:
    """A number of the species, whichever level of it a shared model is: NAME_LOD1.gltf."""
    name, level, _ = file.stem.rpartition("_LOD")
    return 1 + zlib.crc32(name.encode()) % (len(PALETTE) - 1) if level else 0


def _rows(copies: Copies) -> np.ndarray:
    rows = np.zeros(len(copies.place), INSTANCE)
    rows["place"][:, :3], rows["place"][:, 3] = copies.place, copies.scale
    rows["turn"][:, 0], rows["turn"][:, 1] = np.cos(copies.yaw), np.sin(copies.yaw)
    rows["turn"][:, 2:] = WHOLE, 1.0
    rows["shown"] = ALL_TEXELS
    rows["tint"][:, :3] = np.clip(np.rint(127.5 * copies.tint), 0, 255)
    rows["tint"][:, 3] = 255
    return rows
