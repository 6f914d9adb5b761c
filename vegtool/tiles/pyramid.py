"""What tiles are made of: plants, where they stand, and from where each square is seen.

A square takes over from its quarters at FROM times its own side: whatever the level, as many pixels
of a picture then show a square, and as many squares fill it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from hashlib import blake2b
from math import ceil, log
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.formats.tileset import CLIENT_PX
from vegtool.lod import Display
from vegtool.progress import Progress, silent
from vegtool.scene import Scene
from vegtool.tiles.georeference import earth_from_scene, notes_on
from vegtool.tiles.levels import level_at, switches, triangles
from vegtool.tiles.library import Species
from vegtool.tiles.limits import of_any_eye, without_original
from vegtool.tiles.options import TileOptions
from vegtool.tiles.placement import Placement, placement_of
from vegtool.tiles.prepare import prepare
from vegtool.tiles.quadtree import Node, Quadtree, quadtree_of
from vegtool.tiles.samples import Sample, samples_of
from vegtool.tiles.species import folder_of
from vegtool.tiles.stand import Stand, stand_on
from vegtool.tiles.terrain import terrain_of

FROM = 1.0
"""Sides of a square: from where on it is drawn."""
NEAREST = 0.5
"""Sides of a tile: distance that its plants' levels are for, where nothing is nearer."""
HANDFUL = 16
"""Triangles of a square so far away that it needs no square beyond."""
PER_PLANT = 4
"""Triangles that are enough of any plant from afar."""
FEWEST, MOST = 1_000, 200_000
"""Surfels of a square."""


@dataclass(frozen=True, eq=False)
class Pyramid:
    """display: of the client that tiles are made for. samples: of species, where squares are
    surfels."""

    placement: Placement
    species: tuple[Species, ...]
    tree: Quadtree
    options: TileOptions
    display: Display
    notes: tuple[str, ...] = ()
    samples: tuple[Sample, ...] = ()
    _digests: dict[tuple[int, int], str] = field(default_factory=dict, repr=False)

    @cached_property
    def placed(self) -> FloatArray | None:
        """(4, 4) from the scene's frame, z up, to the earth's; None where it has no place there."""
        tiles = self.placement.tiles
        middle = float(tiles.low[:, 1].min() + tiles.high[:, 1].max()) / 2
        return earth_from_scene(self.placement.crs, self.placement.origin, middle)

    @cached_property
    def switch_m(self) -> FloatArray:
        """(s, l) metres."""
        return switches(self.species, self.display)

    @cached_property
    def of_level(self) -> FloatArray:
        """(s, l) triangles."""
        return triangles(self.species)

    @cached_property
    def level_error_m(self) -> FloatArray:
        """(s, l) metres, of plants of scale 1; NaN where it is not known, or there is no level."""
        found = np.full(self.of_level.shape, np.nan)
        for index, one in enumerate(self.species):
            found[index, : len(one.levels)] = one.error_m
        return found

    def digest(self, kind: int, level: int) -> str:
        """Of a species' level, and of where it may be used."""
        if (kind, level) not in self._digests:
            one = self.species[kind]
            found = blake2b(one.files[level].read_bytes(), digest_size=16)
            told = (float(one.switch_m[level]), float(one.error_m[level]), one.focal_px)
            found.update(repr(told).encode())
            self._digests[kind, level] = found.hexdigest()
        return self._digests[kind, level]

    def from_m(self, height: int) -> float:
        """Metres from which on squares of a height are drawn."""
        return FROM * self.tree.side_m * 2.0**height if height else 0.0

    def made_for_m(self, height: int) -> float:
        """Metres that the levels of the plants are chosen for."""
        return self.from_m(height) or NEAREST * self.tree.side_m

    def error_m(self, height: int) -> float:
        """What a client takes a square of that height to be wrong by: CLIENT_PX where it takes
        over."""
        return CLIENT_PX / self.display.pixels_per_metre(1.0) * self.from_m(height)

    def instanced(self, height: int) -> bool:
        """Whether plants are instances of models."""
        return height < self.options.near

    @property
    def top(self) -> int:
        """Height of the blocks, whose squares are made together."""
        return min(self.options.near, self.tree.depth)

    def finest(self, height: int) -> int:
        """Level of which all others are coarser. The original is for the smallest tiles: it may
        repeat its textures, which merged groups cannot."""
        return 0 if height == 0 else 1

    def surfels_for(self, full: float, alone: int | None = None) -> int:
        """How many stand for plants of so many triangles in full, if as many are seen; a quarter of
        those of a square's only quarter, where it has one alone."""
        most = MOST if alone is None else min(MOST, max(FEWEST, alone // 4))
        return int(np.clip(full // 2, FEWEST, most))

    def budget(self, node: Node) -> int:
        """Triangles of a square, at most: fewer where there are fewer tiles on it."""
        covered = len(self.tree.tiles_of(node)) / 4.0 ** self.tree.height(node.level)
        return max(HANDFUL, round(covered * self.options.triangles))

    def stand(self, node: Node) -> Stand:
        """The plants on a square."""
        return stand_on(self.placement, self.tree.tiles_of(node), self.species)

    def bounds(self, node: Node) -> FloatArray:
        """(2, 3) metres in the scene's frame: nothing that stands on the square is outside."""
        tiles, which = self.placement.tiles, self.tree.tiles_of(node)
        low, high = tiles.low[which].min(axis=0), tiles.high[which].max(axis=0)
        return np.stack([low + self._around[0], high + self._around[1]])

    def origin(self, node: Node) -> FloatArray:
        """(3,) metres in the scene's frame: what a tile's vertices are relative to."""
        x, z = self.tree.middle(node)
        low, high = self.bounds(node)[:, 1]
        return np.array([x, round((low + high) / 2, 3), z])

    @cached_property
    def largest(self) -> FloatArray:
        """(s,) scale that no plant of each species is above."""
        own = np.array([one.height for one in self.species])
        known = self.placement.tallest(len(own)) / own
        alone = self.placement.measured(len(own)) & np.isfinite(known)
        # plants without a height are as tall as their model
        return np.asarray(np.where(alone, known, np.fmax(1.0, known)))

    @cached_property
    def reach_m(self) -> FloatArray:
        """(s,) metres to a side of its foot that no plant of each species reaches beyond."""
        aside = [np.abs(one.bounds[:, :, [0, 2]]).max(axis=(0, 1)) for one in self.species]
        return np.asarray(self.largest * np.hypot(*np.array(aside).T))

    @cached_property
    def _around(self) -> FloatArray:
        """(2, 3) metres around a foot that no plant is beyond, however it is turned."""
        found = np.zeros((2, 3))
        for one, scale, aside in zip(self.species, self.largest, self.reach_m, strict=True):
            low, high = scale * one.bounds[:, 0, 1].min(), scale * one.bounds[:, 1, 1].max()
            found[0] = np.minimum(found[0], [-aside, low, -aside])
            found[1] = np.maximum(found[1], [aside, high, aside])
        return found

    def finest_at(self, height: int, times: float = 1.0) -> list[int]:
        """The finest level of each species that a square of that height may show, from so many
        times as far away as it may be seen."""
        count = len(self.species)
        each = Stand(
            np.zeros((count, 3)), np.arange(count, dtype=np.int32), self.largest, np.zeros(count),
            np.ones((count, 3), np.float32), np.arange(count), np.zeros(count, np.int64),
        )  # fmt: skip
        away = self.made_for_m(height) * times
        found = level_at(each, self.switch_m, away, self.finest(height))
        return [int(level) for level in found]


def pyramid_of(
    scene: Scene,
    library: Path,
    options: TileOptions,
    progress: Progress = silent,
    workers: int = 1,
) -> Pyramid:
    """The pyramid of a scene with the plants of a library.

    Raises UsageError and InputError for what is missing or broken.
    """
    terrain = terrain_of(scene)
    placement = placement_of(scene, terrain, options.tile, lambda s, f: progress(s, f / 2))
    if not len(placement.tiles):
        raise UsageError(
            f"{scene.path}: expected plants, found none that stands on the ground of the scene. "
            "Check [placement], and where [[species]] may grow"
        )
    found = prepare(scene, placement, library, workers, lambda s, f: progress(s, (1 + f) / 2))
    placement = found.placement
    samples: tuple[Sample, ...] = ()
    if options.surfels:
        folder = folder_of(library)
        samples = samples_of(found.species, folder, workers, lambda s, f: progress(s, 1.0))
    tree = quadtree_of(placement.tiles, placement.tile_m, _above(placement, options))
    display = Display()
    lacks = of_any_eye(found.species, display.pixels_per_metre(1.0), scene)
    if options.surfels:
        lacks += [f"{one.name}: {note}" for one in found.species for note in without_original(one)]
    notes = (*terrain.notes, *placement.notes, *notes_on(terrain, placement), *found.notes, *lacks)
    return Pyramid(placement, found.species, tree, options, display, notes, samples)


def _above(placement: Placement, options: TileOptions) -> int:
    """Levels above the least square that holds all tiles, until a handful of triangles is enough of
    it, or the fewest surfels."""
    least = quadtree_of(placement.tiles, placement.tile_m)
    covered = len(placement.tiles) / 4.0**least.depth
    if options.surfels:
        return ceil(log(MOST / FEWEST, 4))
    wanted = min(covered * options.triangles, PER_PLANT * float(placement.tiles.count.sum()))
    return max(0, ceil(log(wanted / HANDFUL, 4)))


def used_levels(pyramid: Pyramid, height: int, times: float = 1.0) -> list[tuple[int, int]]:
    """Species and levels that squares of that height may show from so many times as far away, in
    order."""
    return [
        (kind, level)
        for kind, finest in enumerate(pyramid.finest_at(height, times))
        for level in range(finest, len(pyramid.species[kind].levels))
    ]
