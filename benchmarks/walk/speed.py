"""How fast a walk is drawn, how much of the landscape is shown, and in how much memory.

A frame is everything from the choice of what is drawn to the resolved picture, finished and not
read back. The eye stands at its first view until detail has settled (frames that are not counted),
then walks; what comes into view on the way is made ready within the frames. Every walk has a
process of its own, whose peak memory is told.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from vegtool.gl.screen import Screen
from vegtool.preview.choice import frame
from vegtool.preview.drawn import show_of
from vegtool.preview.eye import Eye
from vegtool.preview.options import PreviewOptions
from vegtool.preview.run import loaded, settle
from vegtool.preview.scenery import IN_FULL, Look
from vegtool.preview.show import SKY, Show
from walk.path import evenly, views_of
from walk.scenes import (
    SETTINGS,
    plants_in,
    scene_of,
    with_crossed,
    with_originals,
    world_of,
)
from walk.vertices import Counts, counts_of, vertices_in

SIZE = (1024, 768)
FIRST = 3
"""Frames that are not counted before any walk; more, where detail has to settle first."""

LEVELS, CROSSED, GEOMETRY = "levels", "crossed", "geometry"


@dataclass(frozen=True)
class Walk:
    """What is drawn: LEVELS at the detail that holds `fps`, or, where that is 0, at detail 1;
    CROSSED, two billboards for every plant in view; GEOMETRY, every plant in view in full."""

    scene: str
    drawn: str
    fps: float = 0.0

    @property
    def name(self) -> str:
        """In tables."""
        if self.drawn != LEVELS:
            return self.drawn
        return f"levels, {self.fps:g} fps held" if self.fps else "levels, detail 1"


@dataclass(frozen=True)
class Walked:
    """Medians over `frames` frames, and the worst one. seconds: of the median frame. plants:
    displayed, of `total`. peak_mb: of the whole process."""

    walk: Walk
    frames: int
    seconds: float
    worst: float
    plants: int
    total: int
    triangles: int
    vertices: int
    detail: float
    peak_mb: int

    @property
    def fps(self) -> float:
        """Of the median frame."""
        return 1 / self.seconds

    @property
    def worst_fps(self) -> float:
        """Of the worst frame."""
        return 1 / self.worst


def alone(function: Callable[..., Any], *given: object) -> Any:
    """What a function returns in a process of its own, which begins with it and ends with it."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(function, *given).result()


def walked(walk: Walk, cache: Path, views: int) -> Walked:
    """Walk once: `views` of the views. Plants and scene are there already."""
    setting = SETTINGS[walk.scene]
    world = world_of(setting, cache, print)
    way = views_of(setting, world, scene_of(setting, cache, print).parent)
    way = [way[i] for i in evenly(len(way), views)]
    if walk.drawn == CROSSED:
        world = with_crossed(world)
    elif walk.drawn == GEOMETRY:
        world, way = with_originals(world), way[len(way) // 2 :][:1]
    show = show_of(world, PreviewOptions(fps=walk.fps))
    if walk.drawn != LEVELS:
        show.state = replace(show.state, detail=IN_FULL, level=0)
    with loaded(show) as screen:
        settle(show, screen, SIZE, way[0])
        seconds = 0.0
        for _ in range(0 if walk.drawn == GEOMETRY else FIRST):
            seconds = _drawn(show, screen, way[0], seconds)
        counts, rows = counts_of(world.species), []
        for eye in way:
            detail = show.state.distances
            seconds = _drawn(show, screen, eye, seconds)
            assert show.stats is not None
            rows.append((seconds, show.stats.plants, show.stats.triangles,
                         _vertices(show, eye, detail, counts), detail))  # fmt: skip
    times = [row[0] for row in rows]
    middle = [float(v) for v in np.median(np.array(rows), axis=0)]
    plants, triangles, vertices = (int(v) for v in middle[1:4])
    return Walked(
        walk, len(rows), middle[0], max(times), plants, plants_in(world.placement), triangles,
        vertices, middle[4], peak_mb(),
    )  # fmt: skip


def _drawn(show: Show, screen: Screen, eye: Eye, before: float) -> float:
    """Seconds of a frame. before: of the one before it."""
    show.look_from(eye)
    started = perf_counter()
    screen.begin(SIZE, SKY)
    show.frame(screen.ctx, screen.ctx.fbo, SIZE, before)
    screen.resolve()
    screen.ctx.finish()
    return perf_counter() - started


def _vertices(show: Show, eye: Eye, detail: float, counts: list[Counts]) -> int:
    found, what, _ = show.forest.choose(eye, SIZE, Look(detail=detail, level=show.state.level))
    return vertices_in(frame(found, what), counts)


def peak_mb() -> int:
    """Most megabytes that this process has held."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux counts the parent's memory in ru_maxrss
        return int(status.read_text().split("VmHWM:")[1].split()[0]) // 1000
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 10**6
