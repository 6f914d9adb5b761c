"""Moving an eye by hand: keys, mouse and wheel, cut into frames of any length."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest

from vegtool.preview.controls import (
    DEG_PER_PX,
    FASTER,
    SPEEDS_M_S,
    Fly,
    Input,
    Orbit,
    fly,
    flying,
    orbit,
    orbiting,
)
from vegtool.preview.eye import Eye

ORIGIN = np.zeros(3)


def pressed(*keys: str) -> Input:
    return Input(frozenset(keys))


def moved(given: Input, yaw: float = 0, pitch: float = 0, seconds: float = 2) -> np.ndarray:
    """Where an eye of 3 m/s that began at the origin has come to."""
    return fly(Fly(Eye(ORIGIN, yaw, pitch), 3.0), given, seconds).eye.position


@pytest.mark.parametrize(
    ("keys", "to"),
    [
        ("w", (0, 0, -6)),
        ("s", (0, 0, 6)),
        ("a", (-6, 0, 0)),
        ("d", (6, 0, 0)),
        ("e", (0, 6, 0)),
        ("q", (0, -6, 0)),
        ("wd", (18**0.5, 0, -(18**0.5))),  # as fast as with one key
        ("ws", (0, 0, 0)),
        ("x", (0, 0, 0)),
    ],
)
def test_keys_move_six_metres_in_two_seconds(keys: str, to: tuple[float, ...]) -> None:
    np.testing.assert_allclose(moved(pressed(*keys)), to, atol=1e-12)


def test_arrows_are_as_letters_and_shift_is_faster() -> None:
    for arrow, letter in (("up", "w"), ("down", "s"), ("left", "a"), ("right", "d")):
        np.testing.assert_array_equal(moved(pressed(arrow)), moved(pressed(letter)))
        np.testing.assert_array_equal(moved(pressed(arrow, letter)), moved(pressed(letter)))
    np.testing.assert_allclose(moved(pressed("w", "shift")), FASTER * moved(pressed("w")))


def test_forward_is_where_the_eye_looks_and_up_is_the_worlds() -> None:
    np.testing.assert_allclose(moved(pressed("w"), yaw=90, pitch=30)[1], 3.0)
    np.testing.assert_allclose(moved(pressed("e"), yaw=90, pitch=30), (0, 6, 0))
    assert not moved(pressed("w", "q"), pitch=90).any(), "up and down cancel each other"


@pytest.mark.parametrize("parts", [2, 3, 50])
def test_any_number_of_frames_comes_to_the_same_place(parts: int) -> None:
    given = pressed("w", "e", "shift")
    state = Fly(Eye(ORIGIN, 20, 30))
    for _ in range(parts):
        state = fly(state, given, 1.5 / parts)
    np.testing.assert_allclose(
        state.eye.position, fly(Fly(Eye(ORIGIN, 20, 30)), given, 1.5).eye.position
    )


def test_the_mouse_looks_right_and_down_and_not_over_the_top() -> None:
    look = fly(Fly(Eye(ORIGIN)), Input(drag_px=(50, 25)), 0)
    assert (look.eye.yaw_deg, look.eye.pitch_deg) == (360 - 50 * DEG_PER_PX, -25 * DEG_PER_PX)
    assert look.eye.forward[0] > 0
    assert fly(look, Input(drag_px=(0, -1e9)), 0).eye.pitch_deg == 90
    assert fly(look, Input(drag_px=(0, 1e9)), 0).eye.pitch_deg == -90


def test_the_wheel_changes_the_speed_within_limits() -> None:
    state = Fly(Eye(ORIGIN), 3.0)
    there_and_back = fly(fly(state, Input(scroll=3), 0), Input(scroll=-3), 0)
    assert there_and_back.speed_m_s == pytest.approx(3)
    for scroll, limit in ((1e9, SPEEDS_M_S[1]), (inf, SPEEDS_M_S[1]), (-1e9, SPEEDS_M_S[0])):
        assert fly(state, Input(scroll=scroll), 0).speed_m_s == limit


def test_the_eye_stays_above_the_ground() -> None:
    """A ridge of 3 m that a step of 20 m would go through: it is climbed."""
    ridge = Fly(Eye(np.array([0, 1.0, 0])), 20.0, lambda x, z: 3.0 if -12 < z < -8 else 0.0, 0.5)
    over = fly(ridge, pressed("w"), 1)
    np.testing.assert_allclose(over.eye.position, (0, 3.5, -20))
    down = fly(over, pressed("q"), 1)
    assert down.eye.position[1] == 0.5
    under = Fly(Eye(np.array([0, -5.0, 0])), ground=lambda x, z: 0.0, clearance_m=0.5)
    assert fly(under, Input(), 0).eye.position[1] == 0.5, "without a move, too"


def test_a_ground_without_a_height_limits_nothing() -> None:
    state = Fly(Eye(ORIGIN), 3.0, lambda x, z: nan)
    np.testing.assert_allclose(fly(state, pressed("q"), 2).eye.position, (0, -6, 0))


@pytest.mark.parametrize("seconds", [-1, nan, inf])
def test_times_that_are_none_are_refused(seconds: float) -> None:
    with pytest.raises(ValueError, match="seconds"):
        fly(Fly(Eye(ORIGIN)), Input(), seconds)
    with pytest.raises(ValueError, match="seconds"):
        orbit(Orbit(ORIGIN, np.array([0, 0, -5.0])), Input(), seconds)


def test_an_orbit_turns_about_its_target() -> None:
    """Dragged a quarter of a turn to the right, the plant shows its left side: the eye is at -x."""
    start = Orbit(np.array([0, 1.0, 0]), np.array([0, 0, -5.0]))
    np.testing.assert_allclose(start.eye.position, (0, 1, 5))
    turned = orbit(start, Input(drag_px=(90 / DEG_PER_PX, 0)))
    np.testing.assert_allclose(turned.eye.position, (-5, 1, 0), atol=1e-12)
    np.testing.assert_allclose(turned.eye.forward, (1, 0, 0), atol=1e-12)
    above = orbit(start, Input(drag_px=(0, 1e6)))
    np.testing.assert_allclose(above.eye.position, (0, 6, 0), atol=1e-12)


def test_the_target_stays_at_its_place_in_the_picture() -> None:
    state = Orbit(np.array([3.0, 1, 2]), np.array([1.0, -0.5, -5.0]))
    for given in (Input(drag_px=(37, -80)), Input(scroll=4), Input(drag_px=(-500, 900))):
        state = orbit(state, given)
        right, up, back = state.eye.axes @ (state.target - state.eye.position)
        assert (right / back, up / back) == pytest.approx((1 / -5, -0.5 / -5))


def test_the_wheel_keeps_to_the_limits() -> None:
    state = Orbit(ORIGIN, np.array([0, 0, -5.0]), limits_m=(1, 50))
    assert orbit(state, Input(scroll=1)).distance_m < 5
    assert orbit(state, Input(scroll=1e9)).distance_m == pytest.approx(1)
    assert orbit(state, Input(scroll=-inf)).distance_m == pytest.approx(50)
    beyond = Orbit(ORIGIN, np.array([0, 0, -80.0]), limits_m=(1, 50))
    assert orbit(beyond, Input(scroll=-1)).distance_m == pytest.approx(80), "not thrown back"
    inside = Orbit(ORIGIN, ORIGIN, limits_m=(1, 50))
    assert orbit(inside, Input(scroll=1)).distance_m == 0
    assert orbit(inside, Input(scroll=-1)).distance_m == 1


@pytest.mark.parametrize("target", [(0, 0, 0), (5.0, -3, 40), (1, 2, 3)])
def test_switching_keeps_the_picture(target: tuple[float, ...]) -> None:
    """Whatever it is about, the eye itself included."""
    eye = Eye(np.array([1.0, 2, 3]), 200, -40, 50, 0.2, 777)
    there = orbiting(eye, np.array(target, np.float64))
    back = flying(there.eye).eye
    np.testing.assert_allclose(back.position, eye.position, atol=1e-12)
    for name in ("yaw_deg", "pitch_deg", "fov_y_deg", "near_m", "far_m"):
        assert getattr(back, name) == getattr(eye, name)
    still = orbit(there, Input(frozenset("w")), 1.0)
    np.testing.assert_array_equal(still.eye.position, there.eye.position)
