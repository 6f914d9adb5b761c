"""The ground: nothing, a plane, or heights on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked, unit
from vegtool.errors import InputError, UsageError
from vegtool.scene import Scene
from vegtool.tiles.georeference import check_crs
from vegtool.tiles.grey import read_grey
from vegtool.tiles.grid import Grid
from vegtool.tiles.projection import is_degrees, is_world, zone_at, zone_of

GEOTIFF = (".tif", ".tiff")
"""Extensions of heightmaps that know their own size and place."""


Kind = Literal["none", "plane", "heightmap"]


@dataclass(frozen=True, eq=False)
class Terrain:
    """The ground, in the scene's frame.

    kind: "none" is drawn nowhere and lies at 0; "plane" lies at `base`; "heightmap" has a grid.
    extent: (2,) float64 metres along x and z, centred on the scene's origin; None where the scene
    does not say.
    grid: heights in metres, of a heightmap alone.
    base: metres, the height of a plane.
    origin: (3,) float64 metres east, north and up: the map's coordinates of the scene's origin;
    None where it has no place on the map.
    crs: the map's coordinate reference system, such as EPSG:25832, where it is known; of longitude
    and latitude only where there is no origin.
    notes: sentences on what was guessed; to be shown to the user.
    """

    kind: Kind = "none"
    extent: FloatArray | None = None
    grid: Grid | None = None
    base: float = 0.0
    origin: FloatArray | None = None
    crs: str | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (self.grid is None) == (self.kind == "heightmap"):
            raise ValueError("Terrain.grid: a heightmap has one, and nothing else does")
        for name, size in (("extent", 2), ("origin", 3)):
            value = getattr(self, name)
            if value is not None:
                array = checked(f"Terrain.{name}", value, (size,), np.float64)
                object.__setattr__(self, name, array)

    def height(self, xz: FloatArray) -> FloatArray:
        """(n,) metres at points (n, 2); beyond the extent, as on its border."""
        if self.grid is None:
            return np.full(len(xz), self.base)
        return self.grid.at(xz)

    def slope(self, xz: FloatArray) -> FloatArray:
        """(n,) radians from the horizontal, 0 to pi / 2, at points (n, 2)."""
        if self.grid is None:
            return np.zeros(len(xz))
        return np.asarray(np.arctan(np.linalg.norm(self.grid.gradient(xz), axis=1)))

    def heights_within(self, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds, (b, a) metres each, of the ground within x[i] and z[j]; x: (a, 2), z: (b, 2)."""
        if self.grid is None:
            flat = np.full((len(z), len(x)), self.base)
            return flat, flat
        return self.grid.extremes(x, z)

    def inside(self, xz: FloatArray) -> np.ndarray:
        """(n,) bool: points (n, 2) on the extent, its border included; all where it has none."""
        if self.extent is None:
            return np.ones(len(xz), dtype=bool)
        return np.asarray((np.abs(xz) <= self.extent / 2).all(axis=1))

    def mesh(
        self, cells: int, extent: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """What can be drawn: positions (v, 3) metres, unit normals (v, 3), faces (f, 3) int32,
        counter-clockwise from above.

        cells: squares along the longer side, at least 1. extent: (2,) metres, for a plane that has
        none. Nothing of ground that is none. Raises UsageError for a plane without an extent.
        """
        if self.kind == "none":
            return np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3), dtype=np.int32)
        size = self.extent if extent is None else np.asarray(extent, dtype=np.float64)
        if size is None:
            raise UsageError(
                "ground: a plane without extent_m in [terrain] cannot be drawn; add it"
            )
        across, along = np.maximum(np.round(cells * size / size.max()), 1).astype(int)
        x = np.linspace(-size[0] / 2, size[0] / 2, across + 1)
        z = np.linspace(-size[1] / 2, size[1] / 2, along + 1)
        flat = np.stack(np.meshgrid(x, z), axis=-1)
        height = self.height(flat.reshape(-1, 2)).reshape(along + 1, across + 1)
        along_z, along_x = np.gradient(height, z, x)
        normals = np.stack([-along_x, np.ones_like(height), -along_z], axis=-1)
        positions = np.stack([flat[..., 0], height, flat[..., 1]], axis=-1)
        first = (np.arange(along)[:, None] * (across + 1) + np.arange(across)).ravel()
        near, other = first + across + 1, first + 1
        faces = np.stack([first, near, other, other, near, near + 1], axis=1)
        return positions.reshape(-1, 3), unit(normals.reshape(-1, 3)), _triangles(faces)


def _triangles(corners: np.ndarray) -> IntArray:
    return np.ascontiguousarray(corners.reshape(-1, 3), dtype=np.int32)


def terrain_of(scene: Scene) -> Terrain:
    """The ground of a scene, by its [terrain]; without a kind, a heightmap where one is named, a
    plane where an extent is, else none.

    A PNG's black and white are the two heights of `height_m`, its outermost pixels lie on the
    border of `extent_m`, its first row is the northern one. A GeoTIFF says all that itself. An
    origin in degrees is put on the map of its UTM zone.
    Raises UsageError, with file and line, for a table that says too little or contradicts itself,
    InputError for a file that is missing, broken or of another size, CapabilityError for a GeoTIFF
    where rasterio is not installed.
    """
    table = scene.terrain
    if table.crs is not None:
        check_crs(table.crs, f"{scene.at('terrain', 'crs')}: crs")
    guess: Kind = "heightmap" if table.heightmap else "plane" if table.extent_m else "none"
    kind = table.kind or guess
    if kind == "heightmap":
        path = scene.path.parent / str(table.heightmap)
        if path.suffix.lower() in GEOTIFF:
            return _from_geotiff(scene, path)
        return _from_picture(scene, path)
    low, high = table.height_m or (0.0, 0.0)
    if low != high:
        raise UsageError(
            f"{scene.at('terrain', 'height_m')}: height_m: expected twice the same height for "
            f"ground that is {kind}; got {low:g} and {high:g}"
        )
    extent = None if table.extent_m is None else np.array(table.extent_m, dtype=np.float64)
    return Terrain(kind, extent, None, low, *_place(scene))


def _place(scene: Scene) -> tuple[FloatArray | None, str | None]:
    """Origin and crs of the scene on the map, as the file says."""
    pair, crs = scene.terrain.origin, scene.terrain.crs
    if pair is None:
        return None, crs
    at = f"{scene.at('terrain', 'origin')}: origin"
    if is_world(crs):
        if not is_degrees(*pair):
            raise UsageError(
                f"{at}: expected degrees of longitude and latitude, as crs is {crs}; got "
                f"{pair[0]:.15g}, {pair[1]:.15g}; give crs the map that it is on"
            )
        zone = zone_at(*pair)
        east, north = zone.project(*(np.array([value], np.float64) for value in pair))
        return np.array([east[0], north[0], 0.0]), zone.crs
    if crs is not None and zone_of(crs) is not None and is_degrees(*pair):
        raise UsageError(
            f"{at}: expected metres east and north, as crs is {crs}; got {pair[0]:.15g}, "
            f'{pair[1]:.15g}, which look like degrees; project them, or say crs = "EPSG:4326"'
        )
    return np.array([*pair, 0.0], np.float64), crs


def _from_picture(scene: Scene, path: Path) -> Terrain:
    table = scene.terrain
    for key in ("extent_m", "height_m"):
        if getattr(table, key) is None:
            raise UsageError(
                f"{scene.at('terrain', 'heightmap')}: expected {key} in [terrain] for heights in a "
                "picture, which does not say it; got none"
            )
    assert table.extent_m is not None and table.height_m is not None
    grey = read_grey(path, f"{scene.at('terrain', 'heightmap')}: heightmap")
    low, high = table.height_m
    notes = []
    if grey.bits == 8 and high > low:
        notes.append(
            f"{path}: has 8 bits, so heights come in steps of {(high - low) / 255:.3g} m; "
            "16 bits are smooth"
        )
    heights = np.float32(low) + grey.values * np.float32(high - low)
    extent = np.array(table.extent_m, dtype=np.float64)
    grid = Grid(heights, extent)
    if abs(grid.step[0] - grid.step[1]) > 0.02 * grid.step.max():
        notes.append(
            f"{path}: {grey.size} over {extent[0]:g} x {extent[1]:g} m are not square: "
            f"{grid.step[0]:.3g} x {grid.step[1]:.3g} m"
        )
    return Terrain("heightmap", extent, grid, 0.0, *_place(scene), tuple(notes))


def _from_geotiff(scene: Scene, path: Path) -> Terrain:
    from vegtool.tiles.geotiff import read_geotiff

    table = scene.terrain
    raster = read_geotiff(path, f"{scene.at('terrain', 'heightmap')}: heightmap")
    grid = Grid(raster.heights, raster.extent)
    if table.extent_m is not None and (abs(grid.extent - table.extent_m) > 1.01 * grid.step).any():
        raise InputError(
            f"{path}: expected {table.extent_m[0]:g} x {table.extent_m[1]:g} m, as extent_m in "
            f"{scene.at('terrain', 'extent_m')}, found {grid.extent[0]:g} x {grid.extent[1]:g} m; "
            "leave extent_m out"
        )
    low, high = float(raster.heights.min()), float(raster.heights.max())
    if table.height_m is not None and not table.height_m[0] <= low <= high <= table.height_m[1]:
        raise InputError(
            f"{path}: expected heights of {table.height_m[0]:g} to {table.height_m[1]:g} m, as "
            f"height_m in {scene.at('terrain', 'height_m')}, found {low:g} to {high:g} m; leave "
            "height_m out"
        )
    if table.crs and raster.crs and table.crs.casefold() != raster.crs.casefold():
        raise InputError(
            f"{path}: expected {table.crs}, as crs in {scene.at('terrain', 'crs')}, found "
            f"{raster.crs}; leave crs out"
        )
    if table.origin is not None and (abs(raster.origin[:2] - table.origin) > grid.step).any():
        raise InputError(
            f"{path}: expected its middle at {table.origin[0]:.15g}, {table.origin[1]:.15g}, as "
            f"origin in {scene.at('terrain', 'origin')}, found {raster.origin[0]:.15g}, "
            f"{raster.origin[1]:.15g}; leave origin out"
        )
    crs = raster.crs or table.crs
    return Terrain("heightmap", grid.extent, grid, 0.0, raster.origin, crs)
