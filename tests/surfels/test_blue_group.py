"""Surfels of a group out of those of its parts: what is seen of them, evenly, in their means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from surfel_sets import ball

from vegtool.errors import UsageError
from vegtool.surfel_set import Spacing, SurfelSet
from vegtool.surfels.blue.distances import nearest
from vegtool.surfels.blue.group import Discs, discs_of, grouped, outside, together

pytestmark = pytest.mark.gl


def test_only_what_is_seen_from_outside_is_a_candidate() -> None:
    """A ball of discs that meet, and a smaller one within: nothing of that one is drawn."""
    outer, inner = discs_of(ball(600, 1.0)), discs_of(ball(100, 0.4))
    seen = outside(together([inner, outer]))
    assert not seen[:100].any() and seen[100:].mean() > 0.9
    made = grouped(together([inner, outer]), 10_000)
    assert made.candidates == len(made.surfels) == seen.sum(), "no more than there are"
    assert (np.linalg.norm(made.surfels.position, axis=1) > 0.9).all()
    assert made.error_m == 0.0


def test_parts_have_as_many_as_they_are_large() -> None:
    """Two balls, one of twice the radius and so of four times the surface: where each has as many
    surfels, their group has more of the larger, as far apart on both."""
    small = ball(2000, 1.0, (-4, 0, 0))
    large = ball(2000, 2.0, (4, 0, 0))
    made = grouped(together([discs_of(small), discs_of(large)]), 400)
    on_large = made.surfels.position[:, 0] > 0
    assert on_large.mean() == pytest.approx(0.8, abs=0.04)
    apart = [np.median(nearest(made.surfels.position[of])) for of in (on_large, ~on_large)]
    assert apart[0] == pytest.approx(apart[1], rel=0.1)
    every = np.concatenate([small.position, large.position])
    assert set(map(tuple, made.surfels.position)) <= set(map(tuple, every))
    assert 0 < made.error_m < 2 * made.surfels.spacing.radius(400)


def test_early_surfels_have_means_of_what_they_stand_for() -> None:
    """Of a ball whose surfels are black or white by turns the first ones are grey."""
    one = ball(2000)
    color = np.repeat(np.arange(2000) % 2, 3).reshape(-1, 3).astype(float)
    discs = discs_of(SurfelSet(one.position, one.normal, color, one.spacing))
    made = grouped(discs, 2000)
    assert np.abs(made.surfels.color[:16] - 0.5).max() < 0.2
    assert (made.surfels.normal * made.surfels.position).sum(axis=1).min() > 0.8, "outwards"


def test_few_and_copies() -> None:
    """One disc is one surfel, of no extent; copies come last, if at all."""
    one = Discs(np.ones((1, 3)), np.eye(3)[:1], np.ones((1, 3)), np.zeros(1), np.ones(1))
    assert len(grouped(one, 1000).surfels) == 1
    same = together([one, one, one])
    assert 1 <= len(grouped(same, 1000).surfels) <= 3
    assert len(outside(one.of(np.zeros(1, bool)))) == 0
    assert len(grouped(one, 0).surfels) == 0
    with pytest.raises(UsageError):
        grouped(one, -1)


def test_surfels_keep_their_sizes() -> None:
    """Those of a ball that were half as large as the rest are so in a group."""
    one = ball(1000)
    small = one.position[:, 0] > 0
    sized = replace(one, size=np.where(small, 0.5, 1.0))
    made = grouped(discs_of(sized), 300).surfels
    assert np.array_equal(made.size, np.where(made.position[:, 0] > 0, 0.5, 1.0))


def test_discs_are_as_large_as_they_are_drawn() -> None:
    """Of a set with sizes, by these."""
    one = ball(100)
    smaller = SurfelSet(one.position, one.normal, one.color, one.spacing, np.full(100, 0.5))
    assert np.allclose(discs_of(smaller).radius, 0.5 * discs_of(one).radius)
    assert np.allclose(discs_of(one).radius, one.spacing.radius(100))
    lonely = SurfelSet(np.zeros((1, 3)), np.eye(3)[:1], np.ones((1, 3)), Spacing(1, 0.0, 1))
    assert discs_of(lonely).radius.tolist() == [0.0]
