"""`pyrender.Viewer` as the window of a stage. Importing this loads pyrender and pyglet.

pyrender's viewer draws its scene, and every one of its events moves its own camera or changes its
own flags. Here they go to the stage; the scene, with its trackball, is what is seen while a client
loads. Its renderer always draws into the window; here it draws into the stage's multisampled
framebuffer, and what else is drawn there shares its depth.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from platform import system
from time import perf_counter
from typing import Any

import moderngl
import numpy as np

from vegtool.arrays import unit
from vegtool.errors import CapabilityError, UsageError
from vegtool.gl.context import REQUIRED_VERSION, context
from vegtool.gl.window_client import Backdrop, Drag, Key, Scroll
from vegtool.gl.window_overlay import Size
from vegtool.gl.window_stage import Stage
from vegtool.srgb import srgb_from_linear


@contextmanager
def _glx_for_pyopengl() -> Iterator[None]:
    """PyOpenGL chooses its platform when imported, and takes Wayland's where it finds a session of
    that kind; pyglet's windows are X11's in each."""
    name = "PYOPENGL_PLATFORM"
    before = os.environ.get(name)
    if system() == "Linux":
        os.environ[name] = "glx"
    try:
        yield
    finally:
        os.environ.pop(name, None)
        if before is not None:
            os.environ[name] = before


with _glx_for_pyopengl():
    import OpenGL.contextdata
    import pyglet
    import pyrender
    from OpenGL.GL import GL_DRAW_FRAMEBUFFER, glBindFramebuffer

SAME_KEYS = {
    "lshift": "shift", "rshift": "shift", "lctrl": "ctrl", "rctrl": "ctrl",
    "lalt": "alt", "ralt": "alt", "loption": "alt", "roption": "alt",
    "lcommand": "super", "rcommand": "super", "lwindows": "super", "rwindows": "super",
    "lmeta": "super", "rmeta": "super", "return": "enter", "add": "plus", "subtract": "minus",
    "multiply": "asterisk", "divide": "slash", "decimal": "period", "separator": "comma",
    "page_up": "pageup", "prior": "pageup", "page_down": "pagedown", "next": "pagedown",
}  # fmt: skip
"""pyglet's name in small letters -> the plain one, where they differ."""
FAR = 20.0
"""Extents of a backdrop that its camera sees as far as."""
DEPTH_RATIO = 1e-4
"""Of the nearest distance that a backdrop's camera sees to the farthest."""
LIGHT = 3.0
"""Intensity of a backdrop's sun: pyrender's surfaces reflect a third of it."""

_window_open = threading.Lock()


class _FrameRenderer(pyrender.Renderer):  # type: ignore[misc]
    """pyrender's renderer, into the framebuffer whose name is `into`."""

    into = 0

    def _configure_forward_pass_viewport(self, flags: int) -> None:
        super()._configure_forward_pass_viewport(flags)
        glBindFramebuffer(GL_DRAW_FRAMEBUFFER, self.into)


class StageViewer(pyrender.Viewer):  # type: ignore[misc]
    """The window of a stage. threaded: opened and run in a thread of its own, at once.

    opened: set once it is open, or refused, and could not be. done: set once it is closed, or
    refused.
    """

    _renderer: Any  # pyrender's, until the window is open; None once it is shut

    def __init__(
        self,
        stage: Stage,
        title: str,
        size: Size,
        backdrop: Backdrop | None,
        rate: float | None,
        vsync: bool,
        threaded: bool,
    ) -> None:
        self.stage = stage
        self.opened, self.done = threading.Event(), threading.Event()
        self.running = self.refused = False
        self._stage_title, self._stage_rate, self._stage_vsync = title, rate, vsync
        self._stage_backdrop = backdrop
        self._stage_held: set[str] = set()
        self._stage_thread = 0
        self._stage_clock = 0.0
        self._stage_undo: Callable[[], None] | None = None
        super().__init__(
            _scene(backdrop), viewport_size=size, run_in_thread=threaded, auto_start=False
        )

    @staticmethod
    def check_display() -> None:
        """Raise CapabilityError where there is none."""
        try:
            pyglet.display.get_display()
        except Exception as error:  # each system has its own
            raise _cannot_open(error) from error

    # -- life: open, run, shut, all in one thread ------------------------------------------------

    def open(self) -> None:
        """Make the window and its context.

        Raises CapabilityError where there is no display or no OpenGL 3.3, UsageError where a window
        is open in this process.
        """
        if not _window_open.acquire(blocking=False):
            self.done.set()
            raise UsageError(
                "a window is open in this process, and only one can be: close it before the next"
            )
        self._stage_thread = threading.get_ident()
        self._stage_undo = _set_headless_aside()
        try:
            self._open()
        except BaseException as error:
            self.stage.fail(error)
            self.shut()
            self.stage.raise_failure()

    def run(self) -> None:
        """Show the stage until it closes, then shut. What is raised is kept in the stage."""
        self.running = True
        self._stage_clock = perf_counter()
        with self.stage.caught():
            self._schedule()
            try:
                pyglet.app.run(interval=None)
            finally:
                pyglet.clock.unschedule(self._tick)
        self.shut()

    def step(self, seconds: float) -> None:
        """Let the stage do what is to be done, and show it."""
        self.switch_to()
        width, height = self.get_framebuffer_size()
        if self.stage.step((max(width, 1), max(height, 1)), seconds):
            self.flip()

    def shut(self) -> None:
        """Free everything on the GPU and close the window; no more than that the second time."""
        stage = self.stage
        if self._stage_undo is None:
            return
        self.running = False
        if self._context is not None:
            for free in (self.switch_to, stage.end, self._free_scene, self.close):
                with stage.caught():
                    free()
        stage.end()
        self._stage_undo()
        self._stage_undo = None
        self._is_active = False
        _window_open.release()
        self.done.set()

    @property
    def in_its_thread(self) -> bool:
        """Whether this is called in the window's thread."""
        return threading.get_ident() == self._stage_thread

    def _init_and_start_app(self) -> None:
        """What pyrender's thread does."""
        try:
            self.open()
        except BaseException as error:
            self.stage.fail(error)
            self.refused = True
            return
        finally:
            self.opened.set()
        self.run()

    def _open(self) -> None:
        major, minor = divmod(REQUIRED_VERSION // 10, 10)
        config = pyglet.gl.Config(double_buffer=True, major_version=major, minor_version=minor)
        width, height = self._viewport_size
        try:
            pyglet.window.Window.__init__(
                self, width, height, self._stage_title, resizable=True, vsync=self._stage_vsync,
                config=config,
            )  # fmt: skip
            ctx = moderngl.create_context(require=REQUIRED_VERSION)
        except Exception as error:  # each system has its own
            raise _cannot_open(error) from error
        self._renderer.delete()
        self._renderer = _FrameRenderer(width, height)
        self._renderer.dpscale = 1  # sizes are those of framebuffers
        self.stage.begin(ctx, None if self._stage_backdrop is None else self._draw_scene)

    def _tick(self, _: float) -> None:
        stage, now = self.stage, perf_counter()
        seconds, self._stage_clock = now - self._stage_clock, now
        with stage.caught():
            loading = stage.loading
            if not stage.closing:
                self.step(seconds)
            if loading and not stage.loading:
                self._schedule()
        if stage.closing:
            pyglet.app.exit()

    def _schedule(self) -> None:
        """Look after the stage at its rate; at all times while the client loads."""
        pyglet.clock.unschedule(self._tick)
        if self._stage_rate is None or self.stage.loading:
            pyglet.clock.schedule(self._tick)
        else:
            pyglet.clock.schedule_interval(self._tick, 1.0 / self._stage_rate)

    def _draw_scene(self, framebuffer: moderngl.Framebuffer, size: Size) -> None:
        self._renderer.into = framebuffer.glo
        self._renderer.viewport_width, self._renderer.viewport_height = size
        self._trackball.resize(size)
        self._render()

    def _free_scene(self) -> None:
        renderer, self._renderer = self._renderer, None
        renderer.delete()
        OpenGL.contextdata.cleanupContext()

    # -- events, as pyglet calls them ------------------------------------------------------------

    def on_key_press(self, symbol: int, modifiers: int) -> None:
        name = key_name(symbol)
        self._stage_held.add(name)
        self.stage.event(Key(name, True, _held(modifiers)))

    def on_key_release(self, symbol: int, modifiers: int) -> None:
        name = key_name(symbol)
        self._stage_held.discard(name)
        self.stage.event(Key(name, False, _held(modifiers)))

    def on_deactivate(self) -> None:
        for name in sorted(self._stage_held):  # nobody tells when they are let go from now on
            self.stage.event(Key(name, False))
        self._stage_held.clear()

    def on_mouse_press(self, x: int, y: int, buttons: int, modifiers: int) -> None:
        if self._turns_scene:
            with self.stage.caught():
                super().on_mouse_press(x, y, buttons, modifiers)

    def on_mouse_release(self, x: int, y: int, button: int, modifiers: int) -> None:
        super().on_mouse_release(x, y, button, modifiers)

    def on_mouse_drag(self, x: int, y: int, dx: int, dy: int, buttons: int, modifiers: int) -> None:
        if not self._turns_scene:
            self.stage.event(Drag(dx, dy, _button(buttons), _held(modifiers)))
        elif self.viewer_flags["mouse_pressed"]:  # not where the button was pressed elsewhere
            with self.stage.caught():
                super().on_mouse_drag(x, y, dx, dy, buttons, modifiers)
                self.stage.refresh(draw=True)

    def on_mouse_scroll(self, x: int, y: int, dx: float, dy: float) -> None:
        if not self._turns_scene:
            self.stage.event(Scroll(dy))
            return
        with self.stage.caught():
            super().on_mouse_scroll(x, y, dx, dy)
            self.stage.refresh(draw=True)

    def on_resize(self, width: int, height: int) -> None:
        self.stage.refresh()

    def on_expose(self) -> None:
        self.stage.refresh()

    def on_draw(self) -> None:
        self.stage.refresh()

    def on_close(self) -> None:
        self.stage.closing = True

    @property
    def _turns_scene(self) -> bool:
        return self._stage_backdrop is not None and self.stage.loading


def key_name(symbol: int) -> str:
    """The plain name of one of pyglet's keys, as in `Key`."""
    name: str = pyglet.window.key.symbol_string(symbol).lower()
    name = name.removeprefix("_").removeprefix("num_")
    return SAME_KEYS.get(name, name)


def _held(modifiers: int) -> frozenset[str]:
    key = pyglet.window.key
    bits = {
        "shift": key.MOD_SHIFT,
        "ctrl": key.MOD_CTRL,
        "alt": key.MOD_ALT | key.MOD_OPTION,
        "super": key.MOD_COMMAND | key.MOD_WINDOWS,
    }
    return frozenset(name for name, bit in bits.items() if modifiers & bit)


def _button(buttons: int) -> str:
    mouse = pyglet.window.mouse
    bits = {"left": mouse.LEFT, "middle": mouse.MIDDLE, "right": mouse.RIGHT}
    return next((name for name, bit in bits.items() if buttons & bit), "left")


def _cannot_open(error: Exception) -> CapabilityError:
    found = f"{type(error).__name__}: {error}".rstrip(": ")
    if type(error).__name__ == "NoSuchDisplayException":
        name = os.environ.get("DISPLAY")
        found = f"DISPLAY is {name}, where none answers" if name else "DISPLAY is not set"
        return CapabilityError(
            f"a window needs a display, and none was found ({found}). Run this where there is one, "
            "or use --screenshot, which draws without a window."
        )
    return CapabilityError(
        f"a window with OpenGL 3.3 is needed and could not be opened ({found}). Update the "
        "graphics driver, or use --screenshot, which draws without a window."
    )


def _set_headless_aside() -> Callable[[], None]:
    """Let go of the context without a window, if this thread draws in it; returns what takes it
    back. GLX refuses a thread in which EGL's is current, and says nothing."""
    if system() != "Linux":
        return _take_back
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return _nothing
    for ask in (egl.eglGetCurrentContext, egl.eglGetCurrentDisplay, egl.eglGetCurrentSurface):
        ask.restype = ctypes.c_void_p
    current = egl.eglGetCurrentContext()
    if not current:
        return _nothing
    draw, read = (egl.eglGetCurrentSurface(which) for which in (0x3059, 0x305A))
    display, *kept = map(ctypes.c_void_p, (egl.eglGetCurrentDisplay(), draw, read, current))
    egl.eglMakeCurrent(display, None, None, None)
    return lambda: egl.eglMakeCurrent(display, *kept)


def _take_back() -> None:
    main = threading.current_thread() is threading.main_thread()
    if main and context.cache_info().currsize:
        context().__enter__()  # type: ignore[no-untyped-call]


def _nothing() -> None:
    pass


def _scene(backdrop: Backdrop | None) -> Any:
    """pyrender's scene of a backdrop: a mesh, a sun, a camera. Arrays are copied."""
    if backdrop is None:
        return pyrender.Scene()
    sky = backdrop.sky.clip(0.0, 1.0)
    scene = pyrender.Scene(bg_color=[*srgb_from_linear(sky), 1.0], ambient_light=0.3 * sky)
    material = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=[*backdrop.color, 1.0], metallicFactor=0.0, roughnessFactor=1.0
    )
    ground = pyrender.Primitive(
        backdrop.positions.astype(np.float32),
        normals=backdrop.normals.astype(np.float32),
        indices=backdrop.faces.astype(np.uint32),
        material=material,
    )
    scene.add(pyrender.Mesh([ground]))
    scene.add(pyrender.DirectionalLight(intensity=LIGHT), pose=_towards(backdrop.sun))
    far = FAR * (scene.scale or 1.0)
    camera = pyrender.PerspectiveCamera(
        np.radians(backdrop.fov_y), znear=DEPTH_RATIO * far, zfar=far
    )
    scene.add(camera, pose=np.array(backdrop.eye))
    return scene


def _towards(sun: np.ndarray) -> np.ndarray:
    """(4, 4) the pose of a light that shines along its -z, away from the sun."""
    back = unit(np.asarray(sun)[None])[0]
    right = unit(np.cross([[0.0, 1.0, 0.0] if abs(back[1]) < 0.9 else [1.0, 0.0, 0.0]], back))[0]
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    return pose
