"""Plants with levels and places for them, made by hand, that the tests of walks share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from cards import cards, texture, together

from vegtool.arrays import FloatArray, unit
from vegtool.elements import Elements, ordered
from vegtool.plant import Material, Plant
from vegtool.preview.choice import Kinds, kinds_of
from vegtool.preview.eye import Eye
from vegtool.preview.stock import Stock, stocked
from vegtool.preview.world import World
from vegtool.seeding import generator
from vegtool.tiles.library import Species
from vegtool.tiles.placement import BoolArray, Plants, Tiles
from vegtool.tiles.terrain import Terrain

FOCAL_PX = 300.0
"""Of a metre at a distance of one metre, in the pictures that distances are stated for."""


def leaf_picture(size: int = 32) -> np.ndarray:
    """A leaf with a paler rib, clear around."""
    y, x = (np.mgrid[:size, :size] + 0.5) / size * 2 - 1
    image = np.empty((size, size, 4))
    image[..., :3] = np.where(np.abs(x)[..., None] < 0.06, (120, 175, 80), (70, 130, 45))
    image[..., 3] = 255 * np.clip(size / 4 * (1 - np.hypot(x / 0.8, y)) + 0.5, 0, 1)
    return image


PICTURE = texture(leaf_picture(), "leaf")
CUT_OUT = Material("cut out", color_texture=PICTURE, alpha_mode="mask", double_sided=True,
                   role="leaf")  # fmt: skip
OPAQUE = Material("opaque", [0.15, 0.3, 0.08, 1], double_sided=True, role="leaf")
BARK = Material("bark", [0.2, 0.12, 0.07, 1])


def crown(count: int, half: float, material: Material, height: float = 2.0, seed: int = 0) -> Plant:
    """A stem, and leaves around the upper half of it."""
    rng = generator(seed, "crown", count)
    around = unit(rng.normal(size=(count, 3))) * 0.45 * height * rng.random((count, 1)) ** (1 / 3)
    middles = around + np.array([0.0, 0.55 * height, 0.0])
    leaves = cards(middles, half, material, rng.normal(size=(count, 3)))
    stem = cards([0, 0.3 * height, 0], 1.0, replace(BARK, double_sided=True))
    shaped = stem.positions * (0.03 * height, 0.3 * height, 1) + (0, 0.0, 0)
    shaped[:, 1] -= shaped[:, 1].min()
    return together(leaves, replace(stem, positions=shaped))


def species_of(
    name: str, *levels: Plant, at: Sequence[float] = (0.0,), fade: float = 0.15
) -> Species:
    shares = np.where(np.array(at) > 0, fade, 0.0)
    files = tuple(Path(f"{name}_{n}.glb") for n in range(len(levels)))
    return Species(name, levels, np.array(at, np.float64), shares, FOCAL_PX, files)


def tree() -> Species:
    """Four levels of 2 m: cards, two of cut out cards, then opaque ones."""
    return species_of(
        "tree", crown(80, 0.16, OPAQUE), crown(36, 0.24, CUT_OUT), crown(18, 0.34, CUT_OUT),
        crown(8, 0.5, OPAQUE), at=(0, 8, 20, 60),
    )  # fmt: skip


def bush() -> Species:
    """Two levels, of 1 m."""
    return species_of("bush", crown(30, 0.1, CUT_OUT, 1.0), crown(8, 0.2, OPAQUE, 1.0), at=(0, 10))


def herb() -> Species:
    """No level but itself, of 0.4 m."""
    return species_of("herb", crown(6, 0.05, OPAQUE, 0.4))


def garden() -> tuple[Species, ...]:
    return tree(), bush(), herb()


def elements_of(species: Sequence[Species]) -> list[list[Elements]]:
    return [[ordered(level) for level in one.levels] for one in species]


def models_of(species: Sequence[Species]) -> list[list[int]]:
    """Levels in the order in which a landscape has them."""
    counts = [len(one.levels) for one in species]
    firsts = np.cumsum([0, *counts[:-1]]).tolist()
    return [list(range(a, a + n)) for a, n in zip(firsts, counts, strict=True)]


def kinds(species: Sequence[Species], focal_px: float = FOCAL_PX) -> Kinds:
    return kinds_of(species, elements_of(species), models_of(species), focal_px)


def plants(
    feet: npt.ArrayLike,
    species: npt.ArrayLike = 0,
    *,
    origin: npt.ArrayLike = (0, 0, 0),
    height: npt.ArrayLike = np.nan,
    yaw: npt.ArrayLike = 0.0,
    tint: npt.ArrayLike = 1.0,
) -> Plants:
    """Of one tile, at metres from its origin."""
    offset = np.asarray(feet, np.float32).reshape(-1, 3)
    count = len(offset)

    def each(value: npt.ArrayLike, kind: Any, *shape: int) -> np.ndarray:
        return np.array(np.broadcast_to(np.asarray(value, kind), (count, *shape)))

    return Plants(
        np.asarray(origin, np.float64), offset, each(species, np.int32), each(yaw, np.float32),
        each(height, np.float32), each(tint, np.float32, 3), np.arange(1, count + 1),
    )  # fmt: skip


def stock(of: Plants, species: Sequence[Species], made: Kinds) -> Stock:
    return stocked(of, species, made.thinned_m)


@dataclass(eq=False)
class Garden:
    """A placement of tiles that are given, which remembers what it was asked for."""

    given: Sequence[Plants]
    tile_m: float = 16.0
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    notes: tuple[str, ...] = ()
    asked: list[int] = field(default_factory=list)

    @property
    def tiles(self) -> Tiles:
        feet = [of.origin + of.offset.astype(np.float64) for of in self.given]
        low = np.array([f.min(axis=0) for f in feet]).reshape(-1, 3)
        high = np.array([f.max(axis=0) for f in feet]).reshape(-1, 3)
        return Tiles(low, high, np.array([len(f) for f in feet], np.int64))

    def tallest(self, count: int) -> FloatArray:
        found = np.full(count, np.nan)
        for of in self.given:
            np.fmax.at(found, of.species, of.height)
        return found

    def measured(self, count: int) -> BoolArray:
        without = [of.species[np.isnan(of.height)] for of in self.given]
        return ~np.isin(np.arange(count), np.concatenate(without))

    def plants(self, tile: int, most: int | None = None) -> Plants:
        self.asked.append(tile)
        return self.given[tile]


def wood(
    tiles: int = 4, count: int = 12, side: float = 8.0, seed: int = 0,
    origin: npt.ArrayLike = (0, 0, 0),
) -> Garden:  # fmt: skip
    """Square tiles about the origin, of plants of all kinds of a garden."""
    rng = generator(seed, "wood", tiles)
    given = []
    for row in range(tiles):
        for column in range(tiles):
            corner = side * (np.array([column, 0, row]) - tiles / 2) * (1, 0, 1)
            feet = side * rng.random((count, 3)) * (1, 0, 1)
            given.append(
                plants(
                    feet,
                    rng.integers(0, 3, count),
                    origin=corner + np.asarray(origin),
                    yaw=rng.uniform(0, 6, count),
                    tint=rng.uniform(0.9, 1.1, (count, 3)),
                )
            )
    return Garden(given, side)


def world_of(species: Sequence[Species], placement: Any, start: Eye) -> World:
    """Without ground."""
    return World(tuple(species), placement, Terrain(), None, start, np.array([0.0, 1.0, 0.0]))
