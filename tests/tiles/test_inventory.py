"""Plants of a file on tiles: where they stand to the millimetre, in what order, on what ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tile_cases import TWO_SPECIES, all_of, bytes_of, feet, picture, placed

from vegtool.errors import InputError, UsageError
from vegtool.tiles.placement import Placement
from vegtool.tiles.projection import Zone

HEIGHTS = '[terrain]\nkind = "heightmap"\nheightmap = "hill.png"\nextent_m = [200, 100]\n'


def inventory(
    folder: Path, rows: list[str], header: str = "x,y,species", more: str = "", tile_m: float = 128
) -> Placement:
    (folder / "trees.csv").write_text("\n".join([header, *rows]))
    text = more + TWO_SPECIES + '\n[placement]\nseed = 5\ninventory = "trees.csv"\n'
    return placed(folder, text, tile_m)


def on_the_map(placement: Placement) -> dict[int, tuple[float, ...]]:
    """East, north and up of each row."""
    found = {}
    for plants in all_of(placement):
        for row, (x, y, z) in zip(plants.row.tolist(), feet(plants), strict=True):
            found[row] = tuple(np.add(placement.origin, (x, -z, y)).tolist())
    return found


def test_east_is_x_and_north_is_minus_z(tmp_path: Path) -> None:
    """Near its origin, a map's coordinates are the scene's."""
    placement = inventory(tmp_path, ["3,10,ash"])
    assert placement.origin.tolist() == [0, 0, 0] and placement.notes == ()
    assert feet(placement.plants(0)).tolist() == [[3, 0, -10]]


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.integers(0, 2**32),
    st.sampled_from([(0, 0), (565_000, 5_930_000), (833_978.5, 9_329_005.25), (1e6, -3e6)]),
)
def test_every_plant_is_where_it_is_on_the_map(
    tmp_path: Path, seed: int, corner: tuple[float, float]
) -> None:
    """Within a millimetre, on 3 km, and each is there once, in the bounds of its tile."""
    rng = np.random.default_rng(seed)
    places = [
        (f"{corner[0] + x:.4f}", f"{corner[1] + y:.4f}") for x, y in rng.uniform(0, 3e3, (60, 2))
    ]
    placement = inventory(tmp_path, [f"{x},{y},ash" for x, y in places])
    found = on_the_map(placement)
    assert sorted(found) == list(range(1, 61))
    for row, (x, y) in enumerate(places, start=1):
        assert found[row] == pytest.approx((float(x), float(y), 0), abs=1e-3)
    tiles = placement.tiles
    assert tiles.count.sum() == 60
    assert ((tiles.high - tiles.low)[:, [0, 2]] <= placement.tile_m + 1e-3).all()
    for tile, plants in enumerate(all_of(placement)):
        at = feet(plants)
        assert len(plants) == tiles.count[tile]
        assert at.min(axis=0) == pytest.approx(tiles.low[tile], abs=1e-9)
        assert at.max(axis=0) == pytest.approx(tiles.high[tile], abs=1e-9)


def test_moving_an_inventory_moves_everything(tmp_path: Path) -> None:
    """By a whole number of metres, as then rounding is the same: the origin alone is another."""
    rng = np.random.default_rng(0)
    places = rng.integers(0, 400_000, (50, 2)) / 1024 + (565_000, 5_930_000)
    here = inventory(tmp_path, [f"{x!r},{y!r},ash" for x, y in places.tolist()])
    moved = np.add(places, (1000, -7000))
    there = inventory(tmp_path, [f"{x!r},{y!r},ash" for x, y in moved.tolist()])
    assert (there.origin - here.origin).tolist() == [1000, -7000, 0]
    assert [bytes_of(plants) for plants in all_of(here)] == [bytes_of(p) for p in all_of(there)]


def test_the_first_plants_are_the_first_of_all(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = [f"{x},{y},ash,{h}" for x, y, h in rng.uniform((0, 0, 2), (128, 128, 30), (300, 3))]
    placement = inventory(tmp_path, rows, "x,y,species,height")
    tiles = [tile for tile in range(len(placement.tiles)) if placement.tiles.count[tile] > 100]
    for tile in tiles:
        whole = placement.plants(tile)
        assert (np.diff(np.floor(np.log2(whole.height))) <= 0).all()
        for most in (0, 1, 50, len(whole), 10**6):
            part = placement.plants(tile, most)
            assert np.array_equal(part.row, whole.row[:most])
            assert np.array_equal(part.offset, whole.offset[:most])
            assert np.array_equal(part.tint, whole.tint[:most])
    assert tiles


def test_the_file_decides_and_the_seed_what_it_leaves_open(tmp_path: Path) -> None:
    header = "x,y,species,height,yaw"
    rows = ["1,1,ash,7.5,90", "2,2,ash,,", "3,3,pine,,36450"]
    more = "[terrain]\nextent_m = [50, 50]\n"
    (tmp_path / "trees.csv").write_text("\n".join([header, *rows]))
    text = more + TWO_SPECIES.replace('"ash"\n', '"ash"\nheight_m = [10, 20]\n')
    text += '\n[placement]\nseed = {}\ninventory = "trees.csv"\n'
    first, again, other = (placed(tmp_path, text.format(seed)) for seed in (5, 5, 6))
    assert [bytes_of(plants) for plants in all_of(first)] == [bytes_of(p) for p in all_of(again)]
    plants, others = first.plants(0), other.plants(0)
    a, b, c = (int(np.flatnonzero(plants.row == row)[0]) for row in (1, 2, 3))
    d = int(np.flatnonzero(others.row == 2)[0])
    assert plants.height[a] == 7.5 and 10 <= plants.height[b] <= 20 and np.isnan(plants.height[c])
    assert plants.yaw[[a, c]] == pytest.approx(np.pi / 2), "whole turns are none"
    assert plants.species[[a, b, c]].tolist() == [0, 0, 1]
    for name in ("height", "yaw", "tint"):
        assert (getattr(plants, name)[b] != getattr(others, name)[d]).all()


def test_the_tallest_of_each_kind_is_known_before_any_tile_is_asked_for(tmp_path: Path) -> None:
    """On whichever tile it stands. One without a height, as tall as its model, is passed over;
    where none of a kind has one, or none is there, there is nothing to say."""
    rows = ["1,1,ash,3", "400,1,ash,12.5", "-300,9,ash,", "2,2,pine,"]
    placement = inventory(tmp_path, rows, "x,y,species,height")
    assert len(placement.tiles) > 1
    np.testing.assert_array_equal(placement.tallest(3), [12.5, np.nan, np.nan])
    assert placement.measured(3).tolist() == [False, False, True]
    without = inventory(tmp_path, ["1,1,ash", "2,2,pine"])
    assert np.isnan(without.tallest(2)).all()


def test_a_row_removed_changes_no_other(tmp_path: Path) -> None:
    """But for its number, which is the row's: so the last one."""
    rng = np.random.default_rng(2)
    rows = [f"{x},{y},ash" for x, y in rng.uniform(0, 100, (40, 2))]
    whole, less = inventory(tmp_path, rows), inventory(tmp_path, rows[:-1])
    for name in ("yaw", "tint"):
        here = {
            r: v
            for p in all_of(whole)
            for r, v in zip(p.row, getattr(p, name).tolist(), strict=True)
        }
        there = {
            r: v
            for p in all_of(less)
            for r, v in zip(p.row, getattr(p, name).tolist(), strict=True)
        }
        assert {row: here[row] for row in there} == there


def test_z_is_the_height_where_there_is_no_ground(tmp_path: Path) -> None:
    placement = inventory(tmp_path, ["1,2,512.25,ash", "3,4,,ash"], "x,y,z,species")
    assert {row: up for row, (_, _, up) in on_the_map(placement).items()} == {1: 512.25, 2: 0}
    (note,) = placement.notes
    assert note.endswith("plants without z, which stand at height 0: 1")
    with pytest.raises(
        InputError, match=r"row 2 \(line 3\), column z_ft: expected -1000 to 10000 m"
    ):
        inventory(tmp_path, ["1,2,3000,ash", "3,4,-9999,ash"], "x,y,z_ft,species")


def test_plants_stand_on_the_ground_where_there_is_one(tmp_path: Path) -> None:
    picture(tmp_path / "hill.png", [[0, 65_535], [0, 65_535]])
    more = HEIGHTS + "height_m = [10, 30]\n"
    placement = inventory(tmp_path, ["-50,0,99,ash", "100,0,99,ash"], "x,y,z,species", more)
    found = on_the_map(placement)
    assert found[1][2] == pytest.approx(15, abs=1e-4)
    assert found[2][2] == pytest.approx(30, abs=1e-4)
    (note,) = placement.notes
    assert note.endswith("z, which is not used, is 76.5 m above it, in the median")


def test_the_scene_says_where_the_ground_is(tmp_path: Path) -> None:
    """Its middle is at `origin`; what is not on it is left out and counted."""
    picture(tmp_path / "hill.png", [[0, 65_535], [0, 65_535]])
    more = HEIGHTS + "height_m = [10, 30]\norigin = [565000, 5930000]\n"
    rows = ["565100,5930000,ash", "565000,5930050.5,ash", "565000,5929950,pine"]
    placement = inventory(tmp_path, rows, more=more)
    assert placement.origin.tolist() == [565_000, 5_930_000, 0]
    found = on_the_map(placement)
    assert sorted(found) == [1, 3]
    assert found[1] == pytest.approx((565_100, 5_930_000, 30), abs=1e-3)
    (note,) = placement.notes
    assert "not on the ground of 200 x 100 m and left out: 1, the first in row 2" in note
    assert note.endswith("at x = 0.00, z = -50.50 m from the scene's origin")
    with pytest.raises(InputError) as caught:
        inventory(tmp_path, rows[1:2], more=more)
    assert "row 1 (line 2): expected plants on the ground of 200 x 100 m, found none" in str(
        caught.value
    )


def test_heights_without_a_place_and_a_map_far_away_are_no_scene(tmp_path: Path) -> None:
    picture(tmp_path / "hill.png", [[0, 65_535], [0, 65_535]])
    with pytest.raises(UsageError) as caught:
        inventory(tmp_path, ["565000,5930000,ash"], more=HEIGHTS + "height_m = [10, 30]\n")
    said = str(caught.value)
    assert "line 3: expected origin in [terrain], where the middle of the heights is" in said
    assert said.endswith("the inventory's middle is origin = [565000, 5930000]")


def test_the_middle_of_a_map_far_away_is_the_origin(tmp_path: Path) -> None:
    placement = inventory(tmp_path, ["565000.25,5930000,ash", "565100.25,5930300,ash"])
    assert placement.origin.tolist() == [565_050, 5_930_150, 0]
    (note,) = placement.notes
    assert "the scene's origin is put at its middle, origin = [565050, 5930150]; say" in note


DEGREES = ["10.0,53.5,ash", "10.001,53.501,pine"]


def degrees_in(zone: Zone) -> np.ndarray:
    east, north = zone.project(np.array([10.0, 10.001]), np.array([53.5, 53.501]))
    return np.stack([east, north], axis=1)


@pytest.mark.parametrize(
    ("terrain", "zone"),
    [
        ("", Zone(32, False)),
        ('[terrain]\ncrs = "EPSG:25832"\n', Zone(32, False)),
        ('[terrain]\ncrs = "EPSG:32633"\n', Zone(33, False)),
        ('[terrain]\ncrs = "EPSG:4326"\norigin = [10.0, 53.5]\n', Zone(32, False)),
        ("[terrain]\norigin = [10.0, 53.5]\n", Zone(32, False)),
    ],
)
def test_degrees_become_metres(tmp_path: Path, terrain: str, zone: Zone) -> None:
    placement = inventory(tmp_path, DEGREES, "lon,lat,species", terrain)
    found = on_the_map(placement)
    assert [found[row][:2] for row in (1, 2)] == pytest.approx(degrees_in(zone), abs=1e-3)
    if "origin" in terrain:
        assert placement.origin[:2] == pytest.approx(degrees_in(zone)[0], abs=1e-6)
    said = f"longitude and latitude became metres in EPSG:326{zone.number}, UTM zone {zone.number}"
    assert any(said in note for note in placement.notes) == (
        "EPSG:25832" not in terrain and "33" not in terrain
    )


def test_degrees_on_both_sides_of_180_are_neighbours(tmp_path: Path) -> None:
    """0.0002 degrees on the equator: 22.264 m, and at the edge of a zone 0.1 % more."""
    rows = ["179.9999,0,ash", "-179.9999,0,pine"]
    found = on_the_map(inventory(tmp_path, rows, "lon,lat,species"))
    assert np.subtract(found[2], found[1]) == pytest.approx([22.286, 0, 0], abs=0.001)


def test_columns_of_metres_are_degrees_where_the_scene_says_so(tmp_path: Path) -> None:
    placement = inventory(tmp_path, DEGREES, more='[terrain]\ncrs = "EPSG:4326"\n')
    found = on_the_map(placement)
    assert found[2][:2] == pytest.approx(degrees_in(Zone(32, False))[1], abs=1e-3)
    with pytest.raises(
        InputError, match=r"column y: expected -80 to 84 degrees, found 85; correct"
    ):
        inventory(tmp_path, ["1,2,ash", "3,85,ash"], more='[terrain]\ncrs = "EPSG:4326"\n')


def test_degrees_on_a_map_that_is_not_known(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        inventory(tmp_path, DEGREES, "lon,lat,species", '[terrain]\ncrs = "EPSG:2154"\n')
    said = str(caught.value)
    assert "has longitude and latitude, and the ground is in EPSG:2154; expected a UTM zone" in said
    assert said.endswith("for example with ogr2ogr -t_srs EPSG:2154")


def test_many_tiles_and_small_ones(tmp_path: Path) -> None:
    """Every plant alone on its tile; a place that divides two tiles belongs to one."""
    rows = [f"{x},{y},ash" for x in range(-3, 3) for y in range(-3, 3)]
    placement = inventory(tmp_path, rows, tile_m=1.0)
    assert len(placement.tiles) == 36 and (placement.tiles.count == 1).all()
    assert np.array_equal(placement.tiles.low, placement.tiles.high)
