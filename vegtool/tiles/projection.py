"""Longitude and latitude to the metres of a map and back: universal transverse Mercator (UTM).

The series of L. Krüger, "Konforme Abbildung des Erdellipsoids in der Ebene" (1912), to the fourth
order in the third flattening, as in C. F. F. Karney, "Transverse Mercator with an accuracy of a few
nanometers", Journal of Geodesy 85 (2011), section 3, with the coefficients of equations 35 and 36:
within a micrometre of the exact projection over a zone. WGS 84, ETRS89 and NAD83 are taken as one,
which they are to a metre or two.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray

RADIUS = 6_378_137.0
"""Metres: the equator's, of WGS 84."""
FLATTENING = 1 / 298.257223563
ECCENTRICITY = (FLATTENING * (2 - FLATTENING)) ** 0.5
SCALE = 0.9996
FALSE_EASTING, FALSE_NORTHING = 500_000.0, 10_000_000.0
SOUTHERN, NORTHERN = -80.0, 84.0
"""Degrees of latitude between which UTM is defined."""
CODES = re.compile(r"^EPSG:(?:(?P<north>326|258|269)|(?P<south>327))(?P<zone>\d\d)$", re.IGNORECASE)
"""UTM on WGS 84, ETRS89 and NAD83."""
ZONES = {"326": (1, 60), "327": (1, 60), "258": (28, 38), "269": (1, 23)}
"""The first and the last zone of each; 26929 and on are other maps."""
WORLD = ("EPSG:4326", "EPSG:4258", "EPSG:4269", "EPSG:4979", "OGC:CRS84")
"""Coordinate reference systems of longitude and latitude."""
NEWTON = 4
"""Steps: two are enough for float64 but next to the poles."""

_N = FLATTENING / (2 - FLATTENING)
_RECTIFYING = RADIUS / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64)  # equation 14
_ALPHA = (  # equation 35
    _N / 2 - 2 / 3 * _N**2 + 5 / 16 * _N**3 + 41 / 180 * _N**4,
    13 / 48 * _N**2 - 3 / 5 * _N**3 + 557 / 1440 * _N**4,
    61 / 240 * _N**3 - 103 / 140 * _N**4,
    49561 / 161280 * _N**4,
)
_BETA = (  # equation 36
    _N / 2 - 2 / 3 * _N**2 + 37 / 96 * _N**3 - 1 / 360 * _N**4,
    1 / 48 * _N**2 + 1 / 15 * _N**3 - 437 / 1440 * _N**4,
    17 / 480 * _N**3 - 37 / 840 * _N**4,
    4397 / 161280 * _N**4,
)


@dataclass(frozen=True)
class Zone:
    """number: 1 to 60. south: whether northings count from 10,000 km south of the equator."""

    number: int
    south: bool

    @property
    def crs(self) -> str:
        """On WGS 84."""
        return f"EPSG:{327 if self.south else 326}{self.number:02d}"

    @property
    def meridian(self) -> float:
        """Degrees: the central one."""
        return 6.0 * self.number - 183.0

    def project(self, longitude: FloatArray, latitude: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Metres east and north, (n,) each, of degrees (n,)."""
        xi, eta = _waved(*_on_sphere(self._away(longitude), np.radians(latitude)), _ALPHA)
        return (
            FALSE_EASTING + SCALE * _RECTIFYING * eta,
            (FALSE_NORTHING if self.south else 0.0) + SCALE * _RECTIFYING * xi,
        )

    def unproject(self, east: FloatArray, north: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Degrees of longitude, -180 to 180, and latitude, (n,) each, of metres (n,)."""
        xi = (north - (FALSE_NORTHING if self.south else 0.0)) / (SCALE * _RECTIFYING)
        eta = (east - FALSE_EASTING) / (SCALE * _RECTIFYING)
        xi, eta = _waved(xi, eta, tuple(-beta for beta in _BETA))
        across, up = np.sinh(eta), np.cos(xi)
        away = np.degrees(np.arctan2(across, up))
        latitude = np.degrees(np.arctan(_geographic(np.sin(xi) / np.hypot(across, up))))
        return (self.meridian + away + 180) % 360 - 180, latitude

    def distortion(
        self, longitude: FloatArray, latitude: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """At degrees (n,), (n,) each: the convergence, radians from north to the map's north,
        clockwise, and the scale, a length on the map over that on the ellipsoid."""
        away, phi = self._away(longitude), np.radians(latitude)
        xi, eta = _on_sphere(away, phi)
        sine = np.sin(phi)
        conformal = _conformal(sine)
        p, q = np.ones_like(xi), np.zeros_like(xi)
        for j, alpha in enumerate(_ALPHA, start=1):
            p += 2 * j * alpha * np.cos(2 * j * xi) * np.cosh(2 * j * eta)
            q += 2 * j * alpha * np.sin(2 * j * xi) * np.sinh(2 * j * eta)
        on_sphere = np.arctan(conformal / np.hypot(1, conformal) * np.tan(away))
        squeezed = np.sqrt(1 - (ECCENTRICITY * sine) ** 2) / np.cos(phi)
        scale = squeezed / np.hypot(conformal, np.cos(away)) * np.hypot(p, q)
        return on_sphere + np.arctan2(q, p), SCALE * _RECTIFYING / RADIUS * scale

    def _away(self, longitude: FloatArray) -> FloatArray:
        """Radians from the central meridian."""
        return np.radians((longitude - self.meridian + 180) % 360 - 180)


def zone_of(crs: str) -> Zone | None:
    """The zone that a coordinate reference system is, such as EPSG:25832; None for others."""
    match = CODES.match(crs.strip())
    if not match:
        return None
    first, last = ZONES[match["north"] or match["south"]]
    number = int(match["zone"])
    return Zone(number, match["south"] is not None) if first <= number <= last else None


def zone_at(longitude: float, latitude: float) -> Zone:
    """The zone of a place in degrees, without the exceptions of Norway and Svalbard."""
    return Zone(int((longitude + 180) % 360 // 6) + 1, latitude < 0)


def is_world(crs: str | None) -> bool:
    """Whether coordinates in it are longitude and latitude."""
    return crs is not None and crs.strip().upper() in WORLD


def is_degrees(longitude: float, latitude: float) -> bool:
    """Whether two numbers can be degrees of a place that is on a zone."""
    return abs(longitude) <= 180 and SOUTHERN <= latitude <= NORTHERN


def same_map(one: str, other: str) -> bool:
    """Whether two names of coordinate reference systems mean the same coordinates."""
    if is_world(one) or is_world(other):
        return is_world(one) and is_world(other)
    zone = zone_of(one)
    return one.casefold() == other.casefold() if zone is None else zone == zone_of(other)


def _on_sphere(away: FloatArray, latitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of radians, the transverse Mercator coordinates on the sphere of conformal latitudes."""
    tangent = _conformal(np.sin(latitude))
    return np.arctan2(tangent, np.cos(away)), np.arcsinh(
        np.sin(away) / np.hypot(tangent, np.cos(away))
    )


def _waved(
    xi: FloatArray, eta: FloatArray, waves: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Coordinates with a series of waves added to them."""
    north, east = xi.copy(), eta.copy()
    for j, height in enumerate(waves, start=1):
        north += height * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        east += height * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
    return north, east


def _conformal(sine: FloatArray) -> FloatArray:
    """The tangents of conformal latitudes, of the sines of geographic ones."""
    return np.asarray(np.sinh(np.arctanh(sine) - ECCENTRICITY * np.arctanh(ECCENTRICITY * sine)))


def _geographic(conformal: FloatArray) -> FloatArray:
    """The tangents of geographic latitudes, of those of conformal ones: by Newton's method."""
    rest = 1 - ECCENTRICITY**2
    tangent = conformal / rest
    for _ in range(NEWTON):
        secant = np.hypot(1, tangent)
        found = _conformal(tangent / secant)
        slope = rest * secant / (1 + rest * tangent**2) * np.hypot(1, found)
        tangent = tangent + (conformal - found) / slope
    return np.asarray(tangent)
