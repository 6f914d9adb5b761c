"""Plants of some tiles as models that stand there, and the level that each is drawn as."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from plants import plant_of
from tile_cases import bytes_of, feet

from vegtool.lod import Display
from vegtool.seeding import generator
from vegtool.tiles.levels import STEP, TRIES, fitting, level_at, switches, triangles
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Plants, Tiles
from vegtool.tiles.stand import Stand, stand_on

TRIANGLES = generator(0, "triangles").random((9, 3, 3))
SHOWN = Display()
FOCAL = SHOWN.pixels_per_metre(1.0)


def species(counts: Sequence[int], at: Sequence[float], height: float = 2.0) -> Species:
    """Levels of so many triangles, `height` metres high, from metres on."""
    levels = []
    for count in counts:
        corners = TRIANGLES[:count].copy()
        corners[..., 1] *= height / 2
        corners[0, 0, 1] = height
        levels.append(plant_of(corners))
    return Species("s", tuple(levels), np.array(at, np.float64), np.zeros(len(at)), FOCAL, ())


TREE, BUSH, HERB = (
    species([9, 5, 3, 1], [0, 10, 30, 100], 4.0),
    species([6, 2], [0, 8], 2.0),
    species([4], [0], 0.5),
)
ALL = TREE, BUSH, HERB


class Wood:
    """A placement of tiles that are given."""

    tile_m, origin, notes = 16.0, np.zeros(3), ()

    def __init__(self, *given: Plants) -> None:
        self.given = given

    @property
    def tiles(self) -> Tiles:
        ends = [feet(of) if len(of) else of.origin[None] for of in self.given]
        low, high = (np.array([least(f) for f in ends]) for least in (_low, _high))
        return Tiles(low, high, np.array([max(len(of), 1) for of in self.given]))

    def tallest(self, count: int) -> np.ndarray:
        return np.full(count, np.nan)

    def measured(self, count: int) -> np.ndarray:
        return np.zeros(count, bool)

    def plants(self, tile: int, most: int | None = None) -> Plants:
        return self.given[tile]


def _low(points: np.ndarray) -> np.ndarray:
    return np.asarray(points.min(axis=0))


def _high(points: np.ndarray) -> np.ndarray:
    return np.asarray(points.max(axis=0))


def some(count: int, origin: npt.ArrayLike = (0, 0, 0), seed: int = 0) -> Plants:
    """A third of them as high as their models, and of each its own turn and tint."""
    rng = generator(seed, "some")
    height = np.where(rng.random(count) < 1 / 3, np.nan, rng.uniform(0.5, 8.0, count))
    return Plants(
        np.asarray(origin, np.float64), rng.uniform(-8, 8, (count, 3)).astype(np.float32),
        rng.integers(0, 3, count).astype(np.int32), rng.uniform(0, 6, count).astype(np.float32),
        height.astype(np.float32), rng.uniform(0.9, 1.1, (count, 3)).astype(np.float32),
        100 * seed + np.arange(count),
    )  # fmt: skip


def stand_of(kinds: npt.ArrayLike, scale: npt.ArrayLike = 1.0) -> Stand:
    """Plants of which only kind and scale matter."""
    kind = np.atleast_1d(np.asarray(kinds, np.int32))
    count = len(kind)
    return Stand(
        np.zeros((count, 3)), kind, np.broadcast_to(np.asarray(scale, np.float64), count).copy(),
        np.zeros(count), np.ones((count, 3), np.float32), np.arange(count),
        np.zeros(count, np.int64),
    )  # fmt: skip


def test_plants_stand_where_their_tiles_say_each_as_high_as_it_is() -> None:
    """Tile by tile, plant by plant. What has no height of its own is as high as the model."""
    given = some(7, (1e6, 3, -2e6), 1), some(5, (16, 0, 0), 2), some(6, (32, 0, 0), 3)
    stand = stand_on(Wood(*given), np.array([0, 2]), ALL)
    assert len(stand) == 13
    index = 0
    for plants in (given[0], given[2]):
        for k in range(len(plants)):
            kind, height = int(plants.species[k]), float(plants.height[k])
            where = [
                float(o) + float(a) for o, a in zip(plants.origin, plants.offset[k], strict=True)
            ]
            assert stand.foot[index].tolist() == where
            assert (stand.species[index], stand.row[index]) == (kind, plants.row[k])
            wanted = 1.0 if np.isnan(height) else height / (4.0, 2.0, 0.5)[kind]
            assert stand.scale[index] == pytest.approx(wanted, rel=1e-12)
            assert stand.yaw[index] == plants.yaw[k]
            assert (stand.tint[index] == plants.tint[k]).all()
            index += 1


def test_feet_far_from_the_origin_are_kept_to_a_micrometre() -> None:
    """Whose sum in single precision would be off by a quarter of a metre."""
    plants = some(5, (5e6, 0, -5e6))
    (stand,) = [stand_on(Wood(plants), np.array([0]), ALL)]
    away = stand.foot - [5e6, 0, -5e6]
    np.testing.assert_allclose(away, plants.offset.astype(np.float64), atol=1e-6)


def test_a_tile_may_turn_out_to_be_empty() -> None:
    """Counts of procedural tiles are upper bounds."""
    nothing, plants = some(0, (0, 0, 0)), some(4, (16, 0, 0))
    assert len(stand_on(Wood(nothing), np.array([0]), ALL)) == 0
    assert stand_on(Wood(nothing, plants), np.array([0, 1]), ALL).row.tolist() == [0, 1, 2, 3]


def test_standing_changes_no_plant_and_is_the_same_again() -> None:
    plants = some(9)
    before = bytes_of(plants)
    one, two = (stand_on(Wood(plants), np.array([0]), ALL) for _ in range(2))
    assert bytes_of(plants) == before
    for name in ("foot", "species", "scale", "yaw", "tint", "row"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()


def test_levels_switch_where_they_look_as_large() -> None:
    """On a display with twice as many pixels, twice as far away; what is not there, nowhere."""
    found = switches(ALL, SHOWN)
    np.testing.assert_allclose(
        found, [[0, 10, 30, 100], [0, 8, np.inf, np.inf], [0, np.inf, np.inf, np.inf]]
    )
    twice = switches(ALL, Display(60.0, 2160))
    np.testing.assert_allclose(twice, 2 * found)
    other = replace(TREE, focal_px=FOCAL / 3)
    np.testing.assert_allclose(switches([other], SHOWN), 3 * found[:1])


def test_triangles_are_those_of_the_levels() -> None:
    assert triangles(ALL).tolist() == [[9, 5, 3, 1], [6, 2, 0, 0], [4, 0, 0, 0]]


def by_hand(stand: Stand, distance: float, least: int) -> list[int]:
    """The last level whose switch distance, times the plant's scale, is no farther."""
    found = []
    for kind, scale in zip(stand.species, stand.scale, strict=True):
        own = ALL[kind].switch_m
        level = max(k for k, at in enumerate(own) if at * scale <= distance * (1 + 1e-12))
        found.append(min(max(level, least), len(own) - 1))
    return found


@pytest.mark.parametrize("least", [0, 1])
@pytest.mark.parametrize("distance", [0.0, 1.0, 9.99, 25.0, 80.0, 1e4])
def test_a_level_is_what_the_distance_asks_for(distance: float, least: int) -> None:
    rng = generator(5, "stand")
    stand = stand_of(rng.integers(0, 3, 60), rng.uniform(0.1, 4.0, 60))
    level = level_at(stand, switches(ALL, SHOWN), distance, least)
    assert level.dtype == np.int32 and level.tolist() == by_hand(stand, distance, least)


def test_a_level_begins_at_its_distance() -> None:
    switch = switches([TREE], SHOWN)
    before = np.nextafter(switch[0, 1], 0)
    assert level_at(stand_of(0), switch, float(switch[0, 1])).tolist() == [1]
    assert level_at(stand_of(0), switch, float(before)).tolist() == [0]


def test_a_plant_of_twice_the_size_switches_twice_as_far_away() -> None:
    switch = switches([TREE], SHOWN)
    for distance in (4.0, 14.0, 45.0, 130.0):
        small, large = stand_of([0], 1.0), stand_of([0], 2.0)
        one, two = level_at(small, switch, distance), level_at(large, switch, 2 * distance)
        assert one.tolist() == two.tolist()


def test_levels_only_coarsen_with_distance() -> None:
    stand = stand_of([0, 1, 2] * 4, np.linspace(0.3, 3.0, 12))
    levels = [level_at(stand, switches(ALL, SHOWN), d, 1) for d in np.geomspace(1, 1e4, 40)]
    assert (np.diff(levels, axis=0) >= 0).all()
    assert levels[-1].tolist() == [3, 1, 0] * 4


def test_what_fits_is_drawn_as_its_distance_asks_for() -> None:
    stand, switch, of_level = stand_of([0, 1, 2]), switches(ALL, SHOWN), triangles(ALL)
    level, times = fitting(stand, switch, of_level, 12.0, 5 + 2 + 4)
    assert (level.tolist(), times) == ([1, 1, 0], 1.0)


def test_the_least_distance_at_which_all_fit_is_taken() -> None:
    """Against every distance tried, one after the other."""
    rng = generator(6, "stand")
    stand = stand_of(rng.integers(0, 3, 30), rng.uniform(0.2, 3.0, 30))
    switch, of_level = switches(ALL, SHOWN), triangles(ALL)
    most_of_all = sum(len(ALL[kind].levels[0].faces) for kind in stand.species)
    coarsest = sum(len(ALL[kind].levels[-1].faces) for kind in stand.species)
    for most in range(coarsest, most_of_all + 1, 7):
        level, times = fitting(stand, switch, of_level, 5.0, most)
        for index in range(TRIES):
            tried = level_at(stand, switch, 5.0 * STEP**index)
            count = sum(
                len(ALL[kind].levels[k].faces) for kind, k in zip(stand.species, tried, strict=True)
            )
            if count <= most:
                break
        assert level.tolist() == tried.tolist() and times == pytest.approx(STEP**index)
        assert count <= most


def test_what_never_fits_is_as_coarse_as_can_be() -> None:
    """And says so by how far away it would have to be."""
    stand = stand_of([0, 1, 2])
    level, times = fitting(stand, switches(ALL, SHOWN), triangles(ALL), 5.0, 3)
    assert level.tolist() == [3, 1, 0] and times == STEP ** (TRIES - 1) > 3700


def test_choosing_changes_nothing() -> None:
    stand, switch, of_level = stand_of([0, 1, 2], 1.5), switches(ALL, SHOWN), triangles(ALL)
    before = stand.scale.tobytes(), switch.tobytes(), of_level.tobytes()
    fitting(stand, switch, of_level, 5.0, 4)
    level_at(stand, switch, 5.0, 1)
    assert (stand.scale.tobytes(), switch.tobytes(), of_level.tobytes()) == before
