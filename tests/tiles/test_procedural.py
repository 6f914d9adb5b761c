"""Plants by rules: their distances, their seams, where they grow, and what they depend on."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tile_cases import all_of, bytes_of, feet, least_distance, picture, placed, scene_of

from vegtool.errors import InputError, UsageError, VegtoolError
from vegtool.tiles.pattern import least_distance as pattern_distance
from vegtool.tiles.placement import Plants, placement_of
from vegtool.tiles.procedural import Procedural
from vegtool.tiles.terrain import Terrain, terrain_of

PLAIN = """
[terrain]
extent_m = [{width}, {depth}]

[[species]]
name = "ash"
share = 0.25
height_m = [10, 20]

[[species]]
name = "herb"
share = 0.75
height_m = [0.2, 0.4]

[placement]
spacing_m = {spacing}
seed = 3
"""
PERIOD = 1 / pattern_distance()
"""Times the spacing: 82.4."""


def plain(
    folder: Path, width: float = 400, depth: float = 400, spacing: float = 3, tile_m: float = 128
) -> Procedural:
    text = PLAIN.format(width=width, depth=depth, spacing=spacing)
    placement = placed(folder, text, tile_m)
    assert isinstance(placement, Procedural)
    return placement


def together(placement: Procedural) -> dict[str, np.ndarray]:
    """All plants, by row, whatever tiles they came in."""
    parts = all_of(placement)
    rows = np.concatenate([part.row for part in parts])
    order = np.argsort(rows)
    found = {"row": rows[order], "feet": np.concatenate([feet(part) for part in parts])[order]}
    for name in ("species", "yaw", "height", "tint"):
        found[name] = np.concatenate([getattr(part, name) for part in parts])[order]
    return found


def test_no_two_plants_of_nine_tiles_are_nearer_than_the_spacing(tmp_path: Path) -> None:
    """Across the borders of tiles and of periods too: all pairs, one plant after the other."""
    side = 3 * PERIOD
    placement = plain(tmp_path, side, side, 1, PERIOD)
    assert placement.scale == 0 and placement.tile_m == pytest.approx(PERIOD)
    assert len(placement.tiles) == 16, "tiles begin at the origin, the middle of the extent"
    found = together(placement)["feet"][:, [0, 2]]
    assert len(found) == pytest.approx(9 * 4096, rel=0.01)
    assert len(np.unique(found, axis=0)) == len(found)
    nearest, _ = cKDTree(found).query(found, k=2)
    assert nearest[:, 1].min() > 1 - 1e-5
    assert nearest[:, 1].min() < 1.02, "the spacing is reached"
    middle = found[(np.abs(found) < 12).all(axis=1)]
    assert least_distance(middle) > 1 - 1e-5


@pytest.mark.parametrize("wanted", [0.13, 0.5, 1.0, 2.1, 4.0])
def test_plants_do_not_depend_on_the_size_of_tiles(tmp_path: Path, wanted: float) -> None:
    """Parts of a period and several periods hold the same plants, to float32's rounding."""
    usual = together(plain(tmp_path, 300, 200, 2, PERIOD * 2))
    other = plain(tmp_path, 300, 200, 2, wanted * PERIOD * 2)
    assert 2**other.scale == pytest.approx(wanted, rel=0.5)
    found = together(other)
    for name in ("row", "species", "yaw", "height", "tint"):
        assert np.array_equal(found[name], usual[name])
    assert found["feet"] == pytest.approx(usual["feet"], abs=1e-4)


def test_the_first_plants_of_a_tile_are_the_first_of_all_of_them(tmp_path: Path) -> None:
    placement = plain(tmp_path, tile_m=1000)
    whole = placement.plants(0)
    for most in (0, 1, 7, 900, len(whole), 10**9):
        part = placement.plants(0, most)
        assert len(part) == min(most, len(whole))
        for name in ("offset", "species", "yaw", "height", "tint", "row"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[:most])


def test_the_first_plants_are_tall_and_spread_evenly(tmp_path: Path) -> None:
    """Half of the tall ones are as far from each other as half of as many plants can be."""
    placement = plain(tmp_path, 2 * PERIOD, 2 * PERIOD, 1, PERIOD)
    plants = placement.plants(0)
    assert (np.diff(plants.species) >= 0).all()
    counts = Counter(plants.species.tolist())
    assert counts[0] / len(plants) == pytest.approx(0.25, abs=0.002)
    assert counts[1] / len(plants) == pytest.approx(0.75, abs=0.002)
    for count in (100, 512, 1024):
        distance, _ = cKDTree(plants.offset[:count]).query(plants.offset[:count], k=2)
        hexagonal = placement.tile_m * np.sqrt(2 / np.sqrt(3) / count)
        assert distance[:, 1].min() > 0.6 * hexagonal
        assert distance[:, 1].mean() > 0.75 * hexagonal


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    """In any order, and whatever tiles were made before."""
    first, second = plain(tmp_path), plain(tmp_path)
    tiles = range(len(first.tiles))
    there = [bytes_of(first.plants(tile)) for tile in tiles]
    again = {tile: bytes_of(second.plants(tile)) for tile in reversed(tiles)}
    assert there == [again[tile] for tile in tiles]


def test_another_seed_gives_other_plants(tmp_path: Path) -> None:
    text = PLAIN.format(width=400, depth=400, spacing=3)
    one = placed(tmp_path, text).plants(3)
    other = placed(tmp_path, text.replace("seed = 3", "seed = 4")).plants(3)
    shared, a, b = np.intersect1d(one.row, other.row, return_indices=True)
    assert len(shared) > 0.98 * len(one), "only on the border, where some are moved across it"
    for name in ("yaw", "height", "tint"):
        assert (getattr(one, name)[a] != getattr(other, name)[b]).all()
    moved = np.linalg.norm(feet(one)[a] - feet(other)[b], axis=1)
    assert 0.05 < moved.mean() < 0.5


def test_periods_are_not_alike(tmp_path: Path) -> None:
    """The pattern repeats, and its plants do not."""
    placement = plain(tmp_path, 4 * PERIOD, 2 * PERIOD, 1, PERIOD)
    one, other = placement.plants(0), placement.plants(1)
    shared, a, b = np.intersect1d(one.row % 4096, other.row % 4096, return_indices=True)
    assert len(shared) > 4000
    for name in ("yaw", "height", "tint"):
        correlation = np.corrcoef(getattr(one, name)[a].T, getattr(other, name)[b].T)
        size = len(correlation) // 2
        same = correlation[:size, size:]
        if name != "height":  # which differs between species, whose places are the same
            assert abs(same).max() < 5 / np.sqrt(len(shared))
    assert (one.height[a] != other.height[b]).all()


def test_what_plants_are_like(tmp_path: Path) -> None:
    found = together(plain(tmp_path, 600, 600, 3))
    ash = found["species"] == 0
    assert 10 <= found["height"][ash].min() < 10.5 and 19.5 < found["height"][ash].max() <= 20
    assert found["height"][~ash].max() <= 0.4 + 1e-6
    assert 0 <= found["yaw"].min() < 0.05 and 6.23 < found["yaw"].max() <= np.float32(2 * np.pi)
    assert abs(found["tint"].mean(axis=0) - 1).max() < 0.01
    assert 0.8 < found["tint"].min() < 0.9 and 1.1 < found["tint"].max() < 1.2


def test_a_species_without_heights_is_its_models(tmp_path: Path) -> None:
    """And comes first, as it may be a tree; so does one that all have equal shares."""
    text = PLAIN.format(width=400, depth=400, spacing=3).replace("height_m = [10, 20]\n", "")
    text = text.replace("share = 0.25\n", "").replace("share = 0.75\n", "")
    placement = placed(tmp_path, text)
    (note,) = placement.notes
    assert "ash: without height_m, so they count as taller than the others" in note
    plants = placement.plants(4)
    assert np.isnan(plants.height[plants.species == 0]).all()
    assert (np.diff(plants.species) >= 0).all()
    assert (plants.species == 0).mean() == pytest.approx(0.5, abs=0.02)


def test_the_tallest_of_each_kind_is_the_greatest_height_that_it_may_have(tmp_path: Path) -> None:
    """In the order of the scene's kinds, and no plant is taller; NaN where it says no height."""
    placement = plain(tmp_path)
    limits = placement.tallest(2)
    assert limits.tolist() == [20, 0.4] and placement.measured(2).all()
    found = together(placement)
    for kind, limit in enumerate(limits):
        tall = found["height"][found["species"] == kind]
        assert 0.99 * limit < tall.max() <= limit * (1 + 1e-6)
    text = PLAIN.format(width=400, depth=400, spacing=3).replace("height_m = [10, 20]\n", "")
    np.testing.assert_array_equal(placed(tmp_path, text).tallest(2), [np.nan, 0.4])
    assert placed(tmp_path, text).measured(2).tolist() == [False, True]


def test_bounds_hold_all_plants_and_no_fewer(tmp_path: Path) -> None:
    """Tiles on the border are cut; where nothing forbids a plant, counts are exact but there."""
    placement = plain(tmp_path, 410, 300, 3)
    tiles = placement.tiles
    assert len(tiles) == 4 * 4
    for tile, plants in enumerate(all_of(placement)):
        at = feet(plants)
        assert (at >= tiles.low[tile] - 1e-4).all() and (at <= tiles.high[tile] + 1e-4).all()
        assert (np.abs(at[:, [0, 2]]) <= (205 + 1e-4, 150 + 1e-4)).all()
        assert 0 < len(plants) <= tiles.count[tile] <= len(plants) + 60
    low, high = tiles.low, tiles.high
    inner = (np.abs(low[:, [0, 2]]) < 130).all(axis=1) & (np.abs(high[:, [0, 2]]) < 130).all(axis=1)
    assert inner.sum() == 4
    for tile in np.flatnonzero(inner):
        assert len(placement.plants(tile)) == tiles.count[tile]
    assert (low[:, 0].min(), high[:, 2].max()) == (-205, 150)


def test_a_larger_extent_has_the_same_plants_and_more(tmp_path: Path) -> None:
    small, large = together(plain(tmp_path, 300, 300)), together(plain(tmp_path, 700, 500))
    _, _, there = np.intersect1d(small["row"], large["row"], return_indices=True)
    assert len(there) == len(small["row"])
    assert np.array_equal(large["yaw"][there], small["yaw"])


def hill(folder: Path, rules: str, spacing: float = 2, bits: int = 16) -> Procedural:
    """A ridge along z: 0 m at both sides, 100 m in the middle, 45 degrees on both slopes."""
    picture(folder / "hill.png", np.tile([0, 2**bits - 1, 0], (3, 1)), bits)
    text = f"""
[terrain]
kind = "heightmap"
heightmap = "hill.png"
extent_m = [200, 200]
height_m = [0, 100]

[[species]]
name = "ash"
{rules}

[placement]
spacing_m = {spacing}
"""
    placement = placed(folder, text)
    assert isinstance(placement, Procedural)
    return placement


def test_plants_stand_on_the_ground(tmp_path: Path) -> None:
    placement = hill(tmp_path, "")
    at = together(placement)["feet"]
    assert at[:, 1] == pytest.approx(100 - np.abs(at[:, 0]), abs=1e-3)
    for tile, plants in enumerate(all_of(placement)):
        assert (feet(plants)[:, 1] >= placement.tiles.low[tile, 1] - 1e-4).all()
        assert (feet(plants)[:, 1] <= placement.tiles.high[tile, 1] + 1e-4).all()


def test_elevations_and_slopes_leave_what_they_say(tmp_path: Path) -> None:
    everywhere = together(hill(tmp_path, ""))
    between = hill(tmp_path, "elevation_m = [20, 60]")
    found = together(between)
    kept = (everywhere["feet"][:, 1] >= 20) & (everywhere["feet"][:, 1] <= 60)
    assert np.array_equal(found["row"], everywhere["row"][kept])
    assert between.tiles.count.sum() >= len(found["row"])
    assert len(together(hill(tmp_path, "slope_deg = [44, 46]"))["row"]) == len(everywhere["row"])
    with pytest.raises(UsageError, match="a species that grows somewhere; slope_deg,"):
        hill(tmp_path, "elevation_m = [200, 300]")
    steep = hill(tmp_path, "slope_deg = [0, 30]")
    assert together_or_none(steep) == 0, "slopes are not known before; the tiles are empty"


def together_or_none(placement: Procedural) -> int:
    return sum(len(plants) for plants in all_of(placement))


@pytest.mark.parametrize("bits", [8, 16])
def test_density_thins_and_keeps_the_distance(tmp_path: Path, bits: int) -> None:
    """None in the west, all in the east, half where the map is grey; what stands where it is thin
    stands where it is dense too."""
    white = 2**bits - 1
    picture(tmp_path / "map.png", np.tile([0, white], (2, 1)), bits)
    thin = hill(tmp_path, 'density = "map.png"', bits=bits)
    found, everywhere = together(thin), together(hill(tmp_path, "", bits=bits))
    assert set(found["row"]) < set(everywhere["row"])
    x, all_x = found["feet"][:, 0], everywhere["feet"][:, 0]
    for low, high in ((-100, -80), (-10, 10), (80, 100)):
        share = ((low < x) & (x < high)).sum() / ((low < all_x) & (all_x < high)).sum()
        assert share == pytest.approx((low + high + 200) / 400, abs=0.05)
    flat = found["feet"][:, [0, 2]]
    half = flat[np.abs(flat[:, 0]) < 20]
    distance, _ = cKDTree(half).query(half, k=2)
    assert distance[:, 1].min() > 2 - 1e-4
    at_random = 0.5 / np.sqrt(len(half) / (40 * 200))
    assert distance[:, 1].mean() > 1.4 * at_random, "thinned evenly, not at random"
    assert thin.tiles.count.sum() >= len(flat)


def test_a_map_that_is_all_white_changes_nothing(tmp_path: Path) -> None:
    picture(tmp_path / "map.png", np.full((5, 5), 65_535))
    whole, mapped = hill(tmp_path, ""), hill(tmp_path, 'density = "map.png"')
    for tile in range(len(whole.tiles)):
        assert bytes_of(whole.plants(tile)) == bytes_of(mapped.plants(tile))
    assert np.array_equal(whole.tiles.count, mapped.tiles.count)


@pytest.mark.parametrize(
    ("size", "fits"),
    [((2, 3), True), ((20, 30), True), ((19, 30), True), ((30, 20), False), ((20, 20), False)],
)
def test_maps_have_the_form_of_the_extent(
    tmp_path: Path, size: tuple[int, int], fits: bool
) -> None:
    """300 x 200 m; a pixel more or less is rounding."""
    picture(tmp_path / "map.png", np.full(size, 65_535))
    text = PLAIN.format(width=300, depth=200, spacing=3)
    text = text.replace('name = "ash"', 'name = "ash"\ndensity = "map.png"')
    if fits:
        placed(tmp_path, text)
        return
    with pytest.raises(InputError) as caught:
        placed(tmp_path, text)
    said = str(caught.value)
    assert "square pixels over the extent of 300 x 200 m, or as many as the heightmap has" in said
    assert f"found {size[1]} x {size[0]} pixels; scale or cut it" in said
    assert "scene.toml, line 7: density" in said


def test_a_map_may_have_the_heightmaps_pixels(tmp_path: Path) -> None:
    picture(tmp_path / "map.png", np.full((3, 3), 65_535))
    placement = hill(tmp_path, 'density = "map.png"')
    scene = scene_of(tmp_path, (tmp_path / "scene.toml").read_text().replace("200, 200", "200, 50"))
    narrow = placement_of(scene, terrain_of(scene))
    assert narrow.tiles.count.sum() == pytest.approx(placement.tiles.count.sum() / 4, rel=0.1)


@pytest.mark.parametrize(
    ("old", "new", "kind", "says"),
    [
        (
            "share = 0.75\n", "", UsageError,
            "line 10: expected a share, as other species have one; got none",
        ),
        (
            "share = 0.25", 'density = "gone.png"\nshare = 0.25', InputError,
            "gone.png: cannot be read (No such file or directory); check",
        ),
        ("spacing_m = 3", "spacing_m = 0.0001", UsageError, "at most 4,000,000 tiles, got"),
    ],
)  # fmt: skip
def test_rules_that_make_no_sense(
    tmp_path: Path, old: str, new: str, kind: type[VegtoolError], says: str
) -> None:
    text = PLAIN.format(width=400, depth=400, spacing=3)
    assert old in text
    with pytest.raises(kind) as caught:
        placed(tmp_path, text.replace(old, new))
    assert says in str(caught.value)


def test_shares_of_nothing(tmp_path: Path) -> None:
    text = PLAIN.format(width=400, depth=400, spacing=3)
    with pytest.raises(UsageError, match="line 7: expected a species whose share is more than 0"):
        placed(tmp_path, text.replace("0.25", "0").replace("0.75", "0"))
    found = placed(tmp_path, text.replace("0.25", "0")).plants(0)
    assert set(found.species) == {1}


def test_one_tile_of_many_is_made_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 10 x 10 km, with 6.7 million plants: the ground is asked for the points of that tile."""
    placement = plain(tmp_path, 10_000, 10_000, 3)
    assert placement.tiles.count.sum() == pytest.approx(1e8 / (3 * PERIOD) ** 2 * 4096, rel=0.01)
    asked: list[int] = []
    height = Terrain.height

    def counted(ground: Terrain, xz: np.ndarray) -> np.ndarray:
        asked.append(len(xz))
        return height(ground, xz)

    monkeypatch.setattr(Terrain, "height", counted)
    (middle,) = np.flatnonzero((placement.column == 0) & (placement.row == 0))
    plants: Plants = placement.plants(int(middle))
    assert sum(asked) == len(plants) == placement.tiles.count[middle] > 1000
