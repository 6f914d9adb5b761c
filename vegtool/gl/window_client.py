"""What a window shows, and what it tells: the client's side of `gl/window.py`.

Nothing here knows which library makes windows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import moderngl
import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked

Context = moderngl.Context
Framebuffer = moderngl.Framebuffer
Modifiers = frozenset[str]
"""Of "shift", "ctrl", "alt" and "super": what was held."""


@dataclass(frozen=True)
class Key:
    """A key that was pressed, or let go. name: "h", "1", "escape", "left", "space", "f5", "shift".

    Both keys of a pair have one name, and so have a key and the same key of the keypad.
    """

    name: str
    pressed: bool = True
    modifiers: Modifiers = frozenset()


@dataclass(frozen=True)
class Drag:
    """The mouse moved while a button was held. right, up: pixels; button: "left", "middle" or
    "right", the first of these where several are held."""

    right: float
    up: float
    button: str = "left"
    modifiers: Modifiers = frozenset()


@dataclass(frozen=True)
class Scroll:
    """The mouse wheel. steps: up, away from the user."""

    steps: float


@dataclass(frozen=True)
class Resize:
    """The window has another size. width, height: pixels of the framebuffer, at least 1."""

    width: int
    height: int


Event = Key | Drag | Scroll | Resize


@dataclass(frozen=True, eq=False)
class Backdrop:
    """Ground that is shown while a client loads, drawn by pyrender; the mouse turns the view.

    positions: (v, 3) metres, y up; normals: (v, 3); faces: (f, 3). color: (3,) and sky: (3,), of
    the ground and above it, linear. sun: (3,) towards the sun. eye: (4, 4) from the camera's frame,
    x right, y up, looking along -z, to the world. fov_y: degrees.
    """

    positions: FloatArray
    normals: FloatArray
    faces: IntArray
    eye: FloatArray
    color: FloatArray = field(default_factory=lambda: np.array([0.10, 0.12, 0.05]))
    sky: FloatArray = field(default_factory=lambda: np.array([0.45, 0.60, 0.85]))
    sun: FloatArray = field(default_factory=lambda: np.array([0.4, 0.8, 0.4]))
    fov_y: float = 60.0

    def __post_init__(self) -> None:
        points = len(self.positions)
        shapes: dict[str, tuple[int | None, ...]] = {
            "positions": (None, 3), "normals": (points, 3), "eye": (4, 4),
            "color": (3,), "sky": (3,), "sun": (3,),
        }  # fmt: skip
        for name, shape in shapes.items():
            object.__setattr__(self, name, checked(name, getattr(self, name), shape, np.float64))
        object.__setattr__(self, "faces", checked("faces", self.faces, (None, 3), np.int32, points))


class Client(Protocol):
    """What a window shows. All is called in the window's thread, with its context current.

    Everything on the GPU has to be made with the `ctx` given: the context without a window
    (`context.context`) may not be used in that thread until the window is closed. What is raised
    closes the window and is raised again by what opened it.
    """

    def load(self, ctx: moderngl.Context) -> Iterator[float]:
        """Load bit by bit; what is yielded is the fraction done, 0 to 1. Between two bits the
        window answers and shows a bar; nothing is drawn before the last."""

    def frame(
        self,
        ctx: moderngl.Context,
        framebuffer: moderngl.Framebuffer,
        size: tuple[int, int],
        seconds: float,
    ) -> None:
        """Draw a frame: linear light, as in `draw.py`, over all of the framebuffer.

        framebuffer: in use and black, of `size` pixels: multisampled half-float colour, with depth
        and a depth test. seconds: since the last chance to draw, 0 for the first frame; what moves,
        moves by that much.
        """

    def overlay(self) -> str:
        """Lines of text to show at the upper left; "" for none."""

    def on(self, event: Event) -> None:
        """The user did something; a frame is drawn afterwards."""

    def moves(self) -> bool:
        """Whether the next frame differs from the last although nothing was done."""

    def wants_close(self) -> bool:
        """Whether to close the window; asked before each frame."""

    def release(self) -> None:
        """Free everything on the GPU; called once, also after an error."""
