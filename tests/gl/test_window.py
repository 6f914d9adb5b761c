from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator

import moderngl
import numpy as np
import pytest
import xvfb

from vegtool.errors import CapabilityError, UsageError
from vegtool.gl import window_overlay, window_stage
from vegtool.gl.context import context
from vegtool.gl.window import (
    Backdrop,
    Drag,
    Event,
    Key,
    Resize,
    Scroll,
    headless_picture,
    open_window,
)
from vegtool.srgb import srgb_from_linear

pytestmark = pytest.mark.gl

SIZE = (200, 120)
COLOR = (0.5, 0.1, 0.02)
SHOWN = np.rint(255 * srgb_from_linear(np.array(COLOR)))


class Boom(Exception):
    """What a client raises here."""


class Plain:
    """One colour, and a record of what was asked. then: called with the number of each frame."""

    def __init__(self, then: Callable[[int], None] = lambda n: None, *, moving: bool = True):
        self.then, self.moving, self.text = then, moving, ""
        self.events: list[Event] = []
        self.sizes: list[tuple[int, int]] = []
        self.seconds: list[float] = []
        self.done = False
        self.released = 0

    def load(self, ctx: moderngl.Context) -> Iterator[float]:
        yield 1.0

    def frame(self, ctx, framebuffer, size, seconds) -> None:
        framebuffer.clear(*COLOR, 1.0)
        self.sizes.append(size)
        self.seconds.append(seconds)
        self.then(len(self.sizes))

    def overlay(self) -> str:
        return self.text

    def on(self, event: Event) -> None:
        self.events.append(event)

    def moves(self) -> bool:
        return self.moving

    def wants_close(self) -> bool:
        return self.done

    def release(self) -> None:
        self.released += 1


@pytest.fixture(scope="module")
def run() -> Iterator[Callable[..., None]]:
    """Runs a function in a process that has a display."""
    with xvfb.display() as name:

        def isolated(test: Callable[..., None], *arguments: object, **more: str | None) -> None:
            xvfb.alone(test, *arguments, environment={"DISPLAY": name, **more})

        yield isolated


def test_a_window_shows_the_frame_that_is_drawn_without_one(run):
    run(shows_the_same)


class Shapes(Plain):
    """A triangle with soft and hard edges across all brightnesses: edges and rounding show."""

    vertex = """
        #version 330 core
        out vec3 light;
        void main() {
            vec2 at[3] = vec2[](vec2(-0.9, -0.8), vec2(0.95, -0.3), vec2(-0.2, 0.9));
            light = mat3(1.0)[gl_VertexID];
            gl_Position = vec4(at[gl_VertexID], 0.5, 1.0);
        }
    """
    fragment = """
        #version 330 core
        in vec3 light;
        out vec4 pixel;
        void main() { pixel = vec4(light * light, 1.0); }
    """

    def load(self, ctx):
        self.shader = ctx.program(vertex_shader=self.vertex, fragment_shader=self.fragment)
        self.array = ctx.vertex_array(self.shader, [])
        yield 1.0

    def frame(self, ctx, framebuffer, size, seconds):
        super().frame(ctx, framebuffer, size, seconds)
        framebuffer.clear(*COLOR, 1.0)
        self.array.render(vertices=3)

    def release(self):
        super().release()
        self.array.release()
        self.shader.release()


def shows_the_same() -> None:
    alone = headless_picture(Shapes(), SIZE)  # whose context is current in this thread from here on
    assert len(np.unique(alone.reshape(-1, 3), axis=0)) > 1000

    def look(frame: int) -> None:
        if frame > 2 and xvfb.seen().any():  # nothing is, until the window is mapped
            on_screen.append(xvfb.seen())
        client.done = bool(on_screen) and asked.is_set()

    for threaded in (False, True):
        client, asked, on_screen = Shapes(look), threading.Event(), []
        with open_window(client, "shapes", SIZE, threaded=threaded) as window:
            picture = window.screenshot()
            asked.set()
            window.run()
            assert window.closed
        for shown in (picture, on_screen[0]):
            assert shown.shape == alone.shape
            assert np.abs(shown.astype(int) - alone).max() <= 2
        assert client.released == 1
        # what was set aside for the window's context is back
        np.testing.assert_array_equal(headless_picture(Shapes(), SIZE), alone)


def test_keys_and_the_mouse_arrive_under_plain_names(run):
    run(input_arrives)


def input_arrives() -> None:
    def act(frame: int) -> None:
        window = xvfb.the_window()
        if frame == 1:
            for key in ("h", "3", "KP_Left", "Escape", "Left", "Shift_L", "space"):
                xvfb.strike(key)
                xvfb.strike(key, press=False)
            xvfb.strike("w")
        if len(client.events) == len(struck) + 1 and not client.done:
            keys, mouse = pyglet.window.key, pyglet.window.mouse
            window.dispatch_event("on_key_press", keys.RCTRL, keys.MOD_SHIFT | keys.MOD_CAPSLOCK)
            window.dispatch_event("on_mouse_drag", 9, 9, 3, -2, mouse.RIGHT, keys.MOD_CTRL)
            window.dispatch_event("on_mouse_scroll", 9, 9, 0.0, -1.0)
            window.dispatch_event("on_deactivate")  # nobody will tell that keys were let go
            client.done = True

    names = ("h", "3", "left", "escape", "left", "shift", "space")
    struck = [(name, pressed) for name in names for pressed in (True, False)]
    client = Plain(act)
    window = open_window(client, "input", SIZE)
    import pyglet

    window.run()
    keys = [event for event in client.events if isinstance(event, Key)]
    assert [(key.name, key.pressed) for key in keys] == [
        *struck, ("w", True), ("ctrl", True), ("ctrl", False), ("w", False),
    ]  # fmt: skip
    assert keys[-3].modifiers == {"shift"}
    assert [event for event in client.events if not isinstance(event, Key)] == [
        Drag(3, -2, "right", frozenset({"ctrl"})), Scroll(-1.0),
    ]  # fmt: skip


def test_a_window_is_resized_to_a_pixel_and_back(run):
    run(resizes)


def resizes() -> None:
    sizes = [(1, 1), (1, 300), (320, 240)]

    def resize(frame: int) -> None:
        if client.sizes[-1] == ([SIZE, *sizes])[len(wanted)]:
            if len(wanted) == len(sizes):
                seen.append(xvfb.seen())
                client.done = len(seen) == 2
            else:
                wanted.append(sizes[len(wanted)])
                xvfb.the_window().set_size(*wanted[-1])

    client, wanted, seen = Plain(resize), [], []
    client.text = "some text"
    open_window(client, "sizes", SIZE).run()
    events = [event for event in client.events if isinstance(event, Resize)]
    assert [(event.width, event.height) for event in events] == sizes
    assert seen[-1].shape == (240, 320, 3)
    np.testing.assert_allclose(seen[-1][[-1, -1, 119], [0, -1, -1]], [SHOWN] * 3, atol=1)
    assert (seen[-1] == 255).all(axis=-1).any(), "letters are white"


def test_what_a_client_raises_closes_the_window_and_is_raised_again(run):
    run(raises)


def raises() -> None:
    for threaded in (False, True):
        raises_in(threaded)


def raises_in(threaded: bool) -> None:
    for place in ("load", "frame", "overlay", "on", "moves", "wants_close", "release"):

        def boom(*_: object) -> None:
            raise Boom(place)  # noqa: B023

        client = Plain(lambda n: xvfb.strike("h"))
        if place == "release":
            client.done = True
        setattr(client, place, boom)
        with pytest.raises(Boom, match=place):
            window = open_window(client, "raises", SIZE, threaded=threaded)
            window.run()
        if place != "load":  # which is called before a window is returned
            assert window.closed
            window.close()  # raised once
        assert client.released == (place != "release")

    def refused(frame: int) -> None:
        framebuffer = xvfb.the_window().stage._ctx
        framebuffer.texture((10**6, 1), 4)

    with pytest.raises(CapabilityError, match="OpenGL refused"):
        open_window(Plain(refused), "refused", SIZE, threaded=threaded).run()
    client = Plain(lambda n: setattr(client, "done", True))
    open_window(client, "afterwards", SIZE, threaded=threaded).run()
    assert len(client.sizes) == 1


def test_a_window_closes_from_anywhere_any_number_of_times(run):
    run(closes)


def closes() -> None:
    def closing(how: str) -> Callable[[int], None]:
        def then(frame: int) -> None:
            if frame != 2:
                return
            if how == "the user":
                xvfb.the_window().dispatch_event("on_close")
            elif how == "the client":
                window.close()
            elif how == "another thread":
                other.start()

        return then

    for how in ("the user", "the client", "another thread"):
        client = Plain(closing(how))
        window = open_window(client, how, SIZE)
        other = threading.Thread(target=window.close)
        with pytest.raises(UsageError, match="only one"):
            open_window(Plain(), "second", SIZE)
        window.run()
        if other.ident is not None:
            other.join()
        for _ in range(2):
            window.close()
        window.run()
        assert window.closed and client.released == 1 and len(client.sizes) == 2
        with pytest.raises(UsageError, match="closed before"):
            window.screenshot()

    client = Plain()
    window = open_window(client, "never run", SIZE)
    np.testing.assert_allclose(window.screenshot()[5, 5], SHOWN, atol=1)
    window.close()
    window.close()
    assert client.released == 1

    window = open_window(Plain(), "thread", SIZE, threaded=True)
    with pytest.raises(UsageError, match="only one"):
        open_window(Plain(), "second", SIZE, threaded=True)
    np.testing.assert_allclose(window.screenshot()[5, 5], SHOWN, atol=1)
    window.close()
    window.wait()
    window.close()
    assert window.closed


def test_a_window_loads_bit_by_bit_with_a_bar_and_answers_meanwhile(run):
    # a session of Wayland, in which PyOpenGL would look for another kind of context
    run(loads, WAYLAND_DISPLAY="wayland-0", XDG_SESSION_TYPE="wayland")


class Slow(Plain):
    def load(self, ctx):
        self.seen = []
        for tenth in range(10):
            if tenth == 2:
                xvfb.strike("h")
                drag = "on_mouse_drag", 39, 29, 30, 20, 1, 0
                xvfb.the_window().dispatch_event(*drag)  # pressed elsewhere
                xvfb.the_window().dispatch_event("on_mouse_press", 9, 9, 1, 0)
                xvfb.the_window().dispatch_event(*drag)
            if tenth:
                self.seen.append(xvfb.seen())
            yield tenth / 10
        while not any(isinstance(event, Key) for event in self.events):
            yield 0.9


def loads() -> None:
    window_stage.SPELL = 0.0  # one bit at a time
    ground = np.array([[-50.0, 0, -50], [-50, 0, 50], [50, 0, 50], [50, 0, -50]])
    up, faces = np.tile([0.0, 1.0, 0.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])
    eye = np.eye(4)
    eye[1, 3] = 2.0
    before = [ground.copy(), eye.copy()]
    for backdrop in (None, Backdrop(ground, up, faces, eye)):
        client = Slow()
        client.then = lambda n, client=client: setattr(client, "done", True)
        open_window(client, "loads", SIZE, backdrop=backdrop).run()
        bars = [picture[60 - 2, :, 1] > 150 for picture in client.seen]
        lengths = [np.flatnonzero(bar & (picture[58, :, 2] < 120)) for bar, picture in
                   zip(bars, client.seen, strict=True)]  # fmt: skip
        assert [len(length) for length in lengths] == [0, *range(15, 121, 15)]
        assert any(isinstance(event, Key) and event.name == "h" for event in client.events)
        drags = [event for event in client.events if isinstance(event, Drag)]
        assert len(drags) == 2 * (backdrop is None), "drags turn the view of a backdrop"
        sky, soil = client.seen[0][5, 100].astype(int), client.seen[0][-5, 100].astype(int)
        if backdrop is None:
            assert not sky.any() and not soil.any()
        else:
            np.testing.assert_allclose(sky, 255 * srgb_from_linear(backdrop.sky), atol=1)
            assert soil[1] > 50 and soil[1] > soil[2]
            assert (client.seen[-1][70:] != client.seen[0][70:]).any(), "the view has turned"
    np.testing.assert_array_equal(before[0], ground)
    np.testing.assert_array_equal(before[1], eye)
    assert ground.flags.writeable and "PYOPENGL_PLATFORM" not in os.environ


def test_frames_are_drawn_where_something_moves_or_is_done(run):
    run(idles)


class Still(Plain):
    """Nothing moves; acts by the number of times that it is asked so."""

    asked = before = heard = 0

    def moves(self):
        self.asked += 1
        if self.asked == 50:
            self.text = "other text"
        if self.asked == 100:
            self.before = len(self.sizes)
            xvfb.strike("h")
            xvfb.strike("h", press=False)
        if len(self.events) == 2:
            self.heard += 1
            self.done = self.heard == 50
        return False


def idles() -> None:
    client = Still()
    window = open_window(client, "still", SIZE, rate=None, vsync=False)
    window.run()
    # one frame, or another where the display asked for it; text alone asks for none
    assert client.before <= 3
    assert client.before < len(client.sizes) <= client.before + 2
    assert client.seconds[0] == 0.0 and all(seconds >= 0 for seconds in client.seconds)


def test_what_is_missing_is_said_with_what_to_do(run):
    run(is_missing, MESA_GL_VERSION_OVERRIDE="2.1")


def is_missing() -> None:
    display = os.environ.pop("DISPLAY")
    for sentence in ("a window needs a display", "with OpenGL 3.3 is needed"):
        for threaded in (False, True):
            client = Plain()
            with pytest.raises(CapabilityError, match=f"{sentence}.*--screenshot") as caught:
                open_window(client, "missing", SIZE, threaded=threaded)
            assert caught.value.exit_code == 5
            assert client.released == 0  # nothing was loaded
        os.environ["DISPLAY"] = display


def test_a_rate_has_to_be_one():
    with pytest.raises(UsageError, match="rate"):
        open_window(Plain(), "rate", SIZE, rate=0.0)


def test_letters_are_monospace_and_fit():
    one, two = window_overlay.letters("iii"), window_overlay.letters("MMM\n漢é")
    assert one.shape[1] == two.shape[1] and two.shape[0] - one.shape[0] == 11
    assert one.any() and set(np.unique(two)) == {0, 255}
    assert window_overlay.letter_scale((1024, 768), (300, 60)) == 2
    assert window_overlay.letter_scale((3840, 2160), (300, 60)) == 4
    assert window_overlay.letter_scale((500, 768), (300, 60)) == 1
    assert window_overlay.letter_scale((1, 1), (300, 60)) == 1


def test_a_picture_without_a_window_releases_after_an_error_too():
    def boom(frame: int) -> None:
        raise Boom

    client = Plain(boom)
    before = context().detect_framebuffer().glo
    with pytest.raises(Boom):
        headless_picture(client, SIZE)
    assert client.released == 1 and context().detect_framebuffer().glo == before
