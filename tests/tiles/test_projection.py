"""UTM beside the values of PROJ 9 for the same places, and its own symmetries."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.tiles.projection import Zone, zone_at, zone_of

PROJ = [
    ("EPSG:32632", 10.0, 53.5, 566331.5281877273, 5928359.088260288),
    ("EPSG:32632", 7.25, 47.0, 366956.6580336372, 5206650.29062093),
    ("EPSG:32733", 13.5, -23.75, 347128.2286671826, 7372645.434786098),
    ("EPSG:32601", -178.5, 64.25, 427293.13583960634, 7125730.122915095),
    ("EPSG:32633", 18.5, 69.0, 639915.0885990023, 7658353.322921491),
]


@pytest.mark.parametrize(("crs", "longitude", "latitude", "east", "north"), PROJ)
def test_places_are_where_proj_puts_them(
    crs: str, longitude: float, latitude: float, east: float, north: float
) -> None:
    zone = zone_of(crs)
    assert zone is not None
    found = zone.project(np.array([longitude]), np.array([latitude]))
    assert found == (pytest.approx([east], abs=1e-5), pytest.approx([north], abs=1e-5))


def test_the_central_meridian_is_half_a_million() -> None:
    """And its mirror images are as far from it, on either side of the equator too."""
    east, north = Zone(32, False).project(np.array([9.0, 8.0, 10.0, 10.0]), np.array([0, 5, 5, -5]))
    assert (east[0], north[0]) == (500_000, 0)
    assert east[1] + east[2] == pytest.approx(1_000_000, abs=1e-6)
    assert north[2] == -north[3]


def test_across_the_date_line() -> None:
    """Zone 1 begins at 180 degrees; 179.9 east is as near to it as -180.1."""
    zone = Zone(1, False)
    east, north = zone.project(np.array([179.9, -180.1]), np.array([10.0, 10.0]))
    assert (east[0], north[0]) == pytest.approx((east[1], north[1]), abs=1e-6)


def test_zones_of_places_and_names() -> None:
    assert zone_at(10.1, 50) == Zone(32, False)
    assert zone_at(-179.9, -3) == zone_at(180.0, -3) == Zone(1, True)
    assert zone_at(179.99, 3) == Zone(60, False)
    assert zone_of("EPSG:25832") == zone_of("epsg:32632") == Zone(32, False)
    assert zone_of("EPSG:32733") == Zone(33, True)
    assert zone_of("EPSG:2154") is zone_of("EPSG:32661") is zone_of("a map") is None
    assert (Zone(5, False).crs, Zone(33, True).crs) == ("EPSG:32605", "EPSG:32733")
