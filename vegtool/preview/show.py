"""What a window shows, and what is drawn without one: a world, and what the viewer does in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from vegtool.gl.panels import Panels
from vegtool.gl.window_client import Context, Drag, Event, Framebuffer, Key, Scroll
from vegtool.measure.background import BACKGROUND
from vegtool.preview.controls import Fly, Input, orbiting
from vegtool.preview.eye import Eye
from vegtool.preview.fovea import Fovea
from vegtool.preview.governor import BEGIN, Governor, step
from vegtool.preview.options import FadeMode
from vegtool.preview.palette import COLORS
from vegtool.preview.scenery import IN_FULL, FrameStats, Look, Place
from vegtool.preview.size_control import step as sized
from vegtool.preview.state import State, help_text, moved, pressed

MOVING = frozenset({"w", "a", "s", "d", "q", "e", "left", "right", "up", "down"})
"""Keys that move the eye while they are held."""
FRAMES_TOLD = 30
"""Frames whose mean time is shown."""
SKY = (float(BACKGROUND[0]), float(BACKGROUND[1]), float(BACKGROUND[2]))
PANELS = ("by distance", "in full", "difference")
EYES = ("left eye", "right eye")
EYES_APART_M = 0.064
"""Between two eyes: what most headsets begin with, a few millimetres from most people's."""


class Keeper(Protocol):
    """Keeps what the user wants kept of a walk."""

    def picture(self) -> None:
        """Keep what is shown."""

    def way(self, walked: Sequence[tuple[Eye, float]]) -> None:
        """Keep a way: the eye at each frame, and when, seconds."""


class Show:
    """A client of gl.window: draws the world as the state says, and changes the state as the user
    says. way: each frame's eye and its time, while a way is recorded. keeper: keeps pictures and
    ways, or None.
    """

    def __init__(self, world: Place, state: State, fade: FadeMode = "alpha-test") -> None:
        self.world, self.state = world, state
        self.forest = world.scenery(fade)
        self.stats: FrameStats | None = None
        self.way: list[tuple[Eye, float]] = []
        self.keeper: Keeper | None = None
        self._pictures = 0
        self._held: set[str] = set()
        self._drag = np.zeros(2)
        self._scroll = 0.0
        self._clock = 0.0
        self._times: list[float] = []
        self._panels: Panels | None = None
        self._followed: tuple[Eye, ...] = ()
        self._rate = self._at = 0.0

    def load(self, ctx: Context) -> Iterator[float]:
        """Bring everything onto the GPU."""
        return self.forest.load(ctx)

    def frame(
        self,
        ctx: Context,
        framebuffer: Framebuffer,
        size: tuple[int, int],
        seconds: float,
    ) -> None:
        """Move on by so many seconds, and draw."""
        self._move(seconds)
        state = self.state
        look = Look(
            state.light, state.distances, state.level, state.color, state.wireframe,
            state.surfel_px, Fovea() if state.stereo else None,
        )  # fmt: skip
        if state.compare:
            look = replace(look, color=COLORS[0])  # what is false cannot be compared
            full = replace(look, detail=IN_FULL, level=0, surfel_px=1.0)
            drawn = [(state.eye, look), (state.eye, full)]
            self.stats = self._side_by_side(ctx, framebuffer, size, max(size[0] // 3, 1), drawn)[0]
        elif state.stereo:
            drawn = [(eye, look) for eye in two_eyes(state.eye)]
            both = self._side_by_side(ctx, framebuffer, size, (size[0] + 1) // 2, drawn)
            self.stats = of_both(*both)
        else:
            framebuffer.clear(*_behind(look), 1.0)
            self.stats = self.forest.draw(state.eye, size, look)
        if self.stats is not None:
            took = sum(s for part, s in self.stats.seconds.items() if part != "load")
            self._times = [*self._times[1 - FRAMES_TOLD :], took]
            if isinstance(state.governor, Governor):
                governor = step(state.governor, 1e3 * took, seconds or None)
                self.state = replace(self.state, governor=governor)
            elif state.governor is not None:
                self.state = replace(self.state, governor=sized(state.governor, 1e3 * took))

    def overlay(self) -> str:
        """Figures and help."""
        parts = []
        if self.state.told and self.stats is not None:
            parts.append(self.figures())
        if self.state.help:
            parts.append(help_text())
        return "\n\n".join(parts)

    def figures(self) -> str:
        """The heads-up display: what the last frames took."""
        stats, state = self.stats, self.state
        assert stats is not None
        mean = float(np.mean(self._times))
        parts = ", ".join(f"{name} {1e3 * s:.1f}" for name, s in stats.seconds.items())
        lines = [
            f"{1 / mean:.1f} fps, {1e3 * mean:.1f} ms ({parts})",
            f"{stats.plants:,} of {stats.total:,} plants, {stats.tiles:,} tiles",
            f"{stats.draws:,} draws, {stats.triangles:,} triangles, {stats.fragments:,} fragments",
            *stats.said,
            f"{self.forest.texture_bytes / 1e6:.1f} MB of textures",
            f"detail {stats.detail:.3f}"
            + (
                f", holding {1e3 / state.governor.target_ms / (1 + BEGIN):.3g} fps"
                if state.governor
                else ""
            ),
        ]
        if state.level is not None:
            lines.append(f"level {state.level} held")
        if state.color != COLORS[0]:
            lines.append(state.color)
        if self.world.progressive:
            lines.append(f"surfels of {state.surfel_px:.2f} pixels")
        if state.compare:
            lines.append(" | ".join(PANELS))
        if state.stereo:
            lines.append(" | ".join(EYES))
        if state.recording:
            lines.append(f"recording: {len(self.way)} frames")
        return "\n".join([*lines, "h: help"])

    def on(self, event: Event) -> None:
        """Keys and mouse."""
        if isinstance(event, Key):
            name = event.name.lower()
            if event.pressed:
                self._held.add(name)
                if not self.state.recording and name == "r":
                    self.keep_way()
                self.state = pressed(self.state, name)
            else:
                self._held.discard(name)
        elif isinstance(event, Drag):
            self._drag += (event.right, -event.up)
        elif isinstance(event, Scroll):
            self._scroll += event.steps

    def moves(self) -> bool:
        """Whether anything goes on by itself."""
        going_on = self.state.governor is not None or self.state.recording
        return bool(self._held & MOVING or self._followed) or going_on

    def wants_close(self) -> bool:
        """Whether the user has enough; what is to be kept of the last frame is kept before."""
        if self.stats is not None and self.keeper is not None:
            if self.state.screenshots != self._pictures:
                self._pictures = self.state.screenshots
                self.keeper.picture()
            if not self.state.recording:
                self.keep_way()
        return self.state.closing

    def keep_way(self) -> None:
        """Keep what was recorded, if anything was and is not kept yet."""
        way, self.way = self.way, []
        if way and self.keeper is not None:
            self.keeper.way(way)

    def release(self) -> None:
        """Free everything on the GPU."""
        self.forest.release()
        if self._panels is not None:
            self._panels.release()
            self._panels = None

    def look_from(self, eye: Eye) -> None:
        """Put the eye somewhere."""
        camera = self.state.camera
        if isinstance(camera, Fly):
            self.state = replace(self.state, camera=replace(camera, eye=eye))
        else:
            there = orbiting(eye, camera.target, camera.limits_m)
            self.state = replace(self.state, camera=there)

    def follow(self, eyes: Sequence[Eye], fps: float) -> None:
        """Walk along a way by itself, again and again, until a key moves the eye."""
        self._followed, self._rate, self._at = tuple(eyes), fps, 0.0

    def _move(self, seconds: float) -> None:
        if self._followed and not self._held & MOVING:
            self._at += seconds * self._rate
            self.look_from(self._followed[int(self._at) % len(self._followed)])
        else:
            self._followed = ()
        given = Input(
            frozenset(self._held), (float(self._drag[0]), float(self._drag[1])), self._scroll
        )
        self._drag[:], self._scroll = 0.0, 0.0
        self.state = moved(self.state, given, seconds)
        self._clock += seconds
        if self.state.recording:
            self.way.append((self.state.eye, self._clock))

    def _side_by_side(
        self, ctx: Context, framebuffer: Framebuffer, size: tuple[int, int], width: int,
        drawn: Sequence[tuple[Eye, Look]],
    ) -> list[FrameStats]:  # fmt: skip
        """Two pictures of a width beside each other, and how they differ as far as there is room
        for that; what each took."""
        if self._panels is None:
            self._panels = Panels(ctx)
        found = []
        for index, (eye, look) in enumerate(drawn):
            self._panels.begin(index, (width, size[1]), _behind(look))
            found.append(self.forest.draw(eye, (width, size[1]), look))
            self._panels.end(index)
        framebuffer.use()
        self._panels.show(size)
        return found


def two_eyes(middle: Eye) -> tuple[Eye, Eye]:
    """The left and the right eye, which look along parallel axes."""
    aside = EYES_APART_M / 2 * middle.axes[0]
    left, right = middle.position - aside, middle.position + aside
    return replace(middle, position=left), replace(middle, position=right)


def of_both(left: FrameStats, right: FrameStats) -> FrameStats:
    """What two eyes' pictures took together; plants and tiles as of the one that sees more."""
    said = zip(EYES, (left.said, right.said), strict=True)
    return replace(
        left,
        tiles=max(left.tiles, right.tiles),
        plants=max(left.plants, right.plants),
        rows=left.rows + right.rows,
        draws=left.draws + right.draws,
        triangles=left.triangles + right.triangles,
        fragments=left.fragments + right.fragments,
        seconds={part: s + right.seconds.get(part, 0.0) for part, s in left.seconds.items()},
        said=tuple(f"{eye}: {line}" for eye, lines in said for line in lines),
    )


def _behind(look: Look) -> tuple[float, float, float]:
    return (0.0, 0.0, 0.0) if look.color == "by overdraw" else SKY
