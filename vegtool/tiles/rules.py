"""Where species grow: their shares, and what density maps, slopes and elevations leave of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.errors import InputError, UsageError
from vegtool.scene import Scene, SpeciesTable
from vegtool.tiles.grey import read_grey
from vegtool.tiles.grid import Grid
from vegtool.tiles.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Rules:
    """Of s species, where they grow.

    in_order: (s,) int32 species, the tallest first. first, last: (s,) the interval of ranks, of 0
    to 1, that a species has; they follow each other in order. slope, elevation: (s, 2) radians and
    metres, least and greatest. density: of each, a map of 0 to 1 or None.
    """

    tables: tuple[SpeciesTable, ...]
    in_order: IntArray
    first: FloatArray
    last: FloatArray
    slope: FloatArray
    elevation: FloatArray
    density: tuple[Grid | None, ...]

    def species(self, rank: FloatArray) -> IntArray:
        """(n,) int32: whose interval a rank lies in."""
        place = np.searchsorted(self.last[self.in_order], rank, side="right")
        return np.asarray(self.in_order[np.minimum(place, len(self.in_order) - 1)])

    def level(self, rank: FloatArray, species: IntArray) -> FloatArray:
        """(n,) 0 to 1: how high in its species' interval a rank lies."""
        first = self.first[species]
        return np.asarray((rank - first) / (self.last[species] - first))

    def share(
        self, terrain: Terrain, xz: FloatArray, ground: FloatArray, species: IntArray
    ) -> FloatArray:
        """(n,) 0 to 1: of its species, how much grows at points (n, 2) whose heights are known."""
        low, high = self.elevation[species].T
        share = np.asarray((low <= ground) & (ground <= high), dtype=np.float64)
        if np.isfinite(self.slope).any():
            low, high = self.slope[species].T
            slope = terrain.slope(xz)
            share *= (low <= slope) & (slope <= high)
        for kind, grid in enumerate(self.density):
            here = species == kind
            if grid is not None and here.any():
                share[here] *= grid.at(xz[here])
        return share

    def greatest_share(
        self, x: FloatArray, z: FloatArray, low: FloatArray, high: FloatArray
    ) -> FloatArray:
        """(b, a, s) bounds of `share` within x[i] and z[j], of (a, 2) and (b, 2) metres, where the
        ground is between low and high, (b, a)."""
        least, most = self.elevation.T
        fits = (low[..., None] <= most) & (high[..., None] >= least)
        shares = np.asarray(fits, dtype=np.float64)
        for kind, grid in enumerate(self.density):
            if grid is not None:
                shares[..., kind] *= grid.extremes(x, z)[1]
        return shares


def rules_of(scene: Scene, terrain: Terrain) -> tuple[Rules, tuple[str, ...]]:
    """The rules in a scene's [[species]], and notes on what was guessed.

    Species without a height come first: their models may be trees.
    Raises UsageError for shares that make no sense, InputError for a density map that is missing,
    broken or of another form than the extent.
    """
    tables = scene.species
    unknown = [table.name or "one without a name" for table in tables if table.height_m is None]
    notes = []
    if unknown and len(unknown) < len(tables):
        notes.append(
            f"{scene.at('species')}: {', '.join(unknown)}: without height_m, so they count as "
            "taller than the others"
        )
    tallest = [np.inf if table.height_m is None else table.height_m[1] for table in tables]
    in_order = np.argsort(-np.array(tallest), kind="stable").astype(np.int32)
    shares = _shares(scene)[in_order]
    ends = np.cumsum(shares)
    first, last = np.empty(len(tables)), np.empty(len(tables))
    first[in_order], last[in_order] = ends - shares, ends
    everywhere = (-np.inf, np.inf)
    slope = np.array([table.slope_deg or everywhere for table in tables], dtype=np.float64)
    elevation = np.array([table.elevation_m or everywhere for table in tables], dtype=np.float64)
    density = tuple(_density(scene, terrain, index) for index in range(len(tables)))
    rules = Rules(tables, in_order, first, last, np.radians(slope), elevation, density)
    return rules, tuple(notes)


def _shares(scene: Scene) -> FloatArray:
    """(s,) of all plants, 1 together; all the same where the scene says none."""
    said = [table.share for table in scene.species]
    if None in said and any(share is not None for share in said):
        raise UsageError(
            f"{scene.at('species', said.index(None))}: expected a share, as other species have "
            "one; got none; add it"
        )
    shares = np.array([1.0 if share is None else share for share in said])
    if not shares.sum() > 0:
        raise UsageError(
            f"{scene.at('species', 0, 'share')}: expected a species whose share is more than 0; "
            "got none"
        )
    return np.asarray(shares / shares.sum())


def _density(scene: Scene, terrain: Terrain, index: int) -> Grid | None:
    """The map of a species, over the extent: pixels are square, or those of the heightmap."""
    name, extent = scene.species[index].density, terrain.extent
    if name is None or extent is None:
        return None
    path, named = scene.path.parent / name, f"{scene.at('species', index, 'density')}: density"
    grey = read_grey(path, named)
    rows, columns = grey.values.shape
    as_heights = terrain.grid is not None and terrain.grid.values.shape == (rows, columns)
    if extent[0] >= extent[1]:
        off = rows - columns * extent[1] / extent[0]
    else:
        off = columns - rows * extent[0] / extent[1]
    if abs(off) > 1 and not as_heights:
        raise InputError(
            f"{path}: expected square pixels over the extent of {extent[0]:g} x {extent[1]:g} m, "
            f"or as many as the heightmap has; found {grey.size}; scale or cut it ({named})"
        )
    return Grid(grey.values, extent)
