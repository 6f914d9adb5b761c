"""A display that shows nothing to anyone: X in memory, started for tests of windows.

Each test of a window runs in a process of its own: a window library keeps its connection to a
display until the process ends, and X ends a process whose display has gone.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import shutil
import subprocess
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import pytest

from vegtool.arrays import ByteArray

SCREEN = "1280x1024x24"
LIMIT = 60
"""Seconds after which a test of a window has failed."""


@contextmanager
def display() -> Iterator[str]:
    """A display with a free number, as in $DISPLAY; skips where there is no Xvfb."""
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb: install xvfb (scripts/test does), for windows that nobody sees")
    told, tells = os.pipe()
    command = ["Xvfb", "-displayfd", str(tells), "-screen", "0", SCREEN, "-noreset"]
    server = subprocess.Popen(
        [*command, "-nolisten", "tcp"], pass_fds=[tells], stderr=subprocess.DEVNULL
    )
    os.close(tells)
    try:
        with os.fdopen(told) as pipe:
            number = pipe.readline().strip()
        assert number, "Xvfb has not started"
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


def alone(
    test: Callable[..., None], *arguments: object, environment: dict[str, str | None]
) -> None:
    """Run a test function of a module in a process of its own, in which warnings are errors.

    environment: variables to set, or with None to unset.
    """
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe(duplex=False)
    child = spawn.Process(target=_run, args=(there, environment, test, arguments))
    child.start()
    there.close()
    try:
        if not here.poll(LIMIT):
            pytest.fail(f"not done after {LIMIT} s")
        failure = here.recv()
    except EOFError:
        failure = "the process ended before the test did"
    finally:
        child.join(5)
        child.kill()
    if failure:
        pytest.fail(failure, pytrace=False)
    assert child.exitcode == 0, f"the process ended with {child.exitcode}"


def _run(
    pipe: Connection,
    environment: dict[str, str | None],
    test: Callable[..., None],
    arguments: tuple[object, ...],
) -> None:
    for name, value in environment.items():
        os.environ.pop(name, None)
        if value is not None:
            os.environ[name] = value
    import vegtool.gl.window_viewer  # noqa: F401 - what others warn of when loaded is theirs

    warnings.simplefilter("error")
    try:
        test(*arguments)
    except BaseException:
        pipe.send(traceback.format_exc())
    else:
        pipe.send(None)
    sys.stdout.flush()


# -- in the process of a test, in the window's thread ---------------------------------------------


def the_window() -> Any:
    """pyglet's window, the one that is open."""
    import pyglet

    (window,) = pyglet.app.windows
    return window


def seen() -> ByteArray:
    """(h, w, 3) uint8: what the display shows of the window, asked of X itself."""
    from pyglet.libs.x11 import xlib

    window = the_window()
    width, height = window.get_size()
    image = xlib.XGetImage(
        window.display._display, window._window, 0, 0, width, height, 2**32 - 1, xlib.ZPixmap
    ).contents
    data = ctypes.c_void_p.from_buffer(image, xlib.XImage.data.offset)  # it may hold zeros
    rows = ctypes.string_at(data, image.bytes_per_line * height)
    pixels = np.frombuffer(rows, np.uint8).reshape(height, image.bytes_per_line)
    return pixels[:, : 4 * width].reshape(height, width, 4)[..., 2::-1]


def strike(key: str, *, press: bool = True) -> None:
    """Send the window an X event: a key, by X's name for it, was pressed or let go."""
    from pyglet.libs.x11 import xlib

    window = the_window()
    display = window.display._display
    event = xlib.XEvent()
    event.xkey.type = xlib.KeyPress if press else xlib.KeyRelease
    event.xkey.display, event.xkey.window = display, window._window
    event.xkey.keycode = xlib.XKeysymToKeycode(display, xlib.XStringToKeysym(key.encode()))
    event.xkey.same_screen = True
    xlib.XSendEvent(display, window._window, True, xlib.KeyPressMask, ctypes.byref(event))
    xlib.XFlush(display)
