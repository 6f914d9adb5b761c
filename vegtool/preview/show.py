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
from vegtool.preview.governor import BEGIN, step
from vegtool.preview.options import FadeMode
from vegtool.preview.palette import COLORS
from vegtool.preview.scenery import IN_FULL, FrameStats, Look, Place
from vegtool.preview.state import State, help_text, moved, pressed

MOVING = frozenset({"w", "a", "s", "d", "q", "e", "left", "right", "up", "down"})
"""Keys that move the eye while they are held."""
FRAMES_TOLD = 30
"""Frames whose mean time is shown."""
SKY = (float(BACKGROUND[0]), float(BACKGROUND[1]), float(BACKGROUND[2]))
PANELS = ("by distance", "in full", "difference")


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
        look = Look(state.light, state.distances, state.level, state.color, state.wireframe)
        if state.compare:
            self._compare(ctx, framebuffer, size, look)
        else:
            framebuffer.clear(*_behind(look), 1.0)
            self.stats = self.forest.draw(state.eye, size, look)
        if self.stats is not None:
            took = sum(s for part, s in self.stats.seconds.items() if part != "load")
            self._times = [*self._times[1 - FRAMES_TOLD :], took]
            if state.governor is not None:
                governor = step(state.governor, 1e3 * took, seconds or None)
                self.state = replace(self.state, governor=governor)

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
        if state.compare:
            lines.append(" | ".join(PANELS))
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

    def _compare(
        self,
        ctx: Context,
        framebuffer: Framebuffer,
        size: tuple[int, int],
        look: Look,
    ) -> None:
        """Three pictures beside each other: as it is drawn, in full, and how they differ."""
        if self._panels is None:
            self._panels = Panels(ctx)
        part = (max(size[0] // 3, 1), size[1])
        look = replace(look, color=COLORS[0])  # what is false cannot be compared
        full = replace(look, detail=IN_FULL, level=0)
        for index, one in enumerate((look, full)):
            self._panels.begin(index, part, _behind(one))
            drawn = self.forest.draw(self.state.eye, part, one)
            if index == 0:
                self.stats = drawn
            self._panels.end(index)
        framebuffer.use()
        self._panels.show(size)


def _behind(look: Look) -> tuple[float, float, float]:
    return (0.0, 0.0, 0.0) if look.color == "by overdraw" else SKY
