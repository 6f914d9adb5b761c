"""Where on the earth a landscape stands: from the scene's frame to earth-centred coordinates.

The frame is flat: it touches the earth at the scene's origin, with axes east, north and up there
(OGC 22-025r4, 3D Tiles 1.1, has the transform of the root tile for it). It is turned by the map's
convergence and scaled by what a metre of the map is on the ground, so that plants stand where the
map says; heights count from the ellipsoid of WGS 84. UTM is computed in projection.py; other maps
by PROJ, which rasterio brings, and by differences.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.tiles.projection import ECCENTRICITY, RADIUS, is_world, zone_at, zone_of

if TYPE_CHECKING:
    from vegtool.tiles.placement import Placement
    from vegtool.tiles.terrain import Terrain

CODE = re.compile(r"^(?:[A-Z]+:\d+|OGC:CRS84)$", re.IGNORECASE)
"""What a coordinate reference system may be called in a scene."""
STEP_M = 500.0
"""Metres between places whose differences tell how a map is turned and scaled."""
DISTORTED = 0.02
"""Of a length on the ground: how much longer or shorter it may be on a map, in any direction. On a
map that errs more, such as web Mercator, plants would not be as large as they are."""


@dataclass(frozen=True)
class Place:
    """Of the scene's origin. longitude, latitude: degrees. convergence: radians from north to the
    map's north, clockwise. scale: a length on the map over that on the ellipsoid."""

    longitude: float
    latitude: float
    convergence: float
    scale: float


def earth_from_scene(crs: str | None, origin: FloatArray, height: float = 0.0) -> FloatArray | None:
    """(4, 4) from the scene's frame, z up (x east and y north on the map, metres), to the earth's:
    earth-centred, earth-fixed, WGS 84, metres. A similarity. None where there is no crs, or one
    that `notes_on` has a note on.

    origin: (3,) metres, the map's coordinates of the scene's origin, as of a Placement; degrees
    where crs is of those, and then the map is the UTM zone there. height: metres in the scene's
    frame, where its scale and its heights are exact: about where plants stand. On a map scaled by
    0.9996, others' heights are off by 0.04 % of how far they are from it.
    """
    place = _place(crs, origin)
    if not isinstance(place, Place):
        return None
    longitude, latitude = np.radians([place.longitude, place.latitude])
    above = float(origin[2]) + height
    east, north, up = _axes(longitude, latitude)
    cos, sin = np.cos(place.convergence), np.sin(place.convergence)
    prime, meridian = _radii(latitude)
    size = (1 + above / np.sqrt(prime * meridian)) / place.scale
    matrix = np.eye(4)
    matrix[:3, :3] = size * np.stack([cos * east - sin * north, sin * east + cos * north, up], 1)
    matrix[:3, 3] = _earth_centred(longitude, latitude, above) - matrix[:3, 2] * height
    return matrix


def notes_on(terrain: Terrain, placement: Placement) -> tuple[str, ...]:
    """A sentence for the user where a scene that names its map has no place on the earth."""
    if placement.crs is None:
        if terrain.crs is None:
            return ()
        return (
            f"{terrain.crs}: expected where the scene's origin is on this map, found nothing; "
            "tiles are put nowhere on the earth; say origin in [terrain]",
        )
    place = _place(placement.crs, placement.origin)
    return (place,) if isinstance(place, str) else ()


def check_crs(crs: str, at: str) -> None:
    """Raise UsageError, which begins with `at`, for a coordinate reference system that is none, or
    has neither metres nor longitude and latitude on WGS 84, ETRS89 or NAD83. Without rasterio, all
    codes pass."""
    if not CODE.match(crs.strip()):
        raise UsageError(f"{at}: expected a code, such as EPSG:25832; got {crs!r}")
    if is_world(crs) or zone_of(crs) is not None:
        return
    rasterio = _rasterio()
    if rasterio is None:
        return
    try:
        with rasterio.Env():  # else GDAL prints what it does not know
            found = rasterio.crs.CRS.from_user_input(crs)
        metres = found.is_projected and found.linear_units_factor[1] == 1.0
    except rasterio.errors.CRSError:
        raise UsageError(
            f"{at}: expected a code that PROJ knows, such as EPSG:25832; got {crs!r}"
        ) from None
    if not metres:
        raise UsageError(
            f"{at}: expected a map in metres, such as EPSG:25832, or EPSG:4326; got {crs}, which "
            "is neither; reproject what is on it"
        )


def _place(crs: str | None, origin: FloatArray) -> Place | str | None:
    """Where a point of a map is; else why that is not known, for the user; None without a map."""
    if crs is None:
        return None
    zone = zone_of(crs)
    if zone is None and not is_world(crs):
        return _by_proj(crs, origin)
    x, y = (np.array([value]) for value in origin[:2])
    zone = zone or zone_at(float(x[0]), float(y[0]))
    longitude, latitude = (x, y) if is_world(crs) else zone.unproject(x, y)
    values = (longitude, latitude, *zone.distortion(longitude, latitude))
    return Place(*(float(value[0]) for value in values))


def _by_proj(crs: str, origin: FloatArray) -> Place | str:
    """By the differences of places that are one and two steps away in the map's four directions."""
    rasterio = _rasterio()
    if rasterio is None:
        return (
            f"{crs:.60}: expected a UTM zone, such as EPSG:25832, or rasterio, which knows other "
            "maps; found neither; tiles are put nowhere on the earth; run "
            "pip install 'vegtool[geo]'"
        )
    steps = STEP_M * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    x = origin[0] + np.concatenate([steps, np.zeros(5)])
    y = origin[1] + np.concatenate([np.zeros(5), steps])
    try:
        found = import_module("rasterio.warp").transform(crs, "EPSG:4326", x, y)
        degrees = np.array(found, np.float64)
    except rasterio.errors.CRSError:
        return (
            f"{crs:.60}: expected a map that PROJ knows, found none of that name; tiles are put "
            "nowhere on the earth; reproject the scene, for example to its UTM zone"
        )
    except rasterio.errors.RasterioError:
        degrees = np.full((2, 10), np.nan)
    if not np.isfinite(degrees).all():
        return (
            f"{crs:.60}: expected a place on this map, found {origin[0]:.15g}, {origin[1]:.15g}, "
            "which is none; tiles are put nowhere on the earth; check origin and crs in [terrain]"
        )
    longitude, latitude = degrees[:, 2]
    away = np.radians((degrees - degrees[:, 2:3] + 180) % 360 - 180)
    prime, meridian = _radii(np.radians(latitude))
    on_ground = away * [[prime * np.cos(np.radians(latitude))], [meridian]]
    first, second = (on_ground[:, start : start + 5] @ _SLOPE for start in (0, 5))
    jacobian = np.stack([first, second], axis=1)  # metres east and north of one of the map
    lengths = np.linalg.svd(jacobian, compute_uv=False)
    if (np.abs(1 / lengths - 1) > DISTORTED).any():
        return (
            f"{crs:.60}: expected a map on which a metre is one on the ground to {DISTORTED:.0%}, "
            f"found one of {lengths[np.argmax(np.abs(np.log(lengths)))]:.3g} m; tiles are put "
            "nowhere on the earth; reproject the scene, for example to its UTM zone"
        )
    along, across = jacobian[0, 0] + jacobian[1, 1], jacobian[0, 1] - jacobian[1, 0]
    turn = float(np.arctan2(across, along))
    return Place(float(longitude), float(latitude), turn, 2 / float(np.hypot(along, across)))


_SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12 * STEP_M)
"""Central differences of the fourth order."""


def _rasterio() -> Any:
    """The module; None where it is not installed."""
    try:
        return import_module("rasterio")
    except ImportError:
        return None


def _radii(latitude: float) -> tuple[float, float]:
    """Metres: radii of curvature of the ellipsoid, in the prime vertical and along the meridian."""
    flat = 1 - (ECCENTRICITY * np.sin(latitude)) ** 2
    return float(RADIUS / np.sqrt(flat)), float(RADIUS * (1 - ECCENTRICITY**2) / flat**1.5)


def _axes(longitude: float, latitude: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(3,) unit vectors east, north and up at a place in radians."""
    cos, sin = np.cos(longitude), np.sin(longitude)
    level, steep = np.cos(latitude), np.sin(latitude)
    return (
        np.array([-sin, cos, 0.0]),
        np.array([-steep * cos, -steep * sin, level]),
        np.array([level * cos, level * sin, steep]),
    )


def _earth_centred(longitude: float, latitude: float, height: float) -> FloatArray:
    """(3,) metres, of radians and metres above the ellipsoid."""
    prime, _ = _radii(latitude)
    _, _, up = _axes(longitude, latitude)
    squeezed = prime * np.array([1.0, 1.0, 1 - ECCENTRICITY**2])
    return np.asarray((squeezed + height) * up)
