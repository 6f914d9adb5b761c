"""What all placements share: the data that they give, and what asks for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tile_cases import TWO_SPECIES, placed, scene_of

from vegtool.errors import UsageError
from vegtool.tiles.placement import Plants, Tiles, placement_of
from vegtool.tiles.terrain import Terrain


def some(**other: Any) -> Plants:
    values = {
        "origin": np.zeros(3), "offset": np.zeros((2, 3)), "species": [0, 1], "yaw": [0, 1],
        "height": [np.nan, 5], "tint": np.ones((2, 3)), "row": [1, 2],
    }  # fmt: skip
    return Plants(**{**values, **other})


def test_plants_are_checked_and_kept_from_change() -> None:
    height = np.array([np.nan, 5], np.float32)
    plants = some(height=height)
    assert len(plants) == 2 and np.isnan(plants.height[0])
    for name in ("offset", "height", "tint", "row"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(plants, name)[0] = 0
    height[0] = 3.0  # the caller's own stays writable


@pytest.mark.parametrize(
    ("other", "says"),
    [
        ({"height": [0, 5]}, "more than 0, or NaN"),
        ({"height": [np.inf, 5]}, "Plants.height: holds NaN or infinite"),
        ({"species": [-1, 0]}, "at least 0"),
        ({"yaw": [0]}, r"Plants.yaw: expected shape \(2\)"),
        ({"offset": np.full((2, 3), np.nan)}, "Plants.offset: holds NaN"),
    ],
)
def test_plants_that_cannot_be(other: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        some(**other)


def test_tiles_that_cannot_be() -> None:
    low = np.zeros((1, 3))
    with pytest.raises(ValueError, match="above"):
        Tiles(low, low - 1, np.ones(1))
    with pytest.raises(ValueError, match="without plants"):
        Tiles(low, low, np.zeros(1))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (TWO_SPECIES, "scene.toml: expected one of inventory, spacing_m in [placement]; got neit"),
        (
            TWO_SPECIES + '[placement]\nspacing_m = 3\ninventory = "trees.csv"',
            "scene.toml, line 11: expected one of inventory, spacing_m in [placement]; got both",
        ),
        ("[placement]\nspacing_m = 3", "scene.toml: expected a [[species]] for plants to be of"),
        (
            TWO_SPECIES + "[placement]\nspacing_m = 3",
            "scene.toml, line 10: expected extent_m in [terrain], as plants are placed all over it",
        ),
    ],
)
def test_scenes_that_say_too_little_or_too_much(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(UsageError) as caught:
        placed(tmp_path, text)
    assert says in str(caught.value)


def test_a_tile_has_a_size(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="more than 0 metres; got 0"):
        placement_of(scene_of(tmp_path, TWO_SPECIES), Terrain(), 0.0)
