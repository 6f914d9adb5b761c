"""Heights in a GeoTIFF, by rasterio, which is an extra."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray, SingleArray
from vegtool.errors import CapabilityError, InputError
from vegtool.tiles.grey import MAX_SIDE


@dataclass(frozen=True, eq=False)
class Raster:
    """heights: (rows, columns) float32 metres, the first row the northern one. extent: (2,) metres
    between the outermost pixels' centres, along east and north. origin: (3,) float64 metres east,
    north and up, the map's coordinates of the middle. crs: such as EPSG:25832, where it says."""

    heights: SingleArray
    extent: FloatArray
    origin: FloatArray
    crs: str | None


def read_geotiff(path: Path, named: str) -> Raster:
    """The first band of a GeoTIFF.

    named: file, line and key that name it, for messages.
    Raises CapabilityError without rasterio, InputError for a file that is missing or broken, is
    turned, has pixels without a height, or coordinates that are not metres.
    """
    try:
        rasterio = import_module("rasterio")
    except ImportError:
        raise CapabilityError(
            f"{path}: GeoTIFF is read by rasterio, which is not installed; run "
            f"pip install 'vegtool[geo]', or convert it to a PNG of 16 bits ({named})"
        ) from None
    if not path.is_file():
        raise InputError(f"{path}: expected a GeoTIFF, found no file there; check {named}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a file without a place; ours is below
            with rasterio.open(path) as file:
                return _raster(file, path, named)
    except rasterio.errors.RasterioError as error:
        raise InputError(
            f"{path}: expected a GeoTIFF; {error}; export it again ({named})"
        ) from None


def _raster(file: Any, path: Path, named: str) -> Raster:
    if not 2 <= min(file.shape) <= max(file.shape) <= MAX_SIDE:
        raise InputError(
            f"{path}: expected 2 to {MAX_SIDE} pixels on each side, found "
            f"{file.width} x {file.height}; scale it with gdalwarp ({named})"
        )
    across, skew, left, turn, down, top = tuple(file.transform)[:6]
    if (across, skew, left, turn, down, top) == (1, 0, 0, 0, 1, 0):
        raise InputError(
            f"{path}: expected where it lies on the map, found nothing; say it with gdal_translate "
            f"-a_srs and -a_ullr, or convert it to a PNG of 16 bits ({named})"
        )
    if skew or turn or across <= 0 or not down:
        raise InputError(
            f"{path}: expected columns towards the east and rows towards the north or south, found "
            f"a map that is turned; straighten it with gdalwarp ({named})"
        )
    crs = file.crs
    if crs is not None and (not crs.is_projected or crs.linear_units_factor[1] != 1.0):
        raise InputError(
            f"{path}: expected coordinates in metres, found {crs.to_string()}; reproject it, for "
            f"example with gdalwarp -t_srs EPSG:25832 ({named})"
        )
    band = file.read(1, masked=True)
    heights = np.ma.filled(band.astype(np.float32), np.nan)
    missing = int(np.count_nonzero(~np.isfinite(heights)))
    if missing:
        raise InputError(
            f"{path}: expected a height in every pixel, found {missing:,} without; fill them, for "
            f"example with gdal_fillnodata ({named})"
        )
    if down > 0:  # rows towards the north
        heights, top, down = heights[::-1], top + down * file.height, -down
    step = np.array([across, -down])
    size = step * (file.width, file.height)
    origin = np.array([left + size[0] / 2, top - size[1] / 2, 0.0])
    return Raster(np.ascontiguousarray(heights), size - step, origin, crs and crs.to_string())
