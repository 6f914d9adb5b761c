"""A tileset drawn as clients draw it: a tile until its error can be seen, then its quarters.

Source: OGC 22-025r4, 3D Tiles 1.1, section 6.3: refinement REPLACE, geometric error in pixels.
Tiles are read when they are first drawn, and kept as far as there is room (tile_store.py).

Tiles of surfels are drawn as Brandt et al., Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 4, have it: as many as pixels at what is nearest of them
ask for, and before a tile gives way to its quarters, fewer and fewer, while there are more and more
of the quarters'.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.formats.tileset import BLENDED
from vegtool.gl.context import OnGpu
from vegtool.gl.draw import MSAA
from vegtool.gl.instances import INSTANCE, WHOLE
from vegtool.gl.landscape import Batch, Frame, GroundMesh, Landscape, PointBatch, picture
from vegtool.gl.window_client import Context
from vegtool.preview.eye import Eye
from vegtool.preview.fovea import factors
from vegtool.preview.palette import PALETTE
from vegtool.preview.reveal import noise
from vegtool.preview.scenery import AS_IT_IS, VIEWS, FrameStats, Look
from vegtool.preview.tile_store import Held, TileStore
from vegtool.preview.tileset import LongArray, Tileset

NEAREST_M = 0.1
"""An eye in a tile's box is no nearer."""


@dataclass(frozen=True, eq=False)
class Shown:
    """n tiles, nearest first. tile: (n,) int64. share: (n,) 0 to 1, of the surfels of each that
    are drawn; what is not surfels is drawn whole. below: (n,) bool, whether one that it is below is
    drawn, too."""

    tile: LongArray
    share: FloatArray
    below: np.ndarray


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
        tiles = self.chosen(eye, size, look)
        chosen = perf_counter()
        drawn_frame = self._frame(eye, size, tiles, look)
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
        said = [f"{drawn.surfels:,} surfels"] if drawn.surfels else []
        made = self.tileset.made_for
        if made is not None and made.is_outside(eye, size[1]):
            said.append(f"not where {made.file} has eyes: tiles are missing")
        return FrameStats(
            len(tiles.tile), int(self.tileset.plants[tiles.tile[~tiles.below]].sum()), self.total,
            len(drawn_frame.rows) + len(drawn_frame.points),
            drawn.draws, drawn.triangles, drawn.samples // MSAA, look.detail, seconds,
            tuple(said),
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
        drawn = self._frame(eye, size, self.chosen(eye, size, look), look)
        return picture(landscape, drawn, eye.shot(*size), look.light, supersample, samples)

    def choose(self, eye: Eye, size: tuple[int, int], look: Look) -> list[int]:
        """The tiles that are drawn, nearest first."""
        return [int(tile) for tile in self.chosen(eye, size, look).tile]

    def chosen(self, eye: Eye, size: tuple[int, int], look: Look) -> Shown:
        """The same, and how much of each is drawn."""
        tiles, planes = self.tileset, eye.planes(*size)
        found: list[tuple[np.ndarray, ...]] = []
        front = np.zeros(1, np.int64)
        share, below = np.ones(1), np.zeros(1, np.bool_)
        while len(front):  # level by level: what is not seen or not refined hides all below
            low, high = tiles.low[front] - eye.position, tiles.high[front] - eye.position
            middle, half = (low + high) / 2, (high - low) / 2
            reach = middle @ planes[:, :3].T + half @ np.abs(planes[:, :3]).T + planes[:, 3]
            seen: np.ndarray = np.asarray((reach >= 0).all(axis=1))
            front, low, high = front[seen], low[seen], high[seen]
            share, below = share[seen], below[seen]
            near = np.maximum(np.linalg.norm(np.clip(0.0, low, high), axis=1), NEAREST_M)
            pixels = look.detail * tiles.error_m[front] * eye.focal_px(size[1]) / near
            refined: np.ndarray = np.asarray(pixels > tiles.seen_px)
            if look.level is not None:  # 0 is the finest
                refined = tiles.depth[front] < tiles.deepest - look.level
            first, end = tiles.children[front].T
            refined = (refined & (first < end)) | ~tiles.shown[front]
            left = np.where(refined, 0.0, 1.0)  # of the way along which both are drawn
            if look.level is None:
                blended = ~refined & (tiles.surfels[front] > 0) & (first < end)
                way = (tiles.seen_px / np.maximum(pixels, 1e-9) - 1) / BLENDED
                left[blended] = np.clip(way, 0.0, 1.0)[blended]
            own, others = np.minimum(2 * left, 1.0), np.minimum(2 * (1 - left), 1.0)
            drawn = ~refined & (own > 0)
            found.append((near[drawn], front[drawn], (share * own)[drawn], below[drawn]))
            on = others > 0
            count = (end - first)[on]
            share = np.repeat((share * others)[on], count)
            below = np.repeat(below[on] | drawn[on], count)
            front = tiles.below(front[on])
        away, tile, share, below = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.argsort(away, kind="stable")
        return Shown(tile[order], share[order], below[order])

    def _loaded(self, what: str) -> Landscape:
        if self._landscape is None:
            raise ValueError(f"TileForest.{what}: load it first")
        return self._landscape

    def _frame(self, eye: Eye, size: tuple[int, int], tiles: Shown, look: Look) -> Frame:
        """Rows relative to the eye, a batch for each model of each tile, and its surfels."""
        store = self._store
        assert store is not None, "a landscape is loaded with its tiles"
        parts, batches, first = [np.zeros(0, INSTANCE)], [], 0
        points = []
        numbers = tiles.tile.tolist()
        for tile, share, held in zip(numbers, tiles.share, store.held(numbers), strict=True):
            if held.surfels is not None:
                points.append(self._points(eye, size, tile, share, held, look))
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
        return Frame(np.concatenate(parts), tuple(batches), tuple(points))

    def _points(
        self, eye: Eye, size: tuple[int, int], tile: int, share: float, held: Held, look: Look
    ) -> PointBatch:
        """A share of the surfels that pixels at what is nearest of a tile ask for."""
        assert self._landscape is not None and held.surfels is not None
        buffers = self._landscape.surfels(held.surfels)
        away = self.tileset.origin[tile] - eye.position
        low, high = held.bounds + away
        pixel = np.linalg.norm(np.clip(0.0, low, high)) / eye.focal_px(size[1]) * look.surfel_px
        if look.fovea is not None:
            reach = np.array([np.linalg.norm(high - low) / 2])
            pixel *= factors(look.fovea, (low + high)[None] / 2, reach, eye, size)[0]
        prefix, radius = buffers.surfels.discs(np.array([pixel / 2]))
        tint = None
        if look.color not in VIEWS:
            which = self._level(tile) if look.color == "by level" else 0
            tint = PALETTE[None, which % len(PALETTE)]
        rows = buffers.instances(
            np.zeros(3), away[None], np.zeros(1), np.ones(1), radius, None, tint
        )
        return PointBatch(held.surfels, rows, np.ceil(share * prefix).astype(np.int32))

    def _level(self, tile: int) -> int:
        """0 for the finest tiles."""
        return self.tileset.deepest - int(self.tileset.depth[tile])
