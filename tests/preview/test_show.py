"""What the viewer shows: without a window, and in one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
import xvfb
from walk_cases import Garden, garden, herb, plants, species_of, wood, world_of

from vegtool.arrays import ByteArray
from vegtool.gl.context import context, framebuffer_kept
from vegtool.gl.screen import Screen
from vegtool.gl.window import Drag, Key, Resize, Scroll, headless_picture, open_window
from vegtool.gl.window_client import Event
from vegtool.preview.controls import Fly, Orbit, orbiting
from vegtool.preview.eye import Eye
from vegtool.preview.governor import BEGIN, Governor
from vegtool.preview.run import frames, loaded
from vegtool.preview.show import MOVING, PANELS, SKY, Show
from vegtool.preview.state import KEYS, State, help_text
from vegtool.srgb import srgb_from_linear

pytestmark = pytest.mark.gl

SIZE = (90, 60)
EYE = Eye(np.array([0.5, 1.6, 9.0]), 3.0, -4.0)
BEHIND = np.rint(255 * srgb_from_linear(np.array(SKY)))


def first_state() -> State:
    return State(Fly(EYE), np.array([0.0, 1.0, 0.0]))


@pytest.fixture(scope="module")
def ready() -> Iterator[tuple[Show, Screen]]:
    """A wood of all kinds, loaded once."""
    show = Show(world_of(garden(), wood(3, 8, 6.0), EYE), first_state())
    with loaded(show) as screen:
        yield show, screen


@pytest.fixture
def walk(ready: tuple[Show, Screen]) -> tuple[Show, Screen]:
    """It, as at first."""
    show, screen = ready
    show.state, show.way, show.keeper = first_state(), [], None
    for name in {*MOVING, "shift"}:
        show.on(Key(name, False))
    show.follow((), 1.0)
    return show, screen


def drawn(
    show: Show, screen: Screen, seconds: float = 0.0, size: tuple[int, int] = SIZE
) -> ByteArray:
    with framebuffer_kept(screen.ctx):
        screen.begin(size, SKY)
        show.frame(screen.ctx, screen.ctx.fbo, size, seconds)
        screen.resolve()
        return screen.read()


def press(show: Show, *names: str) -> None:
    for name in names:
        show.on(Key(name))
        show.on(Key(name, False))


# -- keys ------------------------------------------------------------------------------------------

SEEN = {
    "v", "x", "m", "bracketleft", "bracketright", "pageup", "pagedown", "minus", "0", "1", "2",
    "3", "4", "5", "6", "7", "8", "9",
}  # fmt: skip
"""Keys that change the picture of a wood at its levels."""


@pytest.mark.parametrize("binding", KEYS, ids=lambda b: b.name)
def test_keys_change_the_picture_that_are_to(binding, walk: tuple[Show, Screen]) -> None:
    """And no others. More detail is none where levels are good enough for all pixels."""
    show, screen = walk
    before = drawn(show, screen)
    press(show, binding.name)
    after = drawn(show, screen)
    if binding.name in ("plus", "equal"):
        show.state = replace(first_state(), detail=0.6)
        before = drawn(show, screen)
        press(show, binding.name)
        after = drawn(show, screen)
    changes = binding.name in SEEN | {"plus", "equal"}
    assert (before != after).any() == changes
    assert before.std() > 20, "there is something to see"


def test_each_key_is_told_of_in_figures_or_help(walk: tuple[Show, Screen]) -> None:
    show, screen = walk
    drawn(show, screen)
    plain = show.overlay()
    assert "of 72 plants" in plain and "triangles" in plain and "h: help" in plain
    for names, text in (
        (("h",), help_text()), (("3",), "level 3 held"), (("v",), "by level"),
        (("v", "v", "v"), "by overdraw"), (("m",), " | ".join(PANELS)), (("r",), "recording: "),
        (("minus",), "detail 0.909"),
    ):  # fmt: skip
        show.state = first_state()
        press(show, *names)
        drawn(show, screen)
        assert text in show.overlay() and text not in plain
    show.state = first_state()
    press(show, "i")
    drawn(show, screen)
    assert show.overlay() == ""
    press(show, "h")
    assert show.overlay() == help_text()


def test_nothing_is_told_before_there_is_a_frame() -> None:
    show = Show(world_of((herb(),), Garden([plants([[0, 0, 0]])]), EYE), first_state())
    assert show.overlay() == "" and not show.wants_close() and show.stats is None
    show.on(Key("escape"))
    assert show.wants_close()
    show.release()


def test_moving_goes_on_while_a_key_is_held(walk: tuple[Show, Screen]) -> None:
    show, screen = walk
    assert not show.moves()
    show.on(Key("W"))  # whatever its case
    assert show.moves()
    before = show.state.eye.position
    drawn(show, screen, 0.5)
    np.testing.assert_allclose(show.state.eye.position, before + 1.5 * EYE.forward)
    show.on(Key("w", False))
    assert not show.moves()
    drawn(show, screen, 0.5)
    np.testing.assert_allclose(show.state.eye.position, before + 1.5 * EYE.forward)


def test_the_mouse_looks_around_once_for_each_move(walk: tuple[Show, Screen]) -> None:
    """Up is up."""
    show, screen = walk
    show.on(Drag(10.0, 5.0))
    show.on(Drag(-4.0, 5.0))
    show.on(Scroll(2.0))
    drawn(show, screen)
    camera = show.state.camera
    assert isinstance(camera, Fly)
    assert (EYE.yaw_deg - camera.eye.yaw_deg) == pytest.approx(6 * 0.2)
    assert camera.eye.pitch_deg - EYE.pitch_deg == pytest.approx(10 * 0.2)
    assert camera.speed_m_s == pytest.approx(3.0 * 1.2**2)
    drawn(show, screen)
    assert show.state.camera.eye.yaw_deg == camera.eye.yaw_deg, "it was done"


# -- a way -----------------------------------------------------------------------------------------


class Kept:
    """What was kept, in order."""

    def __init__(self) -> None:
        self.pictures, self.ways = 0, []

    def picture(self) -> None:
        self.pictures += 1

    def way(self, walked: Sequence[tuple[Eye, float]]) -> None:
        self.ways.append(list(walked))


def test_a_way_is_recorded_from_r_to_r(walk: tuple[Show, Screen]) -> None:
    """Each frame's eye and its time, handed over at the end, once; another one is begun anew."""
    show, screen = walk
    show.keeper = kept = Kept()
    drawn(show, screen, 0.1)
    press(show, "r")
    assert show.moves(), "frames go on, so that standing still is recorded too"
    show.on(Key("w"))
    for _ in range(4):
        drawn(show, screen, 0.25)
        assert not show.wants_close()
    show.on(Key("w", False))
    assert len(show.way) == 4 and kept.ways == []
    times = [at for _, at in show.way]
    np.testing.assert_allclose(np.diff(times), 0.25)
    steps = np.diff([eye.position for eye, _ in show.way], axis=0)
    np.testing.assert_allclose(steps, np.tile(0.75 * EYE.forward, (3, 1)), atol=1e-12)
    press(show, "r")
    drawn(show, screen, 0.25)
    for _ in range(2):
        show.wants_close()
    assert [len(way) for way in kept.ways] == [4]
    press(show, "r")
    drawn(show, screen, 0.25)
    press(show, "r")
    show.wants_close()
    assert [len(way) for way in kept.ways] == [4, 1]


def test_pictures_are_kept_once_for_each_key(walk: tuple[Show, Screen]) -> None:
    show, screen = walk
    show.keeper = kept = Kept()
    drawn(show, screen)
    show.wants_close()
    before = kept.pictures
    for _ in range(3):
        press(show, "p")
        drawn(show, screen)
        show.wants_close()
        show.wants_close()
    assert kept.pictures - before == 3


def test_a_way_is_followed_until_a_key_moves_the_eye(walk: tuple[Show, Screen]) -> None:
    """As time goes on, and from its beginning again."""
    show, screen = walk
    way = [replace(EYE, position=EYE.position + np.array([x, 0.0, 0.0])) for x in range(4)]
    show.follow(way, 10.0)
    assert show.moves()
    seen = []
    for _ in range(6):
        drawn(show, screen, 0.1)
        seen.append(float(show.state.eye.position[0] - EYE.position[0]))
    assert seen == [1, 2, 3, 0, 1, 2]
    show.on(Key("d"))
    drawn(show, screen, 0.1)
    show.on(Key("d", False))
    assert not show.moves()
    assert show.state.eye.position[0] - EYE.position[0] == pytest.approx(2.3, abs=0.01)


@pytest.mark.parametrize("camera", [Fly(EYE), orbiting(EYE, np.zeros(3))])
def test_an_eye_is_put_anywhere(camera: Fly | Orbit, walk: tuple[Show, Screen]) -> None:
    show, screen = walk
    show.state = replace(show.state, camera=camera)
    there = Eye(np.array([3.0, 2.0, 5.0]), 40.0, -20.0)
    with framebuffer_kept(screen.ctx):
        (first,) = frames(show, screen, SIZE, [there], 30.0)
    np.testing.assert_allclose(show.state.eye.position, there.position, atol=1e-12)
    assert type(show.state.camera) is type(camera)
    show.state = replace(first_state(), camera=Fly(there))
    assert np.abs(drawn(show, screen).astype(int) - first).max() <= 1


# -- side by side ----------------------------------------------------------------------------------


def panels(picture: ByteArray) -> list[np.ndarray]:
    width = picture.shape[1] // 3
    return [picture[:, i * width : (i + 1) * width].astype(int) for i in range(3)]


def test_compared_are_what_is_drawn_and_plants_in_full_and_how_they_differ(
    walk: tuple[Show, Screen],
) -> None:
    """Each of a third of the width, as it would be alone; the last is the first less the second,
    either way round."""
    show, screen = walk
    third = (SIZE[0] // 3, SIZE[1])
    show.state = replace(show.state, level=1)
    alone = drawn(show, screen, size=third)
    press(show, "m")
    first, second, third_panel = panels(drawn(show, screen))
    np.testing.assert_array_equal(first, alone)
    assert np.abs(third_panel - np.abs(first - second)).max() <= 1
    assert third_panel.max() > 30
    assert np.abs(second[0, 0] - BEHIND).max() <= 1, "both see the sky"


def compared_near(*keys: str) -> list[np.ndarray]:
    """The panels of two herbs that are near."""
    close = Eye(np.array([0.2, 0.3, 1.2]))
    place = Garden([plants([[0, 0, 0], [0.4, 0, 0]])])
    show = Show(world_of((herb(),), place, close), State(Fly(close)))
    with loaded(show) as screen:
        press(show, "m", *keys)
        return panels(drawn(show, screen))


def test_what_is_equal_is_black() -> None:
    first, second, difference = compared_near("0")
    assert first.std() > 10
    np.testing.assert_array_equal(first, second)
    assert (difference == 0).all()


def test_a_plant_that_is_near_is_what_it_is_in_full() -> None:
    assert (compared_near()[2] == 0).all()


def test_compared_in_any_size(walk: tuple[Show, Screen]) -> None:
    show, screen = walk
    press(show, "m")
    for size in ((1, 1), (2, 5), (4, 3), (91, 60)):
        assert drawn(show, screen, size=size).shape == (size[1], size[0], 3)
    press(show, "m", "v", "v", "v")
    overdraw = drawn(show, screen)
    assert (overdraw[0, 0] == 0).all(), "before nothing"


# -- frames ----------------------------------------------------------------------------------------


def test_any_size_down_to_a_pixel(walk: tuple[Show, Screen]) -> None:
    show, screen = walk
    usual = drawn(show, screen)
    for size in ((1, 1), (1, 70), (300, 1)):
        assert drawn(show, screen, size=size).shape == (size[1], size[0], 3)
    np.testing.assert_array_equal(drawn(show, screen), usual)


def test_a_governor_that_has_no_time_leaves_out_detail(walk: tuple[Show, Screen]) -> None:
    """A hundred-thousandth of a millisecond a frame: distances fall, as fast as they may."""
    show, screen = walk
    show.state = replace(show.state, governor=Governor(1e-5 / (1 + BEGIN)))
    assert show.moves()
    details = []
    for _ in range(12):
        drawn(show, screen, 0.1)
        details.append(show.state.distances)
        assert show.stats is not None and show.stats.detail in (1.0, *details)
    assert details[0] == 1 and details[-1] < 0.9 and details == sorted(details, reverse=True)
    assert "holding 1e+08 fps" in show.overlay()


def test_releasing_frees_once_and_again() -> None:
    show = Show(world_of((herb(),), Garden([plants([[0, 0, 0]])]), EYE), first_state())
    with loaded(show) as screen:
        press(show, "m")
        drawn(show, screen)
        assert show.forest.texture_bytes > 0
    show.release()
    assert show.forest.texture_bytes == 0 and context().error == "GL_NO_ERROR"


# -- in a window -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run() -> Iterator[Callable[..., None]]:
    """Runs a function in a process that has a display."""
    with xvfb.display() as name:

        def isolated(test: Callable[..., None], *arguments: object) -> None:
            xvfb.alone(test, *arguments, environment={"DISPLAY": name})

        yield isolated


class Walk(Show):
    """A few herbs. then: called with the number of each frame."""

    def __init__(self, then: Callable[[int], None] = lambda n: None) -> None:
        feet = [[0, 0, 0], [0.5, 0, -0.6], [-0.6, 0, -1], [0.1, 0, -3]]
        self.close = Eye(np.array([0.1, 0.3, 1.2]), 4.0, -5.0)
        small = species_of("small", herb().levels[0])
        world = world_of((small,), Garden([plants(feet, yaw=[0, 1, 2, 3])]), self.close)
        super().__init__(world, State(Fly(self.close), np.zeros(3), told=False))
        self.then, self.count, self.done = then, 0, False
        self.sizes: list[tuple[int, int]] = []
        self.events: list[Event] = []

    def frame(self, ctx, framebuffer, size, seconds) -> None:
        super().frame(ctx, framebuffer, size, seconds)
        self.sizes.append(size)
        self.count += 1
        self.then(self.count)

    def on(self, event: Event) -> None:
        self.events.append(event)
        super().on(event)

    def moves(self) -> bool:
        return True

    def wants_close(self) -> bool:
        return super().wants_close() or self.done


def test_a_window_shows_what_is_drawn_without_one(run) -> None:
    run(shows_the_same)


def shows_the_same() -> None:
    size = (150, 100)
    for keys, stereo, threaded in (((), False, False), (("m",), False, True), ((), True, False)):
        alone, client = Walk(), Walk()
        for each in (alone, client):
            each.state = replace(each.state, stereo=stereo)
            press(each, *keys)
        wanted = headless_picture(alone, size)
        assert len(np.unique(wanted.reshape(-1, 3), axis=0)) > 50
        with open_window(client, "walk", size, threaded=threaded) as window:
            picture = window.screenshot()
            client.done = True
            window.run()
        assert window.closed
        assert np.abs(picture.astype(int) - wanted).max() <= 2


def test_every_key_of_a_keyboard_arrives(run) -> None:
    run(keys_arrive)


def keys_arrive() -> None:
    """By X's names for them; what is plus with shift on one keyboard is another key on the next."""
    names = {
        "h": "h", "i": "i", "c": "c", "v": "v", "x": "x", "m": "m", "bracketleft": "bracketleft",
        "bracketright": "bracketright", "Prior": "pageup", "Next": "pagedown", "KP_Add": "plus",
        "equal": "equal", "minus": "minus", "l": "l", "p": "p", "r": "r",
        **{str(n): str(n) for n in range(10)}, "Escape": "escape",
    }  # fmt: skip
    assert set(names.values()) == {binding.name for binding in KEYS}
    before = Walk().state

    def act(frame: int) -> None:
        if frame == 1:
            for name in names:
                xvfb.strike(name)
                xvfb.strike(name, press=False)

    client = Walk(act)
    open_window(client, "keys", (60, 40)).run()
    state = client.state
    arrived = [event.name for event in client.events if isinstance(event, Key) and event.pressed]
    assert arrived == list(names.values())
    assert state.closing and state.help and state.told and state.compare and state.recording
    assert isinstance(state.camera, Orbit) and state.color == "by level" and state.level == 9
    assert state.screenshots == 1 and state.wireframe
    np.testing.assert_allclose(state.light.unit, before.light.unit, atol=1e-9)
    assert state.detail > 1.05


def test_a_window_is_resized_to_a_pixel_and_closed_by_its_key(run) -> None:
    run(resizes)


def resizes() -> None:
    for threaded in (False, True):
        resizes_in(threaded)


def resizes_in(threaded: bool) -> None:
    wanted = [(90, 60), (1, 1), (1, 200), (120, 80)]
    left = wanted[1:]

    def act(frame: int) -> None:
        if client.sizes[-1] == wanted[-1 - len(left)]:
            if left:
                xvfb.the_window().set_size(*left.pop(0))
            else:
                xvfb.strike("Escape")

    client = Walk(act)
    with open_window(client, "sizes", wanted[0], threaded=threaded) as window:
        window.run()
        assert window.closed
    events = [(event.width, event.height) for event in client.events if isinstance(event, Resize)]
    assert events == wanted[1:] and set(wanted) <= set(client.sizes)
    assert client.forest.texture_bytes == 0, "it was released"
