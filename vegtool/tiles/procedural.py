"""Plants placed by rules: one pattern of points, repeated over the landscape; nothing is stored.

The pattern is a square of points spread evenly in a progressive order (blue_noise.py), repeated
with the period at which its least distance is `spacing_m`. As in J. Kopf, D. Cohen-Or, O. Deussen
and D. Lischinski, "Recursive Wang tiles for real-time blue noise", SIGGRAPH 2006, a threshold on
the rank of a point makes the pattern less dense and leaves it even: species have intervals of
ranks, the tallest first, and grow as far up in them as the density map, the slope and the elevation
say. What each plant is like comes from a hash of its period and its number in the pattern
(hashing.py), so that it does not depend on which tile is made, when, or how much of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log2
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.progress import Progress
from vegtool.scene import Scene
from vegtool.tiles.hashing import draws, hashes, key
from vegtool.tiles.pattern import (
    Pattern,
    first_period,
    least_distance,
    part_of_period,
    pattern,
    slacks,
)
from vegtool.tiles.placement import BoolArray, LongArray, Plants, Tiles
from vegtool.tiles.rules import Rules, rules_of
from vegtool.tiles.terrain import Terrain
from vegtool.tiles.variation import DRAWS, heights, tints, yaws

SMALLEST, LARGEST = -5, 2
"""Powers of two: periods along the side of a tile. Of 32 tiles on a period each has 4 plants; a
tile of 4 periods has 65,536."""
MOST_TILES = 4_000_000
"""Half a gigabyte of bounds."""
AT_ONCE = 2**20
"""Points of tiles on the edge that are looked at at a time."""
CHUNK = 8192
"""Points that are tried at a time, where the first plants of a tile are asked for."""
HALF = 2**24
"""Periods on either side of the origin that the number of a plant can tell apart."""


@dataclass(frozen=True, eq=False)
class Procedural:
    """A Placement whose plants are made when they are asked for.

    period_m: metres after which the pattern repeats. scale: a tile's side is 2^scale periods.
    column, row: (t,) int64 of each tile, counted from the scene's origin along x and z.
    """

    tile_m: float
    period_m: float
    scale: int
    origin: FloatArray
    tiles: Tiles
    column: LongArray
    row: LongArray
    seed: int
    rules: Rules
    terrain: Terrain
    notes: tuple[str, ...] = ()

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of `origin`."""
        return None if self.terrain.origin is None else self.terrain.crs

    def tallest(self, count: int) -> FloatArray:
        """(count,) metres that no plant of each species is taller than; NaN: the model's own."""
        limits = [table.height_m for table in self.rules.tables[:count]]
        return np.array([np.nan if limit is None else limit[1] for limit in limits])

    def measured(self, count: int) -> BoolArray:
        """(count,) bool, whether all plants of each species have a height of their own."""
        return np.array([table.height_m is not None for table in self.rules.tables[:count]])

    def plants(self, tile: int, most: int | None = None) -> Plants:
        """The plants of a tile, 0..t-1, or the first `most` of them."""
        where = int(self.column[tile]), int(self.row[tile])
        points = pattern(self.scale, *part_of_period(self.scale, *where))
        corner = np.array(first_period(self.scale, *where))
        origin = (self.tiles.low[tile] + self.tiles.high[tile]) / 2
        wanted = len(points) if most is None else most
        found = [self._standing(points, slice(0, 0), corner, origin)]
        for start in range(0, len(points), CHUNK):
            if sum(len(part[0]) for part in found) >= wanted:
                break
            found.append(self._standing(points, slice(start, start + CHUNK), corner, origin))
        arrays: list[Any] = [np.concatenate(part)[:wanted] for part in zip(*found, strict=True)]
        return Plants(origin, *arrays)

    def _standing(
        self, points: Pattern, part: slice, corner: LongArray, origin: FloatArray
    ) -> tuple[np.ndarray, ...]:
        """Of a part of a tile's points those where plants stand, as the arrays of Plants are."""
        rank, index = points.rank[part], points.index[part]
        species = self.rules.species(rank)
        period = points.period[part] + corner
        random = draws(hashes(_period_keys(self.seed, period), index), DRAWS + 2)
        moved = _shifts(random[DRAWS:], points.slack[part])
        xz = (points.place[part] + corner + moved) * self.period_m
        ground = self.terrain.height(xz)
        share = self.rules.share(self.terrain, xz, ground, species)
        stands = self.terrain.inside(xz) & (self.rules.level(rank, species) < share)
        xyz = np.stack([xz[:, 0], ground, xz[:, 1]], axis=1)[stands]
        own, kind = random[:DRAWS, stands], species[stands]
        tall = heights(own, kind, self.rules.tables)
        number = _numbers(period[stands], index[stands])
        return (xyz - origin).astype(np.float32), kind, yaws(own), tall, tints(own), number


def place(scene: Scene, terrain: Terrain, tile_m: float, progress: Progress) -> Procedural:
    """Plants at least `spacing_m` from each other, all over the extent: see `placement_of`.

    Distances hold to the rounding of float32, a hundredth of a millimetre.
    """
    spacing, at = scene.placement.spacing_m, scene.at("placement", "spacing_m")
    assert spacing is not None
    if terrain.extent is None:
        raise UsageError(
            f"{at}: expected extent_m in [terrain], as plants are placed all over it; got none"
        )
    progress("placement", 0.0)
    rules, notes = rules_of(scene, terrain)
    period = spacing / least_distance()
    scale = int(np.clip(round(log2(tile_m / period)), SMALLEST, LARGEST))
    side = period * 2.0**scale
    ends = np.ceil(terrain.extent / 2 / side)  # tiles on either side of the origin
    if (2 * ends).prod() > MOST_TILES:
        raise UsageError(
            f"{at}: expected at most {MOST_TILES:,} tiles, got {(2 * ends).prod():.2g}, for "
            f"{spacing:g} m between plants on {terrain.extent[0]:g} x {terrain.extent[1]:g} m; "
            "ask for more between them, or for less ground"
        )
    x, z = (np.arange(-int(end), int(end)) for end in ends)
    low, high, shares = _bounds(terrain, rules, x, z, side, float(slacks().max()) * period)
    column, row = (axis.ravel() for axis in np.meshgrid(x, z))
    counts = _counts(terrain, rules, shares, scale, period, column, row)
    there = counts > 0
    if not there.any():
        raise UsageError(
            f"{scene.at('species')}: expected a species that grows somewhere; slope_deg, "
            "elevation_m and density leave no place to any; widen them"
        )
    progress("placement", 1.0)
    return Procedural(
        side,
        period,
        scale,
        np.zeros(3) if terrain.origin is None else terrain.origin,
        Tiles(low[there], high[there], counts[there], np.stack([column, row], axis=1)[there]),
        column[there],
        row[there],
        scene.placement.seed or 0,
        rules,
        terrain,
        notes,
    )


def _period_keys(seed: int, period: LongArray) -> Any:
    """(n,) uint64 states, each of the period that a point is in."""
    if not len(period):
        return np.empty(0, dtype=np.uint64)
    first = period.min(axis=0)
    across, along = period.max(axis=0) - first + 1
    x, z = int(first[0]), int(first[1])
    keys = [[key(seed, x + i, z + j) for j in range(along)] for i in range(across)]
    return np.array(keys, dtype=np.uint64)[tuple((period - first).T)]


def _numbers(period: LongArray, index: LongArray) -> LongArray:
    """(n,) which plants they are, whatever the extent: their periods' and their own numbers."""
    x, z = (period + HALF).T
    return np.asarray((x << 37) | (z << 12) | index)


def _shifts(random: FloatArray, slack: FloatArray) -> FloatArray:
    """(n, 2) anywhere on disks of these radii, from draws (2, n)."""
    angle, radius = 2 * np.pi * random[0], slack * np.sqrt(random[1])
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _bounds(
    terrain: Terrain,
    rules: Rules,
    x: np.ndarray,
    z: np.ndarray,
    side: float,
    reach: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Low and high (t, 3) metres, and greatest shares (t, s), of tiles in columns x and rows z;
    plants are moved by `reach` metres at most."""
    assert terrain.extent is not None
    across, along = (
        np.clip(np.stack([n * side - reach, (n + 1) * side + reach], axis=1), -half, half)
        for n, half in zip((x, z), terrain.extent / 2, strict=True)
    )
    ground = terrain.heights_within(across, along)
    corners = []
    for end, height in enumerate(ground):
        flat = np.meshgrid(across[:, end], along[:, end])
        corners.append(np.stack([flat[0], height, flat[1]], axis=-1).reshape(-1, 3))
    shares = rules.greatest_share(across, along, *ground)
    return corners[0], corners[1], shares.reshape(len(corners[0]), -1)


def _counts(
    terrain: Terrain,
    rules: Rules,
    shares: FloatArray,
    scale: int,
    period: float,
    column: LongArray,
    row: LongArray,
) -> LongArray:
    """(t,) how many plants a tile has at most: as many of its points as can lie on the extent, and
    lie lower in their species' interval than the greatest share (t, s) of it that grows there."""
    assert terrain.extent is not None
    half = terrain.extent / 2 / period
    corner, side = np.stack([column, row], axis=1) * 2.0**scale, 2.0**scale
    most = float(slacks().max())
    cut = np.any((corner - most < -half) | (corner + side + most > half), axis=1)
    counts = np.zeros(len(column), dtype=np.int64)
    parts = 2 ** max(-scale, 0)
    for along in range(parts):
        for across in range(parts):
            here = np.flatnonzero((column % parts == across) & (row % parts == along))
            points = pattern(scale, across, along)
            species = rules.species(points.rank)
            level = rules.level(points.rank, species)
            whole = here[~cut[here]]
            grows, found = shares[whole].T, np.zeros(len(whole), dtype=np.int64)
            for kind in range(len(rules.tables)):
                ordered = np.sort(level[species == kind])
                found += np.searchsorted(ordered, grows[kind], side="left")
            counts[whole] = found
            at_once = max(AT_ONCE // len(points), 1)
            for start in range(0, np.count_nonzero(cut[here]), at_once):
                tiles = here[cut[here]][start : start + at_once]
                first = np.floor(np.stack([column[tiles], row[tiles]], axis=1) * 2.0**scale)
                away = np.abs(points.place + first[:, None]) - points.slack[:, None]
                on = (away <= half).all(axis=2) & (level < shares[tiles][:, species])
                counts[tiles] = np.count_nonzero(on, axis=1)
    return counts
