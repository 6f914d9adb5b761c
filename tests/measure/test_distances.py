"""Switch distances from curves made by hand: 1, 2, 4, 8 and 16 metres."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vegtool.lod import FADE_FRACTION
from vegtool.measure.distances import FLOOR, LeftOut, limits, rounded_up, switch_distances

METRES = np.array([1.0, 2, 4, 8, 16])
LIMIT = np.full(5, 0.2)
ALL_BELOW, ALL_ABOVE = np.full(5, 0.1), np.full(5, 0.3)


def only(*errors: float) -> float | LeftOut:
    """The distance of a chain of one level with these errors."""
    (found,) = switch_distances(METRES, [np.array(errors)], LIMIT)
    return found


def test_a_level_is_used_from_where_its_error_falls_below_the_limit() -> None:
    assert only(0.4, 0.3, 0.2, 0.1, 0.1) == 4.0, "at the limit is within it"
    assert only(0.4, 0.3, 0.1, 0.1, 0.1) == pytest.approx(2 * 2**0.5, abs=0.01), "halfway, in log"


def test_below_everywhere_it_is_used_from_the_nearest_distance_measured() -> None:
    assert only(*ALL_BELOW) == 1.0


def test_above_everywhere_it_is_left_out() -> None:
    assert only(*ALL_ABOVE) is LeftOut.ERRS


def test_equal_to_the_limit_is_within_it() -> None:
    assert only(*LIMIT) == 1.0


def test_it_has_to_stay_below_as_far_as_it_is_used() -> None:
    assert only(0.1, 0.3, 0.1, 0.1, 0.1) == pytest.approx(2 * 2**0.5, abs=0.01)
    assert only(0.1, 0.1, 0.1, 0.1, 0.3) is LeftOut.ERRS, "it would be used at 16 m"


def test_a_finer_level_has_to_hold_only_until_the_coarser_one_has_taken_over() -> None:
    rising = np.array([0.1, 0.1, 0.1, 0.3, 0.4])
    falling = np.array([0.4, 0.3, 0.2, 0.1, 0.1])
    finer, coarser = switch_distances(METRES, [rising, falling], LIMIT)
    assert (finer, coarser) == (1.0, 4.0)


def test_it_has_to_hold_while_it_fades() -> None:
    """Above from 4.3 m on: the coarser one starts at 4 m, but has faded in at 4.6 m alone."""
    metres = np.array([1.0, 2, 4, 4.3, 8, 16])
    rising = np.array([0.1, 0.1, 0.1, 0.21, 0.4, 0.4])
    falling = np.array([0.4, 0.3, 0.2, 0.1, 0.1, 0.1])
    finer, coarser = switch_distances(metres, [rising, falling], np.full(6, 0.2))
    assert (finer, coarser) == (LeftOut.ERRS, 4.0)


def test_crossing_curves_leave_no_use_for_the_finer_level() -> None:
    late = np.array([0.4, 0.4, 0.3, 0.1, 0.1])
    early = np.array([0.4, 0.3, 0.1, 0.1, 0.1])
    assert switch_distances(METRES, [late, early], LIMIT)[0] is LeftOut.ERRS, "until 3.3 m"
    assert switch_distances(METRES, [early, early], LIMIT)[0] is LeftOut.SUPERSEDED
    assert switch_distances(METRES, [ALL_BELOW, ALL_BELOW], LIMIT)[0] is LeftOut.SUPERSEDED


def test_where_the_coarsest_errs_at_the_far_end_the_next_one_has_to_hold_there() -> None:
    errs_far = np.array([0.1, 0.1, 0.1, 0.1, 0.3])
    good = np.array([0.3, 0.1, 0.1, 0.1, 0.1])
    finer, coarser = switch_distances(METRES, [good, errs_far], LIMIT)
    assert coarser is LeftOut.ERRS
    assert finer == pytest.approx(2**0.5, abs=0.01)


def test_no_nearer_than_is_asked() -> None:
    found = switch_distances(METRES, [ALL_BELOW, ALL_BELOW], LIMIT, least_m=[3.0, 40.0])
    assert found == (3.0, 40.0)
    found = switch_distances(METRES, [ALL_BELOW, ALL_BELOW], LIMIT, least_m=[40.0, 3.0])
    assert found == (LeftOut.SUPERSEDED, 3.0)


def test_what_holds_nowhere_between_distances_starts_at_the_next_one_measured() -> None:
    asked: list[tuple[int, float]] = []

    def never(level: int, distance_m: float) -> bool:
        asked.append((level, distance_m))
        return False

    errors = [np.array([0.4, 0.3, 0.1, 0.1, 0.1])]
    assert switch_distances(METRES, errors, LIMIT, holds=never) == (4.0,)
    assert asked == [(0, 2.83), (0, 3.37)], "where the lines cross, and halfway from there"


def test_what_does_not_hold_where_lines_cross_may_hold_halfway_to_the_next_measured() -> None:
    """The finer level then keeps its place before the coarser one, which starts at 4 m."""
    crossing = np.array([0.4, 0.3, 0.1, 0.1, 0.1])
    found = switch_distances(
        METRES, [crossing, ALL_BELOW], LIMIT, [0, 4.0], holds=lambda level, distance: distance > 3
    )
    assert found == (3.37, 4.0)


def test_limits_are_the_live_originals_own_but_not_below_the_floor() -> None:
    live = np.array([0.01, 0.15, 0.3])
    np.testing.assert_array_equal(limits(live), [FLOOR, 0.15, 0.3])
    np.testing.assert_array_equal(limits(live, 0.2), [0.2, 0.2, 0.2])


@pytest.mark.parametrize(
    ("metres", "stated"),
    [(0.0, 0.0), (12.3, 12.3), (12.31, 12.4), (99.91, 100.0), (12301.0, 12400.0), (4.0, 4.0),
     (1.234e-6, 1.24e-6), (100 * (1 + 1e-15), 100.0)],
)  # fmt: skip
def test_three_digits_and_never_nearer(metres: float, stated: float) -> None:
    assert rounded_up(metres) == stated


@given(
    st.lists(st.lists(st.floats(0, 1), min_size=5, max_size=5), min_size=1, max_size=5),
    st.lists(st.floats(0, 1), min_size=5, max_size=5),
    st.floats(1e-6, 1e6),
)
@example([[0.0, 0, 0, 0, 0], [0.0, 0, 0, 1e-9, 0]], [0.0, 0, 0, 0, 1], 1.0)
def test_no_level_is_shown_at_a_distance_where_it_was_measured_above_the_limit(
    curves: list[list[float]], limit: list[float], scale: float
) -> None:
    """And distances increase by more than a fade, whatever the curves; and scale with the plant.

    To within rounding. A distance less than a billionth above three digits is stated as those. The
    line of an error minus its limit falls by 2 at most while distance doubles, by 2.9e-9 there.
    Whether a * 1.15 <= b or a <= b / 1.15 may differ by a float's last bit.
    """
    metres = scale * METRES
    found = switch_distances(metres, [np.array(c) for c in curves], np.array(limit))
    kept = [(d, np.array(c)) for d, c in zip(found, curves, strict=True) if isinstance(d, float)]
    starts = [start for start, _ in kept]
    assert all((1 + FADE_FRACTION) * a <= b * (1 + 1e-15) for a, b in pairwise(starts))
    ends = [*((1 + FADE_FRACTION) * start for start in starts[1:]), metres[-1]]
    for (start, curve), end in zip(kept, ends, strict=False):
        shown = (metres >= start) & (metres <= end)
        assert (curve[shown] <= np.array(limit)[shown] + 3e-9).all()
