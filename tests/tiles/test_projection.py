"""UTM beside the values of PROJ 9 for the same places, and its own symmetries."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.tiles.projection import Zone, is_degrees, is_world, same_map, zone_at, zone_of

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


@pytest.mark.parametrize(("crs", "longitude", "latitude", "east", "north"), PROJ)
def test_and_back(crs: str, longitude: float, latitude: float, east: float, north: float) -> None:
    zone = zone_of(crs)
    assert zone is not None
    found = zone.unproject(np.array([east]), np.array([north]))
    assert found == (pytest.approx([longitude], abs=1e-11), pytest.approx([latitude], abs=1e-11))


def places(zone: Zone, count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """All over a zone and as far again on either side, to where UTM ends."""
    rng = np.random.default_rng(zone.number)
    latitude = rng.uniform(0, 80 if zone.south else 84, count) * (-1 if zone.south else 1)
    longitude = zone.meridian + rng.uniform(-6, 6, count)
    return (longitude + 180) % 360 - 180, latitude


ZONES = [Zone(32, False), Zone(33, True), Zone(1, False), Zone(60, True)]


@pytest.mark.parametrize("zone", ZONES)
def test_there_and_back_is_where_it_was(zone: Zone) -> None:
    """Within half a micrometre, of the 111 km that a degree has; across the date line too."""
    longitude, latitude = places(zone)
    found = zone.unproject(*zone.project(longitude, latitude))
    np.testing.assert_allclose(found, (longitude, latitude), rtol=0, atol=5e-12)


@pytest.mark.parametrize("zone", ZONES)
def test_proj_agrees_to_a_micrometre(zone: Zone) -> None:
    """Both ways; of its degrees, a hundred billionth is a micrometre."""
    warp = pytest.importorskip("rasterio.warp", reason="the extra [geo] is not installed")
    longitude, latitude = places(zone)
    wanted = warp.transform("EPSG:4326", zone.crs, longitude, latitude)
    np.testing.assert_allclose(zone.project(longitude, latitude), wanted, rtol=0, atol=1e-6)
    east, north = (np.array(values) for values in wanted)
    back = warp.transform(zone.crs, "EPSG:4326", east, north)
    np.testing.assert_allclose(zone.unproject(east, north), back, rtol=0, atol=1e-11)


@pytest.mark.parametrize("zone", ZONES)
def test_convergence_and_scale_are_what_differences_of_proj_say(zone: Zone) -> None:
    """Of places one and two steps to the map's north, to the fourth order of the step: its error is
    (500 m / 6,400 km)^4, and that of rounding a nanometre over a step."""
    warp = pytest.importorskip("rasterio.warp", reason="the extra [geo] is not installed")
    longitude, latitude = places(zone)
    east, north = zone.project(longitude, latitude)
    radians = np.zeros((2, len(east)))
    for times, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1)):
        found = np.array(warp.transform(zone.crs, "EPSG:4326", east, north + 500.0 * times))
        away = (found - (longitude, latitude) + 180) % 360 - 180
        radians += np.radians(away) * weight / (12 * 500.0)
    flat = 1 - 0.0066943799901413165 * np.sin(np.radians(latitude)) ** 2  # e squared, of WGS 84
    to_east = radians[0] * np.cos(np.radians(latitude)) * 6_378_137 / np.sqrt(flat)
    to_north = radians[1] * 6_378_137 * (1 - 0.0066943799901413165) / flat**1.5
    convergence, scale = zone.distortion(longitude, latitude)
    np.testing.assert_allclose(convergence, np.arctan2(to_east, to_north), rtol=0, atol=1e-9)
    np.testing.assert_allclose(scale, 1 / np.hypot(to_east, to_north), rtol=0, atol=1e-9)


def test_the_central_meridian_points_north() -> None:
    """At 0.9996; east of it the map's north is east of north, in the south west of it."""
    convergence, scale = Zone(32, False).distortion(np.array([9.0, 11.0]), np.array([50.0, 50.0]))
    assert convergence[0] == 0 and scale[0] == pytest.approx(0.9996, abs=1e-12)
    assert convergence[1] == pytest.approx(np.radians(2) * np.sin(np.radians(50)), rel=1e-3)
    assert Zone(32, True).distortion(np.array([11.0]), np.array([-50.0]))[0] < 0


def test_maps_of_other_names() -> None:
    """EPSG:26923 is the last zone of NAD83; 26929 is Alabama's, 25827 nobody's."""
    assert zone_of("EPSG:26923") == Zone(23, False)
    assert zone_of("EPSG:26929") is zone_of("EPSG:25827") is zone_of("EPSG:25860") is None
    assert same_map("EPSG:25832", "epsg:32632") and not same_map("EPSG:25832", "EPSG:32732")
    assert same_map("EPSG:4258", "OGC:CRS84") and not same_map("EPSG:4326", "EPSG:32632")
    assert same_map("epsg:2154", "EPSG:2154") and not same_map("EPSG:2154", "EPSG:2056")
    assert is_world("epsg:4326") and not is_world("EPSG:32632") and not is_world(None)
    assert is_degrees(-180, 84) and not is_degrees(10, 85) and not is_degrees(565_000, 50)


def test_zones_of_places_and_names() -> None:
    assert zone_at(10.1, 50) == Zone(32, False)
    assert zone_at(-179.9, -3) == zone_at(180.0, -3) == Zone(1, True)
    assert zone_at(179.99, 3) == Zone(60, False)
    assert zone_of("EPSG:25832") == zone_of("epsg:32632") == Zone(32, False)
    assert zone_of("EPSG:32733") == Zone(33, True)
    assert zone_of("EPSG:2154") is zone_of("EPSG:32661") is zone_of("a map") is None
    assert (Zone(5, False).crs, Zone(33, True).crs) == ("EPSG:32605", "EPSG:32733")
