"""The arithmetic of benchmarks/blue_surfels.py: what is drawn of an order, and what is missed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vegtool.surfel_set import Spacing

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"


@pytest.fixture(autouse=True)
def _reachable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))


@pytest.mark.parametrize("radius_m", [0.017, 1.0, 5.93])
def test_discs_of_a_prefix_ask_for_that_prefix(radius_m: float) -> None:
    """Not for one more, as rounding has it."""
    from blue.prefixes import POINTS, PREFIXES, SLIGHTLY

    spacing = Spacing(1_000, radius_m, POINTS)
    asked = [spacing.prefix((1 + SLIGHTLY) * spacing.radius(points)) for points in PREFIXES]
    assert asked == list(PREFIXES)


def test_what_is_slower_or_less_even_than_asked_is_told() -> None:
    """A time of 0.8 where 0.7 is the most, and one distance of 1.05 where 1.1 is the least."""
    from blue.orders import PREFIXES, SIZES, Order, Orders, Pictured
    from blue.tables import SAMPLING_MS, missed

    def order(method: str, points: int, cpu_ms: float, least: float) -> Order:
        many = sum(prefix <= points for prefix in PREFIXES)
        spent, none = np.full(3, cpu_ms), np.zeros(0, np.int32)
        return Order(
            method, points, spent, spent, np.full(many, least), np.full(many, 0.8), none
        )  # fmt: skip

    orders = []
    for points in SIZES:
        theirs = float(SAMPLING_MS[points])
        orders += [order("ours", points, 0.6 * theirs, 0.7)]
        orders += [order("randomised", points, theirs, 0.6)]
    unused = Pictured(None, 0, np.zeros(1), np.zeros(1))  # type: ignore[arg-type]
    found = Orders(unused, 1.0, 0.0, tuple(orders))
    assert missed(found) == []
    slow = replace(orders[0], cpu_ms=np.full(3, 0.8 * SAMPLING_MS[SIZES[0]]))
    uneven = replace(slow, least=np.array([0.7, 0.63, 0.7, 0.7, 0.7]))
    told = missed(replace(found, all=(uneven, *orders[1:])))
    assert told == [
        "10,000: time is 0.80 times, not 0.7",
        "10,000: least distance at 300 is 1.050 times, not 1.1",
    ]
