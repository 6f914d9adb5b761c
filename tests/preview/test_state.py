"""Keys, one by one: each does what the help says, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from vegtool.lighting.light import Light, Sun
from vegtool.preview.controls import Fly, Input, Orbit
from vegtool.preview.eye import Eye
from vegtool.preview.governor import Governor
from vegtool.preview.palette import COLORS
from vegtool.preview.state import (
    DETAIL_STEP,
    KEYS,
    LEAST_DETAIL,
    MOST_DETAIL,
    SUN_STEP_DEG,
    UNSHOWN,
    State,
    help_text,
    moved,
    pressed,
)

EYE = Eye(np.array([1.0, 2.0, 3.0]), 20.0, -10.0)
TARGET = np.array([0.0, 1.0, 0.0])


def flying() -> State:
    return State(Fly(EYE), TARGET)


def changed(before: State, after: State) -> set[str]:
    """Names of fields that are not what they were."""
    return {f.name for f in fields(State) if getattr(before, f.name) is not getattr(after, f.name)}


WANTED: dict[str, tuple[str, Callable[[State], bool]]] = {
    "h": ("help", lambda s: s.help),
    "i": ("told", lambda s: not s.told),
    "c": ("camera", lambda s: isinstance(s.camera, Orbit)),
    "v": ("color", lambda s: s.color == "by level"),
    "x": ("wireframe", lambda s: s.wireframe),
    "m": ("compare", lambda s: s.compare),
    "bracketleft": ("sun", lambda s: round(azimuth(s) - azimuth(flying()), 6) == -SUN_STEP_DEG),
    "bracketright": ("sun", lambda s: round(azimuth(s) - azimuth(flying()), 6) == SUN_STEP_DEG),
    "pageup": ("sun", lambda s: round(elevation(s) - elevation(flying()), 6) == SUN_STEP_DEG),
    "pagedown": ("sun", lambda s: round(elevation(s) - elevation(flying()), 6) == -SUN_STEP_DEG),
    "plus": ("detail", lambda s: s.detail == DETAIL_STEP),
    "equal": ("detail", lambda s: s.detail == DETAIL_STEP),
    "minus": ("detail", lambda s: s.detail == 1 / DETAIL_STEP),
    **{str(n): ("level", lambda s, n=n: s.level == n) for n in range(10)},
    "p": ("screenshots", lambda s: s.screenshots == 1),
    "r": ("recording", lambda s: s.recording),
    "escape": ("closing", lambda s: s.closing),
}
"""What each key changes of an eye that flies, and what it is then."""


def azimuth(state: State) -> float:
    x, _, z = state.light.unit
    return float(np.degrees(np.arctan2(x, z)))


def elevation(state: State) -> float:
    return float(np.degrees(np.arcsin(state.light.unit[1])))


@pytest.mark.parametrize("name", [binding.name for binding in KEYS])
def test_every_key_does_what_the_help_says_and_nothing_else(name: str) -> None:
    before = flying()
    after = pressed(before, name)
    if name == "l":  # there is nothing to end
        assert not changed(before, after)
        return
    field, holds = WANTED[name]
    kept = {"flight"} if name == "c" else set()  # as it is come back to
    assert changed(before, after) == {field, *kept} and holds(after)
    assert not changed(before, flying()) - {"camera", "target"}, "the state before stays"


def test_keys_are_told_apart_and_all_are_tried() -> None:
    names = [binding.name for binding in KEYS]
    assert len(set(names)) == len(names) and {*WANTED, "l"} == set(names)
    assert not {"w", "a", "s", "d", "q", "e", "left", "right", "up", "down", "shift"} & set(names)


@pytest.mark.parametrize("name", ["", "w", "left", "shift", "f5", "H", "escape ", "space"])
def test_a_key_that_is_not_in_the_table_changes_nothing(name: str) -> None:
    before = flying()
    assert pressed(before, name) is before


@pytest.mark.parametrize("name", ["h", "i", "x", "m", "r"])
def test_what_is_shown_is_hidden_again(name: str) -> None:
    field, _ = WANTED[name]
    again = pressed(pressed(flying(), name), name)
    assert getattr(again, field) == getattr(flying(), field)


def test_the_help_lists_every_key_once() -> None:
    """Digits in one line, and those that move."""
    text = help_text()
    lines = text.splitlines()
    for binding in KEYS:
        if binding.name in UNSHOWN:
            continue
        shown = "0 to 9" if binding.name == "0" else binding.shown
        wanted = "hold a level" if binding.name == "0" else binding.help
        found = [line for line in lines if line.split("  ")[0] == shown]
        assert len(found) == 1 and found[0].endswith(wanted)
    for name in UNSHOWN:
        (binding,) = (binding for binding in KEYS if binding.name == name)
        assert name in "123456789" or binding.help == "the same"
    assert lines[0].startswith("w a s d, arrows") and lines[1].startswith("mouse")
    starts = {len(line) - len(line.split("  ", 1)[1].lstrip()) for line in lines}
    assert len(starts) == 1, "in two columns"


def test_colours_go_round() -> None:
    state, seen = flying(), []
    for _ in range(2 * len(COLORS)):
        seen.append(state.color)
        state = pressed(state, "v")
    assert seen == [*COLORS] * 2


def test_a_level_is_held_until_distances_are_asked_for() -> None:
    held = pressed(pressed(flying(), "3"), "7")
    assert held.level == 7 and pressed(held, "l").level is None


def test_detail_keeps_to_its_limits_and_comes_back() -> None:
    up = down = flying()
    for _ in range(200):
        up, down = pressed(up, "plus"), pressed(down, "minus")
    assert (up.detail, down.detail) == (MOST_DETAIL, LEAST_DETAIL)
    there = pressed(pressed(flying(), "equal"), "minus")
    assert there.detail == pytest.approx(1.0) == there.distances


def test_a_governor_gives_way_to_the_hand() -> None:
    """From where it had come to."""
    governed = replace(flying(), governor=Governor(20.0, detail=0.5))
    assert governed.distances == 0.5
    after = pressed(governed, "plus")
    assert after.governor is None and after.distances == pytest.approx(0.5 * DETAIL_STEP)
    for name in ("v", "h", "3", "bracketleft"):
        assert pressed(governed, name).governor is governed.governor


def test_the_sun_goes_round_and_no_farther_than_overhead() -> None:
    state = flying()
    np.testing.assert_allclose(state.light.unit, Light().unit)
    for _ in range(round(360 / SUN_STEP_DEG)):
        state = pressed(state, "bracketright")
    np.testing.assert_allclose(state.light.unit, Light().unit, atol=1e-9)
    for _ in range(100):
        state = pressed(state, "pageup")
    np.testing.assert_allclose(state.light.unit, (0, 1, 0), atol=1e-9)
    for _ in range(100):
        state = pressed(state, "pagedown")
    assert state.sun is not None and state.sun.elevation_deg == -90
    assert state.light.sun == 0, "below the horizon it gives no light"


def test_a_sun_that_is_given_is_moved_from_where_it_is() -> None:
    state = replace(flying(), sun=Sun(2.0, 30.0))
    assert pressed(state, "bracketleft").sun == Sun(357.0, 30.0)
    assert pressed(state, "pagedown").sun == Sun(2.0, 25.0)


def test_orbiting_and_flying_begin_where_the_other_ends() -> None:
    there = pressed(flying(), "c")
    assert isinstance(there.camera, Orbit) and (there.camera.target == TARGET).all()
    back = pressed(there, "c")
    assert isinstance(back.camera, Fly)
    for state in (there, back):
        np.testing.assert_allclose(state.eye.position, EYE.position, atol=1e-12)
        assert (state.eye.yaw_deg, state.eye.pitch_deg) == (EYE.yaw_deg, EYE.pitch_deg)


def test_who_flies_again_stays_above_the_ground_and_as_fast() -> None:
    state = State(Fly(EYE, 7.0, ground=lambda x, z: 1.5, clearance_m=0.3), TARGET)
    again = pressed(pressed(state, "c"), "c")
    down = moved(again, Input(frozenset({"q"})), 60.0)
    assert isinstance(down.camera, Fly) and down.camera.speed_m_s == 7.0
    assert down.eye.position[1] == pytest.approx(1.8)


def test_time_moves_the_eye_and_nothing_else() -> None:
    before = flying()
    after = moved(before, Input(frozenset({"w"})), 0.5)
    assert changed(before, after) == {"camera"}
    np.testing.assert_allclose(after.eye.position, EYE.position + 1.5 * EYE.forward)
    orbit = pressed(before, "c")
    turned = moved(orbit, Input(drag_px=(50.0, 0.0)), 0.5)
    assert changed(orbit, turned) == {"camera"}
    away = [np.linalg.norm(s.eye.position - TARGET) for s in (orbit, turned)]
    assert away[0] == pytest.approx(away[1])
