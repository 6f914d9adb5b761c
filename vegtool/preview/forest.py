"""A landscape to walk through: what stands where, kept as far as it is near, and drawn.

Tiles are culled as boxes in arrays; only tiles in view hold their plants, and no more of those than
were drawn lately (MOST_PLANTS), however large the landscape is.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.elements import Elements, ordered
from vegtool.gl.context import OnGpu
from vegtool.gl.draw import MSAA
from vegtool.gl.landscape import Frame, GroundMesh, Landscape, picture
from vegtool.gl.window_client import Context
from vegtool.preview.calibrate import corrected
from vegtool.preview.choice import (
    NO_LEVEL,
    Chosen,
    Kinds,
    Seen,
    chosen,
    frame,
    kinds_of,
    seen,
)
from vegtool.preview.correction import NONE, Correction
from vegtool.preview.eye import Eye
from vegtool.preview.fovea import factors
from vegtool.preview.options import FadeMode
from vegtool.preview.palette import PALETTE, Color
from vegtool.preview.points import point_batches
from vegtool.preview.reveal import noise
from vegtool.preview.scenery import AS_IT_IS, VIEWS, FrameStats, Look
from vegtool.preview.stock import Stock, stocked
from vegtool.surfels.blue.pieces import pieces
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Placement

MOST_PLANTS = 2_000_000
"""Plants that are kept: 90 MB."""
CALIBRATED_PX = 665.1
"""Pixels of a metre at a distance of one metre in pictures of 1024 x 768 and 60 degrees, for which
lengths are corrected: distances in pixels are what matters."""


class Forest(OnGpu):
    """Species, where they stand, and the ground, on the GPU. A context manager: leaving releases.

    Making one does nothing: `load` does, a bit at a time. sharp: without mips, for pictures that
    are supersampled, as of plants in full.
    """

    def __init__(
        self,
        species: Sequence[Species],
        placement: Placement,
        ground: GroundMesh | None = None,
        fade: FadeMode = "alpha-test",
        *,
        sharp: bool = False,
    ) -> None:
        self.species, self.placement = tuple(species), placement
        self.ground, self.fade, self.sharp = ground, fade, sharp
        self.total = int(placement.tiles.count.sum())
        own = np.array([one.height for one in species])
        tallest = placement.tallest(len(species))
        self._largest: FloatArray = np.fmax(1.0, tallest / own)
        self._landscape: Landscape | None = None
        self._elements: list[list[Elements]] = []
        self._models: list[list[int]] = []
        self._pieces: dict[int, list[int]] = {}
        self._corrections: list[Correction] = []
        self._kinds: dict[float, Kinds] = {}
        self._stocks: OrderedDict[int, Stock] = OrderedDict()
        self._levels: dict[int, np.ndarray] = {}
        self._kept = 0

    def load(self, ctx: Context | None = None) -> Iterator[float]:
        """Upload everything and compare what is drawn with the plants in full; yields the share
        that is done."""
        landscape = Landscape(noise(), self.ground, pixels_fade=self.fade == "dither", ctx=ctx)
        self._landscape = landscape
        total, done = 2 * sum(len(one.levels) for one in self.species), 0
        for one in self.species:
            self._elements.append([])
            self._models.append([])
            for level in one.levels:
                elements = ordered(level)
                self._elements[-1].append(elements)
                self._models[-1].append(landscape.add(level, elements, mipmaps=not self.sharp))
                done += 1
                yield done / total
            if one.surfels is not None:
                parts = [landscape.add_surfels(part) for part in pieces(one.surfels.read())]
                self._models[-1].append(parts[0])
                self._pieces[parts[0]] = parts
        if self.sharp:
            return
        plain = kinds_of(self.species, self._elements, self._models, CALIBRATED_PX)
        for index, one in enumerate(self.species):
            steps = corrected(
                plain, one, index, self._elements[index][0], landscape, self._pieces,
                CALIBRATED_PX, self.fade,
            )  # fmt: skip
            found = NONE
            for share, found in steps:  # noqa: B007  # the last one is the whole
                yield (done + share * len(one.levels)) / total
            done += len(one.levels)
            self._corrections.append(found)

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._landscape is not None:
            self._landscape.release()
            self._landscape = None

    @property
    def texture_bytes(self) -> int:
        """On the GPU."""
        return 0 if self._landscape is None else self._landscape.texture_bytes

    def draw(self, eye: Eye, size: tuple[int, int], look: Look = AS_IT_IS) -> FrameStats:
        """Draw into the framebuffer in use, and wait until that is done."""
        landscape = self._landscape
        if landscape is None:
            raise ValueError("Forest.draw: load it first")
        started = perf_counter()
        found, what, tiles = self.choose(eye, size, look)
        drawn_frame = self._frame(found, what, eye, size, look)
        chosen_at = perf_counter()
        view = VIEWS.get(look.color, "painted")
        drawn = landscape.draw(
            drawn_frame, eye.shot(*size), look.light, view, wireframe=look.wireframe
        )
        ended = perf_counter()
        return FrameStats(
            len(tiles),
            len(found.rows),
            self.total,
            len(what.of),
            drawn.draws,
            drawn.triangles,
            drawn.samples // MSAA,
            look.detail,
            {"choose": chosen_at - started, "draw": ended - chosen_at},
            (f"{drawn.surfels:,} surfels",) if drawn.surfels else (),
        )

    def picture(
        self,
        eye: Eye,
        size: tuple[int, int],
        look: Look = AS_IT_IS,
        supersample: int = 1,
        samples: int = MSAA,
    ) -> Picture:
        """What `draw` draws, as light and coverage, the ground too: see gl.landscape.picture."""
        landscape = self._landscape
        if landscape is None:
            raise ValueError("Forest.picture: load it first")
        found, what, _ = self.choose(eye, size, look)
        drawn = self._frame(found, what, eye, size, look)
        return picture(landscape, drawn, eye.shot(*size), look.light, supersample, samples)

    def choose(
        self, eye: Eye, size: tuple[int, int], look: Look
    ) -> tuple[Seen, Chosen, np.ndarray]:
        """The plants that are seen, the levels to draw, and the tiles in which they stand."""
        kinds = self._kinds_for(eye.focal_px(size[1]))
        planes = eye.planes(*size)
        tiles, near = self._tiles_seen(eye, planes, kinds)
        stocks = [self._stock(int(tile), kinds) for tile in tiles]
        found = seen(stocks, near, eye.position, planes, kinds, look.detail)
        if self.fade != "none" or look.level is not None:
            return found, chosen(found, kinds, look.detail, self.fade, look.level), tiles
        kept = [
            self._levels_of(int(tile), len(stock.rows))[:count]
            for tile, stock, count in zip(tiles, stocks, found.counts, strict=True)
        ]
        before = np.concatenate([np.zeros(0, np.uint8), *kept])
        what = chosen(found, kinds, look.detail, self.fade, None, before[found.index])
        before[found.index] = what.level[: len(found.rows)]
        ends = np.cumsum(found.counts)
        for levels, end in zip(kept, ends, strict=True):
            levels[:] = before[end - len(levels) : end]
        return found, what, tiles

    def _frame(
        self, found: Seen, what: Chosen, eye: Eye, size: tuple[int, int], look: Look
    ) -> Frame:
        assert self._landscape is not None
        paint, focal = self._paint(found, what, look.color), eye.focal_px(size[1])
        if not what.points.any():
            return frame(found, what, paint)
        kinds, stock = self._kinds_for(focal), found.rows
        size_px = np.full(len(stock), look.surfel_px)
        if look.fovea is not None:
            kind, scale = stock["species"], stock["scale"]
            middle = found.place.astype(np.float64)
            middle[:, 1] += scale * kinds.center[kind]
            size_px *= factors(look.fovea, middle, scale * kinds.radius[kind], eye, size)
        points = point_batches(self._landscape, self._pieces, found, what, focal, size_px, paint)
        return replace(frame(found, what, paint), points=points)

    def _paint(self, found: Seen, what: Chosen, color: Color) -> np.ndarray | None:
        if color in VIEWS:
            return None
        which = what.level if color == "by level" else found.rows["species"][what.of]
        return np.asarray(PALETTE[which % len(PALETTE)])

    def _tiles_seen(
        self, eye: Eye, planes: FloatArray, kinds: Kinds
    ) -> tuple[np.ndarray, FloatArray]:
        """The tiles whose plants may be in view, nearest first, and how near they are."""
        tiles = self.placement.tiles
        margin = float((self._largest * (kinds.radius + np.abs(kinds.center))).max())
        low, high = tiles.low - eye.position - margin, tiles.high - eye.position + margin
        near = np.linalg.norm(np.clip(0.0, low, high), axis=1)
        middle, half = (low + high) / 2, (high - low) / 2
        reach = middle @ planes[:, :3].T + half @ np.abs(planes[:, :3]).T + planes[:, 3]
        index = np.flatnonzero((reach >= 0).all(axis=1))
        index = index[np.argsort(near[index], kind="stable")]
        return index, near[index]

    def _kinds_for(self, focal_px: float) -> Kinds:
        if focal_px not in self._kinds:
            self._kinds.clear()
            self._stocks.clear()
            self._kept = 0
            plain = kinds_of(self.species, self._elements, self._models, focal_px)
            self._kinds[focal_px] = replace(plain, corrections=tuple(self._corrections))
        return self._kinds[focal_px]

    def _stock(self, tile: int, kinds: Kinds) -> Stock:
        if tile in self._stocks:
            self._stocks.move_to_end(tile)
            return self._stocks[tile]
        made = stocked(self.placement.plants(tile), self.species, kinds.thinned_m)
        self._stocks[tile] = made
        self._kept += len(made.rows)
        while self._kept > MOST_PLANTS and len(self._stocks) > 1:
            old, gone = self._stocks.popitem(last=False)
            self._levels.pop(old, None)
            self._kept -= len(gone.rows)
        return made

    def _levels_of(self, tile: int, count: int) -> np.ndarray:
        """(count,) uint8 the level that each plant of a tile was last drawn at."""
        if tile not in self._levels:
            self._levels[tile] = np.full(count, NO_LEVEL, np.uint8)
        return self._levels[tile]
