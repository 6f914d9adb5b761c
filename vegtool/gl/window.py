"""A window that shows what a client draws, made of `pyrender.Viewer`.

pyrender's are the window, its event loop and thread, and, while the client loads, ground, light and
a camera that the mouse turns. Frames are the client's: drawn by moderngl in the window's context
into our own multisampled framebuffer (`screen.py`), and so the same as without a window. What
pyrender draws could be drawn into the same framebuffer, and share its depth (`window_viewer.py`);
frames are not, for two reasons, measured with Mesa's software rasteriser on two cores at 1024 x 768
with four samples a pixel and ground over half of the picture:

- pyrender takes 84 ms for the ground, a plain program 19 ms (medians), and a window that is itself
  multisampled, which pyrender asks for, 6 ms to show where this one takes 0.5 ms.
- pyrender raises colours to 1 / 2.2, which is up to 9/255 from sRGB, before samples are averaged;
  along edges its window and its own picture without a window differ by up to 106/255.
"""

from __future__ import annotations

from platform import system
from types import TracebackType
from typing import TYPE_CHECKING, Self

from vegtool.arrays import ByteArray
from vegtool.errors import CapabilityError, UsageError
from vegtool.gl.context import check, context, framebuffer_kept
from vegtool.gl.screen import Screen
from vegtool.gl.window_client import Backdrop, Client, Drag, Event, Key, Resize, Scroll
from vegtool.gl.window_stage import Stage

if TYPE_CHECKING:
    from vegtool.gl.window_viewer import StageViewer

__all__ = [
    "RATE", "Backdrop", "Client", "Drag", "Event", "Key", "Resize", "Scroll", "Window",
    "check_display", "headless_picture", "open_window",
]  # fmt: skip

RATE = 60.0
"""Frames per second, at most."""


class Window:
    """An open window. A context manager: leaving closes it.

    What a client raises closes the window, and is raised again, once, by the next of these methods.
    """

    def __init__(self, stage: Stage, viewer: StageViewer, threaded: bool) -> None:
        self._stage, self._viewer, self._threaded = stage, viewer, threaded

    @property
    def closed(self) -> bool:
        """Whether it is closed, and everything freed."""
        return self._viewer.done.is_set()

    def run(self) -> None:
        """Show the client's frames until the window is closed.

        Raises UsageError in another thread than the one that opened the window.
        """
        viewer = self._viewer
        if not self._threaded and not self.closed:
            if not viewer.in_its_thread:
                raise UsageError("a window runs in the thread that opened it; this is another")
            viewer.run()
        self.wait()

    def wait(self) -> None:
        """Wait until the window is closed; where that is interrupted, it closes."""
        if not self._viewer.in_its_thread:
            try:
                self._viewer.done.wait()
            except BaseException:
                self._stage.closing = True
                raise
        self._raise()

    def close(self) -> None:
        """Close the window and wait until it is closed; nothing where it is.

        Called by the client itself, it closes after the call; in another thread than the one that
        will run it, once it runs.
        """
        stage, viewer = self._stage, self._viewer
        stage.closing = True
        if viewer.in_its_thread:
            if viewer.running:
                return
            viewer.shut()
        elif self._threaded or viewer.running:
            viewer.done.wait()
        self._raise()

    def screenshot(self) -> ByteArray:
        """(h, w, 3) uint8 sRGB, top row first: the client's last frame, without text.

        Waits for the first frame. Raises UsageError where the window is closed before it.
        """
        stage, viewer = self._stage, self._viewer
        if self.closed or not viewer.in_its_thread:
            asked = stage.ask()
            try:
                return asked.result()
            except UsageError:
                self.wait()
                raise
        while not stage.shown and not stage.closing:
            viewer.step(0.0)
        return stage.picture()

    def _raise(self) -> None:
        """Raise what was raised, where nobody else will: `run` does in a window's own thread."""
        if self._threaded or self._viewer.in_its_thread:
            self._stage.raise_failure()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def open_window(
    client: Client,
    title: str,
    size: tuple[int, int],
    *,
    threaded: bool = False,
    backdrop: Backdrop | None = None,
    rate: float | None = RATE,
    vsync: bool = True,
) -> Window:
    """Open a window; `run` then shows what the client draws.

    size: width and height of the framebuffer in pixels, on screens of plain density. threaded: show
    it at once, in a thread of its own, which macOS does not allow. backdrop: what is seen while the
    client loads. rate: most frames per second, None for as many as there can be; frames are drawn
    only where something moves or was done. vsync: show frames as the screen is refreshed.

    Raises CapabilityError where there is no display, no OpenGL 3.3 or no pyrender, UsageError where
    a window is open in this process. The client is told to release what it loaded in every case.
    """
    if threaded and system() == "Darwin":
        raise CapabilityError(
            "macOS allows windows in a program's main thread only: open this one without threaded"
        )
    if rate is not None and not rate > 0:
        raise UsageError(f"rate: expected more than 0 frames per second, or None; got {rate}")
    viewer_class = _viewer_class()
    stage = Stage(client)
    viewer = viewer_class(stage, title, size, backdrop, rate, vsync, threaded)
    if threaded:
        viewer.opened.wait()
        if viewer.refused:
            stage.raise_failure()
    else:
        viewer.open()
    return Window(stage, viewer, threaded)


def check_display() -> None:
    """Raise CapabilityError where there is no display or no pyrender, as `open_window` would: to be
    asked before long work."""
    _viewer_class().check_display()


def headless_picture(client: Client, size: tuple[int, int]) -> ByteArray:
    """(h, w, 3) uint8 sRGB, top row first: a client's first frame, without a window.

    Raises CapabilityError where there is no OpenGL 3.3.
    """
    ctx = context()
    with framebuffer_kept(ctx), Screen(ctx) as screen:
        try:
            for _ in client.load(ctx):
                pass
            screen.begin(size, (0.0, 0.0, 0.0))
            client.frame(ctx, ctx.fbo, size, 0.0)
            screen.resolve()
            check(ctx)
            return screen.read()
        finally:
            client.release()


def _viewer_class() -> type[StageViewer]:
    try:
        from vegtool.gl.window_viewer import StageViewer
    except ImportError as error:  # of pyrender itself, or of a system library that it loads
        raise CapabilityError(
            f"a window needs pyrender and the system's libraries for windows ({error}). Install "
            "them with: pip install pyrender-maintained, and on Linux the packages of libGL and "
            "libX11; or use --screenshot, which draws without a window."
        ) from error
    return StageViewer
