"""What happens in a window, frame by frame, whatever library made the window.

A stage belongs to the thread and the context of its window, but for what says that it does not.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from time import perf_counter

import moderngl

from vegtool.arrays import ByteArray
from vegtool.errors import UsageError
from vegtool.gl.context import check
from vegtool.gl.screen import Screen
from vegtool.gl.window_client import Client, Event, Resize
from vegtool.gl.window_overlay import Overlay, Size, draw_bar, show

SPELL = 0.05
"""Seconds of loading between two looks at the window: as long as an answer may take."""

Draw = Callable[[moderngl.Framebuffer, Size], None]
"""Draws a backdrop into a framebuffer of that size, encoded as it is shown."""


class Stage:
    """A client's loading, frames and text, until it or the window is closed.

    closing: whether the window is to be closed; any thread may set it. failure: what was raised.
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self.closing = False
        self.failure: BaseException | None = None
        self.shown = False
        self.loading = True
        self._begun = self._ended = False
        self._size: Size = (0, 0)
        self._stale = self._exposed = True
        self._load: Iterator[float] = iter(())
        self._fraction = 0.0
        self._asked: list[Future[ByteArray]] = []
        self._lock = threading.Lock()

    @contextmanager
    def caught(self) -> Iterator[None]:
        """What is raised within is kept, and closes the window: event loops swallow it."""
        try:
            yield
        except BaseException as error:
            self.fail(error)

    def fail(self, error: BaseException) -> None:
        """Keep an error, if it is the first, and close."""
        self.failure = self.failure or error
        self.closing = True

    def raise_failure(self) -> None:
        """Raise what was raised, once. In any thread."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure

    def begin(self, ctx: moderngl.Context, backdrop: Draw | None = None) -> None:
        """Start, in a context that is current. backdrop: what is seen while the client loads."""
        self._ctx = ctx
        self._backdrop = backdrop
        self._window = ctx.detect_framebuffer(0)
        self._screen = Screen(ctx)
        self._overlay = Overlay(ctx)
        self._begun = True
        self._load = self.client.load(ctx)

    def event(self, event: Event) -> None:
        """Tell the client; a frame is drawn afterwards."""
        with self.caught():
            self._stale = True
            self.client.on(event)

    def refresh(self, *, draw: bool = False) -> None:
        """Show again what was shown, after the window was covered; draw: draw it again."""
        self._exposed = True
        self._stale |= draw

    def step(self, size: Size, seconds: float) -> bool:
        """Do what is to be done now; returns whether there is something new to show.

        size: of the window's framebuffer, pixels. seconds: since the last step.
        """
        self._fit(size)
        if self.client.wants_close():
            self.closing = True
            return False
        if self.loading:
            if not self._loaded():
                self._show_loading()
                return True
            self.loading, self._stale, seconds = False, True, 0.0
        drawn = self._stale or self.client.moves()
        if drawn:
            self._draw(seconds)
        drawn |= self._overlay.write(self.client.overlay()) or self._exposed
        if drawn:
            self._exposed = False
            show(_color_of(self._pixels), self._window, self._size)
            self._overlay.draw(self._window, self._size)
            check(self._ctx)
        self._answer()
        return drawn

    def ask(self) -> Future[ByteArray]:
        """The picture of a frame, as soon as there is one. In any thread."""
        asked: Future[ByteArray] = Future()
        with self._lock:
            if self._ended:
                asked.set_exception(_no_picture())
            else:
                self._asked.append(asked)
        return asked

    def picture(self) -> ByteArray:
        """(h, w, 3) uint8 sRGB, top row first: the last frame, without text."""
        return self._screen.read()

    def end(self) -> None:
        """Free everything on the GPU, the client's first. What is raised is kept."""
        if self._begun:
            self._begun = False
            for free in (self._stop_loading, self.client.release, self._free):
                with self.caught():
                    free()
        self.closing = True
        with self._lock:
            self._ended = True
            asked, self._asked = self._asked, []
        for future in asked:
            future.set_exception(_no_picture())

    def _fit(self, size: Size) -> None:
        if size == self._size:
            return
        first, self._size = self._size == (0, 0), size
        self.refresh(draw=True)
        if not first:
            self.client.on(Resize(*size))

    def _loaded(self) -> bool:
        """Whether everything is, after a spell of loading."""
        until = perf_counter() + SPELL
        for fraction in self._load:
            self._fraction = fraction
            if perf_counter() >= until:
                return False
        return True

    def _stop_loading(self) -> None:
        close = getattr(self._load, "close", None)  # a generator has it, another iterator need not
        if close is not None:
            close()

    def _show_loading(self) -> None:
        if self._backdrop is None:
            self._window.viewport = (0, 0, *self._size)
            self._window.use()
            self._window.clear(viewport=(0, 0, *self._size))
        else:
            if self._stale:
                self._screen.begin(self._size, (0.0, 0.0, 0.0))
                self._drawn = self._ctx.fbo
                self._backdrop(self._drawn, self._size)
                self._stale = False
            show(_color_of(self._drawn), self._window, self._size)
        draw_bar(self._window, self._size, self._fraction)
        self._overlay.write(self.client.overlay())
        self._overlay.draw(self._window, self._size)
        check(self._ctx)

    def _draw(self, seconds: float) -> None:
        self._screen.begin(self._size, (0.0, 0.0, 0.0))
        self.client.frame(self._ctx, self._ctx.fbo, self._size, seconds)
        self._pixels = self._screen.resolve()
        check(self._ctx)
        self._stale, self.shown = False, True

    def _answer(self) -> None:
        if not self._asked:
            return
        picture = self.picture()
        with self._lock:
            asked, self._asked = self._asked, []
        for future in asked:
            future.set_result(picture.copy())

    def _free(self) -> None:
        self._overlay.release()
        self._screen.release()
        _ = self._ctx.error  # of a frame that failed; pyglet would take it for its own


def _color_of(framebuffer: moderngl.Framebuffer) -> moderngl.Texture:
    color = framebuffer.color_attachments[0]
    assert isinstance(color, moderngl.Texture)
    return color


def _no_picture() -> UsageError:
    return UsageError("a picture of the window was asked for, and the window was closed before")
