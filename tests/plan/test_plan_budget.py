"""Budgets: nothing that fits is better than what is found, but by the last step."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from vegtool.errors import UsageError
from vegtool.plan.budget import Choices, choices, evenly, spread
from vegtool.seeding import generator

AT = np.array([5.0, 20.0, 80.0])


def plant(seed: int, seen: float = 1.0) -> Choices:
    """Three levels, finer ones larger, each with more error nearer than it is for."""
    random = generator(seed, "plant")
    error = np.sort(random.random((3, 3)), axis=1)[:, ::-1] * np.array([[0.1], [0.5], [1.0]])
    size = np.sort(random.integers(1, 1000, 3))[::-1]
    return choices(size, np.array([0.0, 10.0, 40.0]), error, AT, seen * random.random(3))


def test_a_level_that_is_left_out_is_replaced_by_the_one_before_or_the_first() -> None:
    """Where it is cheap to have all, all are kept; error is of the level that is drawn."""
    error = np.array([[0.1, 0.1, 0.1], [0.9, 0.2, 0.2], [0.9, 0.9, 0.05]])
    found = choices(np.array([100, 10, 1]), np.array([0.0, 10.0, 40.0]), error, AT, np.ones(3))
    by_set = {tuple(kept): e for kept, e in zip(found.kept.tolist(), found.error, strict=True)}
    assert by_set[False, False, True] == pytest.approx(0.9 + 0.9 + 0.05)
    assert by_set[False, True, True] == pytest.approx(0.9 + 0.2 + 0.05)
    # the original alone is drawn everywhere; with the last, that one far away
    assert by_set[True, False, True] == pytest.approx(0.1 + 0.1 + 0.05)
    assert found.bytes.tolist() == [1, 10, 11, 100, 101]
    assert found.bytes[found.hull].tolist() == [1, 11, 101]


def test_choices_are_a_convex_hull_that_all_sets_lie_above() -> None:
    for seed in range(20):
        found = plant(seed)
        assert (np.diff(found.bytes) > 0).all() and (np.diff(found.error) < 0).all()
        size, error = found.bytes[found.hull], found.error[found.hull]
        slopes = np.diff(error) / np.diff(size)
        assert (
            (np.diff(slopes) >= 0).all() and found.hull[0] == 0 and found.hull[-1] == len(found) - 1
        )
        assert (np.interp(found.bytes, size, error) <= found.error + 1e-12).all()


def test_no_way_to_spend_a_budget_is_better_by_more_than_a_step() -> None:
    """All combinations of choices are tried. What is found lies on the hull of all; a better one
    that fits gains less than the one step that did not fit."""
    for seed in range(12):
        some = [plant(10 * seed + i, 3.0**i) for i in range(3)]
        least = sum(int(one.bytes[0]) for one in some)
        most = sum(int(one.bytes[-1]) for one in some)
        for budget in np.linspace(least, most, 7).astype(int).tolist():
            made = spread(some, budget)
            spent = sum(int(one.bytes[i]) for one, i in zip(some, made, strict=True))
            error = sum(one.error[i] for one, i in zip(some, made, strict=True))
            best = min(
                sum(one.error[i] for one, i in zip(some, rows, strict=True))
                for rows in product(*(range(len(one)) for one in some))
                if sum(int(one.bytes[i]) for one, i in zip(some, rows, strict=True)) <= budget
            )
            step = max(-np.diff(one.error[one.hull]).min(initial=0.0) for one in some)
            assert spent <= budget and error <= best + step + 1e-12
        assert spread(some, most).tolist() == [len(one) - 1 for one in some]


def test_what_is_seen_more_gets_more() -> None:
    """Two plants alike, one of which is seen a hundred times as much."""
    little, much = plant(3, 0.01), plant(3, 1.0)
    budget = int(little.bytes[0] + much.bytes[-1])
    assert spread([little, much], budget).tolist() == [0, len(much) - 1]
    part = evenly([little, much], budget)
    assert part[0] == part[1] and part[1] < len(much) - 1


def test_a_budget_that_is_too_small_is_refused() -> None:
    some = [plant(1), plant(2)]
    least = sum(int(one.bytes[0]) for one in some)
    assert spread(some, least).tolist() == [0, 0]
    with pytest.raises(UsageError, match=f"{least:,} bytes at least"):
        spread(some, least - 1)
