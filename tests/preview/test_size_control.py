"""The control of the surfels' size: single steps, and the paper's own rule beside it. Whole runs:
stability/size_control.py."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import inf, log, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vegtool.preview.governor import BEGIN
from vegtool.preview.size_control import (
    DEAD_BAND,
    LARGEST_PX,
    LATE_FRAMES,
    MEDIAN_FRAMES,
    SMALLEST_PX,
    SizeControl,
    step,
)

A_STEP = LATE_FRAMES + MEDIAN_FRAMES
"""Frames from one change to the next."""


def after(frames: int, frame_ms: float, state: SizeControl) -> SizeControl:
    for _ in range(frames):
        state = step(state, frame_ms)
    return state


def the_papers(size_px: float, deviation: float) -> float:
    """Section 4.3, as it is written."""
    if DEAD_BAND[0] <= deviation <= DEAD_BAND[1]:
        return size_px
    return min(max((size_px * 3 + size_px * deviation) / 4, SMALLEST_PX), LARGEST_PX)


# -- a step ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame_ms", [0.0, 5.0, 8.9, 9.1, 10.0, 10.9, 11.1, 20.0, 60.0, 1e9, inf])
@pytest.mark.parametrize("size_px", [1.0, 2.0, 8.0])
def test_a_step_is_the_papers(size_px: float, frame_ms: float) -> None:
    state = after(A_STEP, frame_ms, SizeControl(10.0, size_px))
    assert state.size_px == pytest.approx(the_papers(size_px, frame_ms / 10), rel=1e-15)


def test_a_step_worked_out_by_hand() -> None:
    """Twice the target: (3 x 2 + 2 x 2) / 4; half of it: (3 x 2 + 2 / 2) / 4."""
    assert after(A_STEP, 20.0, SizeControl(10.0, 2.0)).size_px == 2.5
    assert after(A_STEP, 5.0, SizeControl(10.0, 2.0)).size_px == 1.75


def test_the_dead_band_is_the_governors_so_that_both_hold_the_same_rate() -> None:
    assert DEAD_BAND == (1 - BEGIN, 1 + BEGIN) == (0.9, 1.1)


def test_switch_distances_go_by_the_size() -> None:
    assert [SizeControl(10.0, size).detail for size in (1.0, 2.0, 8.0)] == [1.0, 0.5, 0.125]


def test_frames_that_may_be_late_are_not_counted() -> None:
    """Nothing is known until they have passed, and as many more as a median is of."""
    state = SizeControl(10.0, 2.0)
    for _ in range(LATE_FRAMES):
        state = step(state, 1e6)
        assert state.recent_ms == () and not state.resting
    state = after(MEDIAN_FRAMES - 1, 20.0, state)
    assert state.size_px == 2.0 and not state.resting
    state = step(state, 20.0)
    assert state == SizeControl(10.0, 2.5), "and begins anew"
    assert after(A_STEP - 1, 1e6, state).size_px == 2.5


def test_at_rest_each_frame_is_looked_at() -> None:
    """So what takes longer from now on is answered as soon as it is most of the last three."""
    state = after(A_STEP, 10.0, SizeControl(10.0, 2.0))
    assert state.resting
    assert step(state, 20.0).resting, "one may be by chance"
    assert step(step(state, 20.0), 20.0).size_px == 2.5


def test_a_frame_that_takes_long_by_itself_is_of_no_effect() -> None:
    state = after(A_STEP, 10.0, SizeControl(10.0, 2.0))
    for odd in (1e9, inf, 0.0):
        alone = step(state, odd)
        assert after(5, 10.0, alone).size_px == 2.0
    assert the_papers(2.0, inf) == LARGEST_PX, "what it would be else"


def test_times_that_are_none_change_nothing() -> None:
    for state in (SizeControl(10.0), after(A_STEP, 10.0, SizeControl(10.0))):
        for bad in (nan, -1.0, -inf):
            assert step(state, bad) is state


@pytest.mark.parametrize(
    "bad",
    [{"target_ms": 0}, {"target_ms": nan}, {"target_ms": inf}, {"size_px": 0.99},
     {"size_px": 8.01}, {"size_px": nan}],
)  # fmt: skip
def test_limits_are_kept_to(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"^SizeControl"):
        SizeControl(**{"target_ms": 10.0, **bad})


# -- whole runs ------------------------------------------------------------------------------------


def sizes_of(power: float, late: int, frames: int, control: bool) -> list[float]:
    """Of frames that take 3^power size^-power targets, known so many frames late: under control,
    or by the paper's rule each frame."""
    state, times = SizeControl(1.0), []
    sizes = [1.0]
    for _ in range(frames):
        times.append((3.0 / sizes[-1]) ** power)
        known = times[max(len(times) - 1 - late, 0)]
        state = step(state, known)
        sizes.append(state.size_px if control else the_papers(sizes[-1], known))
    return sizes


@pytest.mark.parametrize("power", [1.0, 2.0, 3.0, 4.0])
@pytest.mark.parametrize("late", range(LATE_FRAMES + 1))
def test_late_times_make_the_papers_rule_swing_and_not_this_one(power: float, late: int) -> None:
    """Near the target the rule takes power / 4 of an error that is `late` frames old, which swings
    for ever from 2 sin(pi / (4 late + 2)) on; so points, power 2, do from 3 frames on."""
    limit = {0: 2.0, 1: 1.0, 2: 0.618, 3: 0.445}[late]
    rule = sizes_of(power, late, 1000, control=False)[-300:]
    swings = max(rule) > 1.1 * min(rule)
    if power / 4 != limit:  # at the limit it is the dead band that decides
        assert swings == (power / 4 > limit)
    ours = sizes_of(power, late, 300, control=True)
    assert len(set(ours[150:])) == 1
    assert DEAD_BAND[0] <= (3.0 / ours[-1]) ** power <= DEAD_BAND[1]


def test_points_come_to_their_target_within_a_second() -> None:
    """Nine targets at one pixel, 60 frames a second: three pixels, in one step up and from there
    none back; down from eight in seven."""
    up = sizes_of(2.0, 0, 60, control=True)
    assert up[A_STEP:] == [3.0] * (61 - A_STEP)
    state, sizes = SizeControl(1.0, LARGEST_PX), [LARGEST_PX]
    for _ in range(60):
        state = step(state, (3.0 / state.size_px) ** 2)
        sizes.append(state.size_px)
    changes = [b / a for a, b in pairwise(sizes) if a != b]
    assert len(changes) == 7 and all(0.75 <= c < 1 for c in changes)
    assert 0.9 <= (3.0 / sizes[-1]) ** 2 <= 1.0, "it never went below what was wanted"


def test_what_no_size_helps_is_at_a_limit_and_leaves_it_at_the_first_step() -> None:
    """No error piles up: it leaves 8 pixels after as many frames, however long it was there."""
    for held in (A_STEP, 1000):
        state = after(held, 1e3, SizeControl(10.0, LARGEST_PX))
        assert state.size_px == LARGEST_PX and state.resting, "nothing more is waited for"
        left = after(2, 5.0, state)  # the first is not yet most of three
        assert left.size_px == pytest.approx(7.0)
        state = after(held, 1.0, SizeControl(10.0, SMALLEST_PX))
        assert state.size_px == SMALLEST_PX and after(2, 20.0, state).size_px == 1.25


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=60),
       st.floats(1e-3, 1e6), st.floats(1.0, 8.0))  # fmt: skip
def test_whatever_frames_take_the_size_is_within_its_limits(
    frames: Sequence[float], target_ms: float, size_px: float
) -> None:
    state = SizeControl(target_ms, size_px)
    for frame_ms in frames:
        before, state = state, step(state, frame_ms)
        assert SMALLEST_PX <= state.size_px <= LARGEST_PX
        assert state.size_px >= 0.75 * before.size_px * (1 - 1e-15)


@given(st.floats(1e-3, 1e3), st.floats(0.1, 4.0), st.floats(0.0, 0.999))
def test_a_size_that_falls_never_falls_below_the_one_that_is_wanted(
    deviation: float, power: float, fixed: float
) -> None:
    """(3 + e) / 4 is at least e^(1/4): of a time that goes by at most the fourth power, it takes no
    more than there is."""
    if deviation >= DEAD_BAND[0]:
        return
    time: Callable[[float], float] = lambda size: deviation * (fixed + (1 - fixed) * size**-power)  # noqa: E731
    factor = after(A_STEP, deviation, SizeControl(1.0, 4.0)).size_px / 4
    assert time(factor) <= 1 + 1e-12
    assert log(factor) < 0
