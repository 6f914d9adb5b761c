"""A level covers what the plant does until the next one begins, or the user is told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lod import Display, Level
from vegtool.measure.scores import TruthsAt
from vegtool.measure.views import distance_of, views
from vegtool.refine.coverage import with_alpha
from vegtool.refine.level import Wanted, on_planes, source_of
from vegtool.refine.reach import coverage_notes

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def truth_at() -> Iterator[TruthsAt]:
    plant = sample("bush", 800)
    with PlantBuffers(plant) as buffers:
        yield TruthsAt(plant, views("all", 3), Display(), buffers)


@pytest.fixture(scope="module")
def level(truth_at: TruthsAt) -> Level:
    """Made for 100 pixels."""
    near_m = distance_of(truth_at.plant, Display(), 100.0)
    with PlantBuffers(truth_at.plant) as buffers:
        source = source_of(buffers, truth_at)
        made = on_planes(source, Wanted(80, near_m), None, 80, {}, lambda *_: None).level
    return replace(made, near_distance_m=near_m)


def after(level: Level, times: float) -> Level:
    """The next one, so many times as far away."""
    return replace(level, near_distance_m=times * level.near_distance_m)


def test_what_is_solved_for_is_kept(level: Level, truth_at: TruthsAt) -> None:
    assert coverage_notes([level, after(level, 2.0)], truth_at) == ()


@pytest.mark.parametrize(("alpha", "told"), [(0, "100% less than"), (255, "% more than")])
def test_too_little_and_too_much_are_told(
    level: Level, truth_at: TruthsAt, alpha: int, told: str
) -> None:
    assert level.atlas is not None
    other = with_alpha(level, np.full(level.atlas.color.shape[:2], alpha, np.uint8))
    (note,) = coverage_notes([other, after(level, 2.0)], truth_at)
    assert f"the level of {level.triangles:,} triangles covers" in note
    assert f"{told} the plant" in note


def test_only_levels_with_pictures_that_others_follow_are_asked(
    level: Level, truth_at: TruthsAt
) -> None:
    mesh = Level("mesh", mesh=truth_at.plant, near_distance_m=level.near_distance_m)
    assert coverage_notes([mesh, after(level, 8.0)], truth_at) == ()
    assert coverage_notes([], truth_at) == coverage_notes([level], truth_at) == ()
