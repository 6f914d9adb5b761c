"""Landscapes on the earth: beside the values of PROJ, and beside geometry that needs none."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from tile_cases import TWO_SPECIES, all_of, feet, scene_of

from vegtool.errors import UsageError
from vegtool.tiles.georeference import check_crs, earth_from_scene, notes_on
from vegtool.tiles.placement import Placement, placement_of
from vegtool.tiles.projection import Zone
from vegtool.tiles.terrain import Terrain, terrain_of

EARTH = 6_378_137.0
"""Metres: the equator's radius."""
PLACES = [
    ("EPSG:32632", 566_331.5, 5_928_359.1),
    ("EPSG:25833", 231_000.0, 7_500_000.0),
    ("EPSG:32733", 347_128.2, 7_372_645.4),
    ("EPSG:2154", 700_000.0, 6_600_000.0),
    ("EPSG:2056", 2_600_000.0, 1_200_000.0),
]
"""Maps and places on them; the last two are France's and Switzerland's."""


def matrix(crs: str, x: float, y: float, height: float = 0.0) -> np.ndarray:
    found = earth_from_scene(crs, np.array([x, y, 0.0]), height)
    assert found is not None
    return found


def moved(found: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.asarray(points @ found[:3, :3].T + found[:3, 3])


def test_where_the_equator_meets_a_central_meridian() -> None:
    """In zone 31 that is 3 degrees east. North is the earth's axis, and a metre on the map is
    1 / 0.9996 m there."""
    found, angle = matrix("EPSG:32631", 500_000, 0), np.radians(3)
    out, along = np.array([np.cos(angle), np.sin(angle), 0]), [-np.sin(angle), np.cos(angle), 0]
    np.testing.assert_allclose(found[:3, 3], EARTH * out, atol=1e-6)
    wanted = np.stack([along, [0, 0, 1], out], axis=1) / 0.9996
    np.testing.assert_allclose(found[:3, :3], wanted, atol=1e-9)
    assert found[3].tolist() == [0, 0, 0, 1]


@pytest.mark.parametrize(("crs", "x", "y"), PLACES)
def test_it_is_a_similarity(crs: str, x: float, y: float) -> None:
    """Nothing is stretched, as clients need boxes and normals to be what they are."""
    if crs not in ("EPSG:32632", "EPSG:25833", "EPSG:32733"):
        pytest.importorskip("rasterio", reason="the extra [geo] is not installed")
    turned = matrix(crs, x, y)[:3, :3]
    size = np.cbrt(np.linalg.det(turned))
    assert size == pytest.approx(1, abs=2e-3)
    np.testing.assert_allclose(turned.T @ turned, size**2 * np.eye(3), atol=1e-12)


@pytest.mark.parametrize(("crs", "x", "y"), PLACES)
@pytest.mark.parametrize("height", [0.0, 800.0])
def test_places_around_are_where_proj_puts_them(
    crs: str, x: float, y: float, height: float
) -> None:
    """Within 100 m, to a fifth of a millimetre, less the sag of a flat frame: d squared over the
    earth's diameter. 270 km from its meridian a map's scale grows by 6e-9 with each metre."""
    warp = pytest.importorskip("rasterio.warp", reason="the extra [geo] is not installed")
    points = np.random.default_rng(0).uniform(-100, 100, (50, 3))
    points[:, 2] = height
    found = matrix(crs, x, y, height)
    longitude, latitude = warp.transform(crs, "EPSG:4326", x + points[:, 0], y + points[:, 1])
    wanted = np.array(warp.transform("EPSG:4979", "EPSG:4978", longitude, latitude, points[:, 2])).T
    up = found[:3, 2] / np.linalg.norm(found[:3, 2])
    sag = (points[:, :2] ** 2).sum(axis=1) / (2 * EARTH)
    off = moved(found, points) - sag[:, None] * up - wanted
    assert np.abs(off).max() < 2e-4


def test_the_frame_is_flat() -> None:
    """5 km away, 2 m above the ground."""
    warp = pytest.importorskip("rasterio.warp", reason="the extra [geo] is not installed")
    x, y = 566_331.5, 5_928_359.1
    there = np.array(warp.transform("EPSG:32632", "EPSG:4978", [x, x], [y, y + 5000], [0, 0])).T
    found = matrix("EPSG:32632", x, y)
    up = found[:3, 2] / np.linalg.norm(found[:3, 2])
    off = (moved(found, np.array([[0.0, 5000.0, 0.0]])) - there[1:]) @ up
    assert off == pytest.approx(5000**2 / (2 * EARTH), rel=0.01) and off == pytest.approx(
        2, abs=0.1
    )


def test_heights_are_exact_where_plants_stand() -> None:
    """On a map that is scaled, others are off by as much as the map: 4 cm per 100 m."""
    low, high = matrix("EPSG:32632", 500_000, 6e6), matrix("EPSG:32632", 500_000, 6e6, 1000.0)
    foot = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1000.0], [0.0, 0.0, 1100.0]])
    up = low[:3, 2] / np.linalg.norm(low[:3, 2])
    from_ground = (moved(high, foot) - low[:3, 3]) @ up
    assert from_ground[1] == pytest.approx(1000, abs=1e-6)
    assert from_ground[2] == pytest.approx(1100, abs=0.06) and from_ground[2] > 1100.03


def test_degrees_are_on_the_map_of_their_zone() -> None:
    east, north = Zone(32, False).project(np.array([10.0]), np.array([53.5]))
    wanted = matrix("EPSG:32632", float(east[0]), float(north[0]))
    np.testing.assert_allclose(matrix("EPSG:4326", 10.0, 53.5), wanted, atol=1e-6)


def test_utm_needs_no_proj(monkeypatch: pytest.MonkeyPatch) -> None:
    """And both ways to it give the same."""
    pytest.importorskip("rasterio", reason="the extra [geo] is not installed")
    from vegtool.tiles import georeference

    wanted = georeference._by_proj("EPSG:32632", np.array([566_331.5, 5_928_359.1, 0.0]))
    monkeypatch.setitem(sys.modules, "rasterio", None)
    found = georeference._place("EPSG:32632", np.array([566_331.5, 5_928_359.1, 0.0]))
    assert isinstance(wanted, georeference.Place) and isinstance(found, georeference.Place)
    for name in ("longitude", "latitude", "convergence", "scale"):
        assert getattr(found, name) == pytest.approx(getattr(wanted, name), abs=1e-9)


# ------------------------------------------------------------------------------ from scene to earth


def placed(folder: Path, terrain: str, rows: list[str], header: str) -> tuple[Terrain, Placement]:
    (folder / "trees.csv").write_text("\n".join([header, *rows]))
    text = f"{terrain}\n{TWO_SPECIES}\n[placement]\ninventory = 'trees.csv'\n"
    scene = scene_of(folder, text)
    ground = terrain_of(scene)
    return ground, placement_of(scene, ground)


def on_earth(placement: Placement) -> np.ndarray:
    """(n, 3) of the plants' feet, by row."""
    found = earth_from_scene(placement.crs, placement.origin)
    assert found is not None
    parts = all_of(placement)
    x, y, z = np.concatenate([feet(plants) for plants in parts]).T
    order = np.argsort(np.concatenate([plants.row for plants in parts]))
    return moved(found, np.stack([x, -z, y], axis=1)[order])


DEGREES = ["10.0,53.5,ash", "10.001,53.501,pine"]


def ecef(longitude: float, latitude: float) -> np.ndarray:
    """Of a place on the ellipsoid, as every textbook has it."""
    a, e2 = EARTH, 0.0066943799901413165
    lam, phi = np.radians(longitude), np.radians(latitude)
    n = a / np.sqrt(1 - e2 * np.sin(phi) ** 2)
    flat = n * np.cos(phi)
    return np.array([flat * np.cos(lam), flat * np.sin(lam), n * (1 - e2) * np.sin(phi)])


@pytest.mark.parametrize(
    "terrain",
    [
        "",
        '[terrain]\ncrs = "EPSG:25832"',
        '[terrain]\ncrs = "EPSG:32633"',
        '[terrain]\ncrs = "EPSG:4326"',
        '[terrain]\ncrs = "EPSG:4326"\norigin = [10.0, 53.5]',
        "[terrain]\norigin = [10.0, 53.5]",
    ],
)
def test_plants_in_degrees_stand_at_these_degrees(tmp_path: Path, terrain: str) -> None:
    """Whichever map they pass through; the zone of a map that is not said is known afterwards."""
    ground, placement = placed(tmp_path, terrain, DEGREES, "lon,lat,species")
    wanted = np.array([ecef(10.0, 53.5), ecef(10.001, 53.501)])
    assert np.abs(on_earth(placement) - wanted).max() < 5e-3
    assert notes_on(ground, placement) == ()


def test_rules_in_degrees_are_on_a_map(tmp_path: Path) -> None:
    text = '[terrain]\ncrs = "EPSG:4326"\norigin = [10.0, 53.5]\nextent_m = [20, 20]\n'
    scene = scene_of(tmp_path, text + TWO_SPECIES + "[placement]\nspacing_m = 5\n")
    ground = terrain_of(scene)
    placement = placement_of(scene, ground)
    assert placement.crs == ground.crs == "EPSG:32632"
    found = earth_from_scene(placement.crs, placement.origin)
    assert found is not None
    np.testing.assert_allclose(found[:3, 3], ecef(10.0, 53.5), atol=1e-6)


def test_without_a_map_there_is_no_place(tmp_path: Path) -> None:
    ground, placement = placed(tmp_path, "", ["565000,5930000,ash"], "x,y,species")
    assert placement.crs is None and earth_from_scene(None, placement.origin) is None
    assert notes_on(ground, placement) == ()


def test_a_map_without_an_origin_is_said(tmp_path: Path) -> None:
    """Coordinates near 0 are the scene's own, wherever on the map that is."""
    ground, placement = placed(
        tmp_path, '[terrain]\ncrs = "EPSG:25832"', ["3,4,ash"], "x,y,species"
    )
    assert placement.crs is None
    (note,) = notes_on(ground, placement)
    assert note.startswith("EPSG:25832: expected where the scene's origin is on this map")
    rules = "[placement]\nspacing_m = 5\n[terrain]\ncrs = 'EPSG:25832'\nextent_m = [20, 20]\n"
    scene = scene_of(tmp_path, TWO_SPECIES + rules)
    ground = terrain_of(scene)
    assert placement_of(scene, ground).crs is None
    assert notes_on(ground, placement_of(scene, ground)) == (note,)


FRENCH = '[terrain]\ncrs = "EPSG:2154"'


def test_other_maps_need_rasterio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rasterio", None)
    ground, placement = placed(tmp_path, FRENCH, ["700000,6600000,ash"], "x,y,species")
    assert placement.crs == "EPSG:2154"
    assert earth_from_scene(placement.crs, placement.origin) is None
    (note,) = notes_on(ground, placement)
    assert note.startswith("EPSG:2154: expected a UTM zone, such as EPSG:25832, or rasterio, which")
    assert note.endswith("tiles are put nowhere on the earth; run pip install 'vegtool[geo]'")


@pytest.mark.parametrize(
    ("crs", "place", "says"),
    [
        ("EPSG:2154", (1e9, 1e9), "expected a map on which a metre is one on the ground to 2%, f"),
        ("EPSG:3857", (1e6, 6e6), "found one of 0.677 m; tiles are put nowhere on the earth; rep"),
        ("EPSG:99999", (0, 0), "expected a map that PROJ knows, found none of that name; tiles "),
    ],
)  # fmt: skip
def test_places_that_are_none(crs: str, place: tuple[float, float], says: str) -> None:
    pytest.importorskip("rasterio", reason="the extra [geo] is not installed")
    from vegtool.tiles import georeference

    origin = np.array([*place, 0.0])
    found = georeference._place(crs, origin)
    assert earth_from_scene(crs, origin) is None
    assert isinstance(found, str) and found.startswith(f"{crs}: expected ")
    assert says in found


# ---------------------------------------------------------------------------- what cannot be read


@pytest.mark.parametrize(
    ("crs", "says"),
    [
        ("EPSG:banana", "expected a code, such as EPSG:25832; got 'EPSG:banana'"),
        ("UTM north", "expected a code, such as EPSG:25832; got 'UTM north'"),
        ("25832", "expected a code, such as EPSG:25832; got '25832'"),
        ("EPSG:99999", "expected a code that PROJ knows, such as EPSG:25832; got 'EPSG:99999'"),
        ("EPSG:2225", "expected a map in metres, such as EPSG:25832, or EPSG:4326; got EPSG:2225"),
        ("EPSG:4314", "expected a map in metres, such as EPSG:25832, or EPSG:4326; got EPSG:4314"),
    ],
)
def test_maps_that_cannot_be_read(tmp_path: Path, crs: str, says: str) -> None:
    """The last ones are California's in feet, and degrees on another ellipsoid."""
    if "EPSG:9" in crs or "EPSG:2" in crs or "EPSG:4" in crs:
        pytest.importorskip("rasterio", reason="the extra [geo] is not installed")
    with pytest.raises(UsageError) as caught:
        terrain_of(scene_of(tmp_path, f'\n[terrain]\ncrs = "{crs}"\n'))
    said = str(caught.value).replace(f"{tmp_path}/", "")
    assert said.startswith(f"scene.toml, line 3: crs: {says}")
    assert caught.value.exit_code == 2


def test_codes_pass_without_rasterio(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rasterio", None)
    for crs in ("EPSG:2154", "epsg:25832", "ESRI:102008", "OGC:CRS84"):
        check_crs(crs, "here")


@pytest.mark.parametrize(
    ("terrain", "says"),
    [
        (
            'crs = "EPSG:4326"\norigin = [565000, 5930000]',
            "origin: expected degrees of longitude and latitude, as crs is EPSG:4326; got 565000",
        ),
        (
            'crs = "EPSG:25832"\norigin = [10, 53.5]',
            "origin: expected metres east and north, as crs is EPSG:25832; got 10, 53.5, which loo",
        ),
        ("\norigin = [565000, 5930000]", "origin: expected degrees, as trees.csv has longitude an"),
    ],
)
def test_origins_of_another_kind(tmp_path: Path, terrain: str, says: str) -> None:
    with pytest.raises(UsageError) as caught:
        placed(tmp_path, f"[terrain]\n{terrain}\n", DEGREES, "lon,lat,species")
    assert str(caught.value).replace(f"{tmp_path}/", "").startswith(f"scene.toml, line 3: {says}")
