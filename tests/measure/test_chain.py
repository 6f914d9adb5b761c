"""Levels with the distances that come of measuring them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from vegtool.convert import ConvertOptions, convert
from vegtool.errors import QualityError, UsageError
from vegtool.growth import sample
from vegtool.lod import FADE_FRACTION, Display, Level, LodChain, Measured, Spread
from vegtool.measure import chain as room
from vegtool.measure.bounds import distance_for_pixels
from vegtool.measure.chain import misses, with_distances
from vegtool.measure.distances import FLOOR
from vegtool.measure.metrics import METRICS
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import Scores
from vegtool.plant import Plant

pytestmark = pytest.mark.gl
OPTIONS = ConvertOptions(billboards=48, levels=2, refine="none")
Curves = Callable[[Callable[[float], Sequence[float]]], None]


@pytest.fixture(scope="module")
def bush() -> Plant:
    return sample("bush", 600)


@pytest.fixture(scope="module")
def by_rule(bush: Plant) -> LodChain:
    return convert(bush, OPTIONS, MeasureOptions(measure="off"))


@pytest.fixture
def curves(monkeypatch: pytest.MonkeyPatch) -> Curves:
    """Errors by hand: a function of pixels gives FLIP of the live original and of both levels."""

    def use(flips: Callable[[float], Sequence[float]]) -> None:
        def measure(
            bench: room._Measuring, shown: object, distance_m: float, which: Sequence[int]
        ) -> list[Scores]:
            pixels = bench.pixels(distance_m)
            return [
                Scores(
                    np.array([pixels]),
                    np.array([distance_m]),
                    {name: np.full((1, 2), flips(pixels)[index]) for name in METRICS},
                )
                for index in which
            ]

        monkeypatch.setattr(room._Measuring, "_measure", measure)

    return use


@pytest.mark.parametrize("refine", ["full", "none"])
def test_every_level_is_within_the_limit_where_it_starts(refine: str, bush: Plant) -> None:
    options = replace(OPTIONS, refine=refine)
    chain = convert(bush, options)
    levels = chain.levels[1:]
    assert levels
    for level in levels:
        assert level.measured is not None
        live = level.measured.live["flip"].mean
        assert level.measured.errors["flip"].mean <= max(live, FLOOR)
        assert set(level.measured.errors) == set(METRICS)
    starts = [level.near_distance_m for level in levels]
    assert all((1 + FADE_FRACTION) * a <= b for a, b in pairwise(starts))
    again = convert(bush, options)
    assert [level.measured for level in again.levels[1:]] == [level.measured for level in levels]


def pixels_of(bush: Plant, level: Level) -> float:
    return float(np.ptp(bush.bounds, axis=0).max()) * Display().pixels_per_metre(
        level.near_distance_m
    )


def test_a_level_starts_where_its_curve_crosses_the_limit(
    bush: Plant, by_rule: LodChain, curves: Curves
) -> None:
    """Finer: below from 40 pixels down. Coarser: from 30, where its texels are too large yet."""
    curves(lambda pixels: (0.0, 0.1 * pixels / 40, 0.1 * pixels / 30))
    (finer, coarser), notes = with_distances(
        bush, by_rule.levels[1:], MeasureOptions(max_error=0.1), Display()
    )
    assert not notes
    assert 35 < pixels_of(bush, finer) < 40, "interpolated, held at that very distance"
    texel = Display().distance_m(coarser.texels_per_metre)
    assert coarser.near_distance_m == pytest.approx(texel, rel=0.01), "a texel covers a pixel"
    assert finer.measured is not None
    assert finer.measured.held_out is not None


def test_a_mesh_is_used_no_nearer_than_it_was_made_for(
    bush: Plant, by_rule: LodChain, curves: Curves
) -> None:
    """It has no texels that could be too large, and may err little all the same."""
    curves(lambda pixels: (0.2, 0.1))
    made_for = by_rule.levels[1].near_distance_m
    mesh = Level("mesh", mesh=bush, near_distance_m=made_for)
    ((level,), _) = with_distances(bush, [mesh], MeasureOptions(), Display())
    assert level.near_distance_m == pytest.approx(made_for, rel=0.01)
    assert level.near_distance_m >= made_for


def test_where_none_suffices_at_usual_sizes_smaller_ones_are_tried(
    bush: Plant, by_rule: LodChain, curves: Curves
) -> None:
    curves(lambda pixels: (0.0, 0.4, 0.1 * pixels / 10))
    (only,), notes = with_distances(bush, by_rule.levels[1:], MeasureOptions(), Display())
    assert pixels_of(bush, only) == pytest.approx(10, rel=0.1)
    assert "left out the level of" in notes[0]


def test_where_none_suffices_at_all_the_best_is_kept_and_said_to_be_so(
    bush: Plant, by_rule: LodChain, curves: Curves
) -> None:
    curves(lambda pixels: (0.01, 0.4, 0.3))
    (only,), (note,) = with_distances(bush, by_rule.levels[1:], MeasureOptions(), Display())
    assert only.billboards is by_rule.levels[2].billboards
    assert pixels_of(bush, only) < 6.3
    assert "0.300" in note
    limited = MeasureOptions(max_error=0.1)
    with pytest.raises(QualityError, match=r"at most 0.1 .* found 0.300"):
        with_distances(bush, by_rule.levels[1:], limited, Display())


def test_a_displacement_limit_needs_no_measuring(bush: Plant, by_rule: LodChain) -> None:
    levels = by_rule.levels[1:]
    options = MeasureOptions(measure="off", max_pixels=2.0)
    kept, _ = with_distances(bush, levels, options, Display())
    exact = [distance_for_pixels(level, bush.center, Display(), 2.0) for level in levels]
    assert kept
    for level in kept:
        assert any(m <= level.near_distance_m <= 1.01 * m for m in exact)
        assert level.measured is None


def test_of_two_limits_the_larger_distance_counts(
    bush: Plant, by_rule: LodChain, curves: Curves
) -> None:
    curves(lambda pixels: (0.0, 0.05, 0.05))
    coarsest = by_rule.levels[2:]
    by_pixels = distance_for_pixels(coarsest[0], bush.center, Display(), 0.05)
    both = MeasureOptions(max_error=0.1, max_pixels=0.05)
    ((level,), _) = with_distances(bush, coarsest, both, Display())
    assert by_pixels <= level.near_distance_m <= 1.01 * by_pixels
    one = MeasureOptions(max_error=0.1)
    ((level,), _) = with_distances(bush, coarsest, one, Display())
    assert level.near_distance_m < by_pixels


def test_no_size_from_outside_is_said_in_a_sentence(bush: Plant, by_rule: LodChain) -> None:
    with pytest.raises(UsageError, match="--fov 170"):
        with_distances(bush, by_rule.levels[1:], MeasureOptions(), Display(170.0, 64))


def test_a_wide_angle_leaves_the_sizes_that_are_seen_from_outside(
    bush: Plant, by_rule: LodChain, curves: Curves
) -> None:
    curves(lambda pixels: (0.0, 0.05, 0.05))
    kept, _ = with_distances(bush, by_rule.levels[1:], MeasureOptions(), Display(150.0))
    assert kept and all(level.near_distance_m > bush.radius for level in kept)


def test_an_error_that_is_not_measured_cannot_be_limited() -> None:
    with pytest.raises(UsageError, match="--measure off"):
        MeasureOptions(measure="off", max_error=0.1)


def test_what_misses_its_limit_is_told_by_level_distance_and_how_much(by_rule: LodChain) -> None:
    flat = Spread(0.14, 0.0, 0.14, 0.14)
    levels = []
    for mean in (0.165, 0.18):
        held_out = Spread(mean, 0.01, 0.1, 0.2)
        measured = Measured(100.0, "all", 6, {"flip": flat}, {"flip": flat}, held_out)
        levels.append(replace(by_rule.levels[1], near_distance_m=12.5, measured=measured))
    (said,) = misses([by_rule.levels[0], *levels], MeasureOptions(max_error=0.15))
    assert "LOD2" in said
    assert "12.5 m" in said
    assert "0.180" in said
    assert "0.030 more" in said
    assert not misses([by_rule.levels[0], *levels], MeasureOptions())
