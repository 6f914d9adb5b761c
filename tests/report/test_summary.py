"""Medians over plants, and what is on the Pareto front."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_cases import plant_report

from vegtool.report.rows import as_json, from_json
from vegtool.report.summary import medians, pareto, points

GRID = st.integers(0, 5)


@given(st.lists(st.tuples(GRID, GRID), max_size=12))
def test_the_front_is_what_none_beats(found: list[tuple[int, int]]) -> None:
    def beaten(i: int) -> bool:
        (x, y) = found[i]
        return any(
            (a <= x and b <= y and (a, b) != (x, y)) or ((a, b) == (x, y) and j < i)
            for j, (a, b) in enumerate(found)
        )

    front = pareto(np.array(found).reshape(-1, 2))
    assert sorted(front) == [i for i in range(len(found)) if not beaten(i)]
    assert [found[i][0] for i in front] == sorted(found[i][0] for i in front)


def test_one_plant_keeps_its_spread_over_views() -> None:
    live, finest, *_ = points(plant_report())
    assert live.frame_ratio == 1.0
    assert finest.frame_ratio == pytest.approx(4 / 20)
    assert finest.bake_seconds == pytest.approx(0.5)
    assert finest.texture_bytes == 4000, "four bytes a texel"
    error = finest.errors["flip"][0]
    assert (error.mean, error.sd) == pytest.approx((0.10, 0.01))


def test_of_three_plants_the_middle_one_counts() -> None:
    three = [plant_report("oak", 0.0), plant_report("pine", 0.3), plant_report("birch", 0.01)]
    finest = medians(three)[1]
    error = finest.errors["flip"][1]
    assert finest.plants == 3
    assert (error.mean, error.low, error.high) == pytest.approx((0.09, 0.08, 0.38))


def test_a_row_survives_json() -> None:
    import json

    for row in plant_report().rows:
        assert from_json(json.loads(json.dumps(as_json(row)))) == row
