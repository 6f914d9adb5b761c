"""The governor of frame times: what it does in single steps. Whole runs: stability/governor.py."""

from __future__ import annotations

from math import exp, inf, log, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vegtool.preview.governor import (
    LONGEST_STEP_S,
    MEDIAN_FRAMES,
    RATE_PER_S,
    RESPONSE_FRAMES,
    SLOPE,
    Governor,
    step,
)


def after(frames: int, frame_ms: float, state: Governor, seconds: float | None = None) -> Governor:
    for _ in range(frames):
        state = step(state, frame_ms, seconds)
    return state


def test_nothing_happens_until_there_is_a_median() -> None:
    state = after(MEDIAN_FRAMES - 1, 100, Governor(10))
    assert (state.detail, state.average_ms) == (1.0, None)
    assert step(state, 100).detail < 1


def test_an_error_is_taken_away_as_its_slope_says() -> None:
    """20 % too long, and time enough: the logarithm falls by the error over both constants."""
    state = after(MEDIAN_FRAMES, 12, Governor(10), seconds=1)
    assert log(state.detail) == pytest.approx(-0.2 / (SLOPE * RESPONSE_FRAMES))


def test_detail_changes_no_faster_than_a_viewer_bears() -> None:
    state = after(MEDIAN_FRAMES, 40, Governor(10), seconds=0.01)
    assert state.detail == pytest.approx(exp(-RATE_PER_S * 0.01))
    hitch = step(after(MEDIAN_FRAMES, 40, Governor(10), seconds=0), 1e9)
    assert log(hitch.detail) == pytest.approx(
        -min(3 / (SLOPE * RESPONSE_FRAMES), RATE_PER_S * LONGEST_STEP_S)
    )


def test_small_errors_are_left_alone_until_they_are_large() -> None:
    """Correction begins beyond 10 %, and goes on until 2 %."""
    calm = after(200, 10.9, Governor(10))
    assert calm.detail == 1 and not calm.correcting
    busy = after(40, 12, Governor(10))
    assert busy.correcting and after(1, 10.9, busy).correcting
    assert not after(200, 10, busy).correcting


def test_times_that_are_none_change_nothing() -> None:
    state = after(10, 12, Governor(10))
    for bad in (nan, -1, -inf):
        assert step(state, bad) is state


def test_no_time_no_move() -> None:
    state = after(20, 40, Governor(10), seconds=0)
    assert state.detail == 1 and state.correcting
    for seconds in (nan, -1.0):
        assert step(state, 40, seconds).detail == 1


def test_more_than_all_detail_may_be_allowed() -> None:
    assert after(5000, 1, Governor(10, most=2.0), seconds=0.01).detail == 2


@pytest.mark.parametrize(
    "bad",
    [{"target_ms": 0}, {"target_ms": nan}, {"target_ms": inf}, {"least": 0}, {"least": nan},
     {"most": 0.1}, {"detail": 2}, {"detail": nan}, {"most": inf}],
)  # fmt: skip
def test_limits_that_are_none_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"^Governor"):
        Governor(**{"target_ms": 10.0, **bad})


@given(
    st.lists(
        st.tuples(
            st.floats(allow_nan=True, allow_infinity=True),
            st.none() | st.floats(allow_nan=True, allow_infinity=True),
        ),
        max_size=40,
    ),
    st.floats(1e-3, 1e6),
)
def test_whatever_frames_take_detail_is_within_its_limits(
    frames: list[tuple[float, float | None]], target_ms: float
) -> None:
    state = Governor(target_ms, 0.5, 2.0)
    for frame_ms, seconds in frames:
        before, state = state, step(state, frame_ms, seconds)
        assert 0.5 <= state.detail <= 2
        assert abs(log(state.detail / before.detail)) <= RATE_PER_S * LONGEST_STEP_S * 1.000001
