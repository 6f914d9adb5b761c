"""A tileset drawn as clients draw it: a tile until its error can be seen, then its quarters.

Source: OGC 22-025r4, 3D Tiles 1.1, section 6.3: refinement REPLACE, geometric error in pixels.
Tiles are read when they are first drawn, and kept as far as there is room (tile_store.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter

import numpy as np

from vegtool.arrays import Picture
from vegtool.gl.context import OnGpu
from vegtool.gl.draw import MSAA
from vegtool.gl.instances import INSTANCE, WHOLE
from vegtool.gl.landscape import Batch, Frame, GroundMesh, Landscape, picture
from vegtool.gl.window_client import Context
from vegtool.preview.eye import Eye
from vegtool.preview.palette import PALETTE
from vegtool.preview.reveal import noise
from vegtool.preview.scenery import AS_IT_IS, VIEWS, FrameStats, Look
from vegtool.preview.tile_store import TileStore
from vegtool.preview.tileset import Tileset

NEAREST_M = 0.1
"""An eye in a tile's box is no nearer."""


class TileForest(OnGpu):
    """A tileset and the ground, on the GPU. A context manager: leaving releases."""

    def __init__(self, tileset: Tileset, ground: GroundMesh | None = None) -> None:
        self.tileset, self.ground = tileset, ground
        self.total = int(tileset.plants[0])
        self._landscape: Landscape | None = None
        self._store: TileStore | None = None

    def load(self, ctx: Context | None = None) -> Iterator[float]:
        """Make ready; tiles are loaded when they are seen."""
        self._landscape = Landscape(noise(), self.ground, ctx=ctx)
        self._store = TileStore(self.tileset, self._landscape)
        yield 1.0

    def release(self) -> None:
        """Free everything on the GPU."""
        for kept in (self._store, self._landscape):
            if kept is not None:
                kept.release()
        self._store = self._landscape = None

    @property
    def texture_bytes(self) -> int:
        """On the GPU, mips counted."""
        return 0 if self._store is None else self._store.texture_bytes

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
        found, away = [np.zeros(0, np.int64)], [np.zeros(0)]
        front = np.zeros(1, np.int64)
        while len(front):  # level by level: what is not seen or not refined hides all below
            low, high = tiles.low[front] - eye.position, tiles.high[front] - eye.position
            middle, half = (low + high) / 2, (high - low) / 2
            reach = middle @ planes[:, :3].T + half @ np.abs(planes[:, :3]).T + planes[:, 3]
            seen: np.ndarray = np.asarray((reach >= 0).all(axis=1))
            front, low, high = front[seen], low[seen], high[seen]
            near = np.maximum(np.linalg.norm(np.clip(0.0, low, high), axis=1), NEAREST_M)
            pixels = look.detail * tiles.error_m[front] * eye.focal_px(size[1]) / near
            refined: np.ndarray = np.asarray(pixels > tiles.seen_px)
            if look.level is not None:  # 0 is the finest
                refined = tiles.depth[front] < tiles.deepest - look.level
            first, end = tiles.children[front].T
            refined = (refined & (first < end)) | ~tiles.shown[front]
            found.append(front[~refined])
            away.append(near[~refined])
            front = tiles.below(front[refined])
        order = np.argsort(np.concatenate(away), kind="stable")
        return [int(tile) for tile in np.concatenate(found)[order]]

    def _loaded(self, what: str) -> Landscape:
        if self._landscape is None:
            raise ValueError(f"TileForest.{what}: load it first")
        return self._landscape

    def _frame(self, eye: Eye, tiles: list[int], look: Look) -> Frame:
        """Rows relative to the eye, a batch for each model of each tile."""
        store = self._store
        assert store is not None, "a landscape is loaded with its tiles"
        parts, batches, first = [np.zeros(0, INSTANCE)], [], 0
        for tile, held in zip(tiles, store.held(tiles), strict=True):
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

    def _level(self, tile: int) -> int:
        """0 for the finest tiles."""
        return self.tileset.deepest - int(self.tileset.depth[tile])
