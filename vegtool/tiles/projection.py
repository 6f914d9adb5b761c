"""Longitude and latitude to the metres of a map: universal transverse Mercator (UTM).

The series of L. Krüger, "Konforme Abbildung des Erdellipsoids in der Ebene" (1912), to the fourth
order in the third flattening, as in C. F. F. Karney, "Transverse Mercator with an accuracy of a few
nanometers", Journal of Geodesy 85 (2011), equations 7 to 11 and 35: within a micrometre of the
exact projection over a zone. WGS 84, ETRS89 and NAD83 are taken as one, which they are to a metre
or two.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray

RADIUS = 6_378_137.0
"""Metres: the equator's, of WGS 84."""
FLATTENING = 1 / 298.257223563
SCALE = 0.9996
FALSE_EASTING, FALSE_NORTHING = 500_000.0, 10_000_000.0
SOUTHERN, NORTHERN = -80.0, 84.0
"""Degrees of latitude between which UTM is defined."""
CODES = re.compile(r"^EPSG:(?:(?P<north>326|258|269)|(?P<south>327))(?P<zone>\d\d)$", re.IGNORECASE)
"""UTM on WGS 84, ETRS89 and NAD83."""


@dataclass(frozen=True)
class Zone:
    """number: 1 to 60. south: whether northings count from 10,000 km south of the equator."""

    number: int
    south: bool

    @property
    def crs(self) -> str:
        """On WGS 84."""
        return f"EPSG:{327 if self.south else 326}{self.number:02d}"

    def project(self, longitude: FloatArray, latitude: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Metres east and north, (n,) each, of degrees (n,)."""
        away = (longitude - (6 * self.number - 183) + 180) % 360 - 180
        east, north = _krueger(np.radians(away), np.radians(latitude))
        return FALSE_EASTING + east, north + (FALSE_NORTHING if self.south else 0.0)


def zone_of(crs: str) -> Zone | None:
    """The zone that a coordinate reference system is, such as EPSG:25832; None for others."""
    match = CODES.match(crs.strip())
    if not match or not 1 <= int(match["zone"]) <= 60:
        return None
    return Zone(int(match["zone"]), match["south"] is not None)


def zone_at(longitude: float, latitude: float) -> Zone:
    """The zone of a place in degrees, without the exceptions of Norway and Svalbard."""
    return Zone(int((longitude + 180) % 360 // 6) + 1, latitude < 0)


def _krueger(away: FloatArray, latitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres from the central meridian and the equator, of radians."""
    n = FLATTENING / (2 - FLATTENING)
    radius = RADIUS / (1 + n) * (1 + n**2 / 4 + n**4 / 64)  # equation 14
    alpha = (  # equation 35
        n / 2 - 2 / 3 * n**2 + 5 / 16 * n**3 + 41 / 180 * n**4,
        13 / 48 * n**2 - 3 / 5 * n**3 + 557 / 1440 * n**4,
        61 / 240 * n**3 - 103 / 140 * n**4,
        49561 / 161280 * n**4,
    )
    e = np.sqrt(FLATTENING * (2 - FLATTENING))
    sine = np.sin(latitude)
    tangent = np.sinh(np.arctanh(sine) - e * np.arctanh(e * sine))  # of the conformal latitude
    xi = np.arctan2(tangent, np.cos(away))
    eta = np.arcsinh(np.sin(away) / np.hypot(tangent, np.cos(away)))
    north, east = xi.copy(), eta.copy()
    for j, a in enumerate(alpha, start=1):
        north += a * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        east += a * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
    return SCALE * radius * east, SCALE * radius * north
