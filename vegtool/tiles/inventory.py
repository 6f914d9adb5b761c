"""Plants from a file with a row for each: a survey, a register of trees, points from a scan.

A row's place on the map becomes metres from the scene's origin in float64, before anything is
rounded, so that coordinates of millions of metres keep every plant within a millimetre. Where the
scene has ground, plants stand on it. Columns and formats are described in docs/placement.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray, SingleArray
from vegtool.errors import InputError, UsageError
from vegtool.progress import Progress
from vegtool.scene import Scene
from vegtool.tiles.hashing import draws, hashes, key
from vegtool.tiles.order import spread_order
from vegtool.tiles.placement import BoolArray, LongArray, Plants, Tiles
from vegtool.tiles.projection import (
    NORTHERN,
    SOUTHERN,
    is_degrees,
    is_world,
    same_map,
    zone_at,
    zone_of,
)
from vegtool.tiles.rows import Rows, read_rows
from vegtool.tiles.terrain import Terrain
from vegtool.tiles.variation import DRAWS, heights, tints, yaws

FAR_M = 100_000.0
"""Metres: coordinates beyond are a map's, others may be the scene's own."""
GROUND_M = (-1000.0, 10_000.0)
"""Metres: no land is lower or higher; what programs write where they know no height mostly is."""
HALF = 2**30
"""Tiles on either side of the origin."""


@dataclass(frozen=True, eq=False)
class Inventory:
    """A Placement whose plants are all there, sorted by tile.

    first: (t + 1,) int64 where the plants of each tile begin, and how many there are. center:
    (t, 3) float64 metres, the tiles' origins. The others, of all plants: as those of Plants.
    """

    tile_m: float
    origin: FloatArray
    tiles: Tiles
    first: LongArray
    center: FloatArray
    offset: SingleArray
    species: IntArray
    yaw: SingleArray
    height: SingleArray
    tint: SingleArray
    row: LongArray
    notes: tuple[str, ...] = ()
    crs: str | None = None

    def tallest(self, count: int) -> FloatArray:
        """(count,) metres that no plant of each species is taller than; NaN: the model's own."""
        found = np.full(count, np.nan)
        np.fmax.at(found, self.species, self.height)
        return found

    def measured(self, count: int) -> BoolArray:
        """(count,) bool, whether all plants of each species have a height of their own."""
        without = self.species[np.isnan(self.height)]
        return np.asarray(np.bincount(without, minlength=count)[:count] == 0)

    def plants(self, tile: int, most: int | None = None) -> Plants:
        """The plants of a tile, 0..t-1, or the first `most` of them."""
        first, last = int(self.first[tile]), int(self.first[tile + 1])
        part = slice(first, last if most is None else min(first + most, last))
        return Plants(
            self.center[tile],
            self.offset[part],
            self.species[part],
            self.yaw[part],
            self.height[part],
            self.tint[part],
            self.row[part],
        )


def place(scene: Scene, terrain: Terrain, tile_m: float, progress: Progress) -> Inventory:
    """The plants of a file on the scene's ground; see `placement_of`."""
    progress("placement", 0.0)
    rows = read_rows(scene)
    progress("placement", 0.5)
    notes = list(rows.notes)
    east, north, origin, crs = _on_the_map(scene, terrain, rows, notes)
    xz = np.stack([east - origin[0], origin[1] - north], axis=1)
    on = terrain.inside(xz)
    if not on.all():
        notes.append(_outside(terrain, rows, xz, on))
        xz, rows = xz[on], rows.only(on)
    feet = np.stack([xz[:, 0], _ground(terrain, rows, xz, notes), xz[:, 1]], axis=1)
    random = draws(hashes(key(scene.placement.seed or 0), rows.row), DRAWS)
    usual = heights(random, rows.species, scene.species)
    height = np.where(np.isnan(rows.height), usual, rows.height).astype(np.float32)
    turn = np.remainder(rows.yaw, 2 * np.pi)  # of many turns, float32 would keep too little
    yaw = np.where(np.isnan(turn), yaws(random), turn).astype(np.float32)
    order, tile = _order(xz, height, tile_m)
    ends = np.flatnonzero(np.diff(tile, append=np.iinfo(np.int64).max)) + 1
    first = np.concatenate([[0], ends])
    center, offset, tiles = _tiles(feet[order], first)
    progress("placement", 1.0)
    return Inventory(
        tile_m,
        origin,
        tiles,
        first,
        center,
        offset,
        rows.species[order],
        yaw[order],
        height[order],
        tints(random)[order],
        rows.row[order],
        tuple(notes),
        crs,
    )


def _on_the_map(
    scene: Scene, terrain: Terrain, rows: Rows, notes: list[str]
) -> tuple[FloatArray, FloatArray, FloatArray, str | None]:
    """(n,) metres east and north on the map, (3,) what of it is the scene's origin, and which map
    that is."""
    _check_map(terrain, rows)
    said_world = is_world(scene.terrain.crs)
    if not (rows.columns.geographic or (said_world and rows.columns.crs is None)):
        origin = _origin(scene, terrain, rows, rows.x, rows.y, notes)
        if origin is None:
            return rows.x, rows.y, np.zeros(3), None
        return rows.x, rows.y, origin, terrain.crs or rows.columns.crs
    crs, origin = terrain.crs, terrain.origin
    if crs is None or is_world(crs):
        around = rows.x - 360 * np.round((rows.x - rows.x[0]) / 360)  # 180 is -180
        place = [(values.min() + values.max()) / 2 for values in (around, rows.y)]
        if origin is not None:
            place = _degrees(scene, rows, origin)
        zone = zone_at(*place)
        if origin is not None:
            east, north = zone.project(*(np.array([value]) for value in place))
            origin = np.array([east[0], north[0], 0.0])
        crs = zone.crs
    else:
        found = zone_of(crs)
        if found is None:
            raise UsageError(
                f"{rows.table.path}: has longitude and latitude, and the ground is in {crs}; "
                "expected a UTM zone, such as EPSG:25832; project the inventory, for example with "
                f"ogr2ogr -t_srs {crs}"
            )
        zone = found
    _check_degrees(rows)
    if said_world or terrain.crs is None:
        notes.append(
            f"{rows.table.path}: longitude and latitude became metres in {crs}, UTM zone "
            f"{zone.number}"
        )
    east, north = zone.project(rows.x, rows.y)
    if origin is None:
        origin = _origin(scene, terrain, rows, east, north, notes)
    return east, north, np.zeros(3) if origin is None else origin, crs


def _check_map(terrain: Terrain, rows: Rows) -> None:
    """Raise InputError for an inventory on another map than the ground, or on none that is known
    here."""
    found, said = rows.columns.crs, terrain.crs
    if found is None:
        return
    if rows.columns.geographic:
        if not is_world(found):
            raise InputError(
                f"{rows.table.path}: expected longitude and latitude on WGS 84, ETRS89 or NAD83, "
                f"found {found:.60}; reproject it, for example with ogr2ogr -t_srs EPSG:4326"
            )
    elif said is not None and not same_map(found, said):
        raise InputError(
            f"{rows.table.path}: expected {said:.60}, as the ground, found {found:.60}; reproject "
            f"it, for example with ogr2ogr -t_srs, or correct crs in [terrain]"
        )


def _degrees(scene: Scene, rows: Rows, origin: FloatArray) -> list[float]:
    """The origin of a scene that names no map, as longitude and latitude."""
    place = [float(origin[0]), float(origin[1])]
    if not is_degrees(*place):
        raise UsageError(
            f"{scene.at('terrain', 'origin')}: origin: expected degrees, as {rows.table.path} has "
            f"longitude and latitude; got {place[0]:.15g}, {place[1]:.15g}; say crs in [terrain], "
            "the map that it is on"
        )
    return place


def _check_degrees(rows: Rows) -> None:
    """UTM ends before the poles; where the scene says that they are degrees, so does 180."""
    for meaning, values, least, most in (
        ("x", rows.x, -180.0, 180.0),
        ("y", rows.y, SOUTHERN, NORTHERN),
    ):
        wrong = np.flatnonzero((values < least) | (values > most))
        if wrong.size:
            index = int(wrong[0])
            raise rows.table.error(
                int(rows.row[index]),
                rows.table.names[rows.columns.number[meaning]],
                f"{least:g} to {most:g} degrees",
                float(values[index]),
            )


def _origin(
    scene: Scene,
    terrain: Terrain,
    rows: Rows,
    east: FloatArray,
    north: FloatArray,
    notes: list[str],
) -> FloatArray | None:
    """(3,) the scene's origin on the map: as the ground says; else the middle of the inventory,
    where that is far away; None where coordinates may be the scene's own."""
    if terrain.origin is not None:
        return terrain.origin
    if max(abs(east).max(), abs(north).max()) <= FAR_M:
        return None
    middle = [round((values.min() + values.max()) / 2) for values in (east, north)]
    said = f"origin = [{middle[0]}, {middle[1]}]"
    if terrain.kind == "heightmap":
        raise UsageError(
            f"{scene.at('terrain', 'heightmap')}: expected origin in [terrain], where the middle "
            f"of the heights is on the map, as {rows.table.path} is far from 0; got none; the "
            f"inventory's middle is {said}"
        )
    notes.append(
        f"{rows.table.path}: the scene's origin is put at its middle, {said}; say another in "
        "[terrain]"
    )
    return np.array([*middle, 0.0], dtype=np.float64)


def _outside(terrain: Terrain, rows: Rows, xz: FloatArray, on: np.ndarray) -> str:
    """A note on plants that stand beyond the ground. Raises InputError where all do."""
    assert terrain.extent is not None
    first = int(np.argmin(on))
    at = f"x = {xz[first, 0]:.2f}, z = {xz[first, 1]:.2f} m from the scene's origin"
    ground = f"the ground of {terrain.extent[0]:g} x {terrain.extent[1]:g} m"
    if not on.any():
        raise InputError(
            f"{rows.at(first)}: expected plants on {ground}, found none; the first is at {at}; say "
            "where the ground is with origin in [terrain]"
        )
    count = int(np.count_nonzero(~on))
    return (
        f"{rows.table.path}: plants that are not on {ground} and left out: {count:,}, the first in "
        f"{rows.table.place(int(rows.row[first]))}, at {at}"
    )


def _ground(terrain: Terrain, rows: Rows, xz: FloatArray, notes: list[str]) -> FloatArray:
    """(n,) metres, how high the plants' feet are."""
    height, known = terrain.height(xz), np.isfinite(rows.z)
    if not known.any():
        return height
    if terrain.kind == "none":
        least, most = GROUND_M
        wrong = np.flatnonzero(known & ((rows.z < least) | (rows.z > most)))
        if wrong.size:
            raise rows.table.error(
                int(rows.row[wrong[0]]),
                rows.table.names[rows.columns.number["z"]],
                f"{least:g} to {most:g} m",
                float(rows.z[wrong[0]]),
                "leave it empty where it is not known, or say the column's unit with units in "
                "[placement]",
            )
        if not known.all():
            count = int(np.count_nonzero(~known))
            notes.append(f"{rows.table.path}: plants without z, which stand at height 0: {count:,}")
        return np.where(known, rows.z, height)
    off = float(np.median(rows.z[known] - height[known]))
    if abs(off) > 0.5:
        notes.append(
            f"{rows.table.path}: plants stand on the scene's ground; z, which is not used, is "
            f"{abs(off):.1f} m {'above' if off > 0 else 'below'} it, in the median"
        )
    return height


def _order(xz: FloatArray, height: SingleArray, tile_m: float) -> tuple[LongArray, LongArray]:
    """(n,) the order of plants, and, in that order, numbers of their tiles, ascending."""
    square = np.floor(xz / tile_m)
    number = square.astype(np.int64) + HALF
    tile = number[:, 1] * (2 * HALF) + number[:, 0]
    # Of a height that is not known, the model may be a tree.
    tall = np.where(np.isnan(height), np.nanmax(height, initial=0.01), height).astype(np.float64)
    by_tile = np.argsort(tile, kind="stable")
    inner = np.minimum((xz / tile_m - square)[by_tile], np.nextafter(1.0, 0.0))
    order = by_tile[spread_order(inner, tile[by_tile], tall[by_tile])]
    return order, tile[order]


def _tiles(feet: FloatArray, first: LongArray) -> tuple[FloatArray, SingleArray, Tiles]:
    """Centers (t, 3) of tiles, offsets (n, 3) from them, and bounds, which hold what is rounded."""
    starts, count = first[:-1], np.diff(first)
    low, high = (least.reduceat(feet, starts, axis=0) for least in (np.minimum, np.maximum))
    center = (low + high) / 2
    offset = (feet - np.repeat(center, count, axis=0)).astype(np.float32)
    corners = [
        center + least.reduceat(offset, starts, axis=0) for least in (np.minimum, np.maximum)
    ]
    return center, offset, Tiles(corners[0], corners[1], count)
