"""Plants of a tile in the order in which they vanish, against loops over them."""

from __future__ import annotations

import numpy as np
import pytest
from walk_cases import bush, garden, herb, kinds, plants, stock, wood

from vegtool.preview.stock import STOCK, stocked
from vegtool.seeding import generator
from vegtool.tiles.placement import Plants


def tile(count: int = 60) -> Plants:
    rng = generator(1, "tile")
    height = rng.uniform(0.2, 5, count)
    height[::3] = np.nan
    return plants(
        rng.normal(size=(count, 3)), rng.integers(0, 3, count), origin=(100, 5, -7), height=height,
        yaw=rng.uniform(-9, 9, count), tint=rng.uniform(0, 2.2, (count, 3)),
    )  # fmt: skip


def test_each_plant_is_what_it_was_and_knows_when_it_vanishes() -> None:
    """The k-th of n of a kind is drawn up to 1 / sqrt(k / n) times the distance up to which all
    are: at twice that distance every fourth is."""
    species, given = garden(), tile()
    thinned = np.array([40.0, 20.0, 9.0])
    made = stocked(given, species, thinned)
    counts = np.bincount(given.species, minlength=3)
    seen = [0, 0, 0]
    wanted = {}
    for index in range(len(given)):
        kind = int(given.species[index])
        seen[kind] += 1
        height = float(given.height[index])
        scale = 1.0 if np.isnan(height) else height / species[kind].height
        vanish = (seen[kind] / counts[kind]) ** -0.5
        wanted[given.offset[index].tobytes()] = (
            index, kind, scale, vanish, scale * vanish * thinned[kind]
        )  # fmt: skip
    assert made.rows.dtype == STOCK and len(made.rows) == len(made.reach) == len(given)
    assert made.origin.tolist() == [100, 5, -7]
    for row, reach in zip(made.rows, made.reach, strict=True):
        index, kind, scale, vanish, far = wanted.pop(row["offset"].tobytes())
        assert row["species"] == kind
        assert row["scale"] == pytest.approx(scale) and row["vanish"] == pytest.approx(vanish)
        assert reach == pytest.approx(far)
        yaw = float(given.yaw[index])
        np.testing.assert_allclose(row["turn"], [np.cos(yaw), np.sin(yaw)], atol=1e-6)
        tint = np.clip(127.5 * given.tint[index], 0, 255)
        assert np.abs(row["tint"][:3] - tint).max() <= 0.51 and row["tint"][3] == 255
    assert not wanted
    assert (np.diff(made.reach) <= 0).all(), "those first that vanish last"


def test_a_first_part_of_a_kind_is_the_placements_first_part() -> None:
    """Whose plants are spread evenly: of one kind, what stays is what was placed first."""
    given = plants(generator(2, "feet").random((50, 3)))
    made = stocked(given, (herb(),), np.array([5.0]))
    np.testing.assert_array_equal(made.rows["offset"], given.offset)


def test_kinds_do_not_thin_each_other() -> None:
    """Of one of many kinds, as of that kind alone."""
    given = tile()
    species = garden()
    together = stocked(given, species, np.array([40.0, 20.0, 9.0]))
    bushes = given.species == 1
    alone = plants(given.offset[bushes], height=given.height[bushes], yaw=given.yaw[bushes],
                   tint=given.tint[bushes], origin=given.origin)  # fmt: skip
    one = stocked(alone, (bush(),), np.array([20.0]))
    there = together.rows[together.rows["species"] == 1]
    for name in ("offset", "scale", "turn", "vanish", "tint"):
        np.testing.assert_array_equal(there[name], one.rows[name])


def test_a_tint_of_one_is_a_factor_of_nearly_one() -> None:
    """128 of 127.5; what is too bright is as bright as can be told."""
    for tint, byte in ((1.0, 128), (0.0, 0), (2.0, 255), (9.0, 255)):
        (row,) = stocked(plants(np.zeros(3), tint=tint), (herb(),), np.ones(1)).rows
        assert row["tint"].tolist() == [byte] * 3 + [255]


def test_no_plants_are_no_rows_and_one_vanishes_where_all_do() -> None:
    none = stocked(plants(np.zeros((0, 3))), garden(), np.ones(3))
    assert len(none.rows) == len(none.reach) == 0
    (one,) = stocked(plants(np.zeros(3)), (herb(),), np.array([7.0])).rows
    assert one["vanish"] == 1


def test_many_kinds_are_told_apart() -> None:
    species = garden() * 30_000
    kind = np.array([89_999, 70_001, 2])
    made = stocked(plants(np.eye(3), kind), species, np.ones(len(species)))
    assert sorted(made.rows["species"]) == sorted(kind)


def test_inputs_stay_and_the_same_tile_is_the_same_stock() -> None:
    species, made = garden(), kinds(garden())
    of = wood().given[0]
    kept = [of.offset.tobytes(), of.species.tobytes(), of.height.tobytes(), of.tint.tobytes()]
    first, second = stock(of, species, made), stock(of, species, made)
    assert first.rows.tobytes() == second.rows.tobytes()
    assert kept == [
        of.offset.tobytes(), of.species.tobytes(), of.height.tobytes(), of.tint.tobytes()
    ]  # fmt: skip
