"""A preview without a window: pictures, figures and films, for tests and servers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from time import perf_counter
from typing import Any

import numpy as np

from vegtool.arrays import ByteArray
from vegtool.gl.context import context, framebuffer_kept
from vegtool.gl.screen import Screen
from vegtool.preview.eye import Eye
from vegtool.preview.governor import LONGEST_STEP_S, MEDIAN_FRAMES, Governor
from vegtool.preview.show import SKY, Show
from vegtool.preview.size_control import SizeControl
from vegtool.progress import Progress, silent

SETTLING = 256
"""Frames, at most, until the detail is found at which a rate can be held."""


@contextmanager
def loaded(show: Show, progress: Progress = silent) -> Iterator[Screen]:
    """A show ready to be drawn without a window, and the screen to draw it into."""
    with ExitStack() as stack:
        ctx = context()
        stack.enter_context(framebuffer_kept(ctx))
        screen = stack.enter_context(Screen(ctx))
        stack.callback(show.release)
        for done in show.load(screen.ctx):
            progress("loading", done)
        yield screen


def frames(
    show: Show,
    screen: Screen,
    size: tuple[int, int],
    eyes: Sequence[Eye],
    fps: float,
    progress: Progress = silent,
) -> Iterator[ByteArray]:
    """(h, w, 3) uint8 sRGB of each eye, in order, as time goes on."""
    for index, eye in enumerate(eyes):
        show.look_from(eye)
        screen.begin(size, SKY)
        show.frame(screen.ctx, screen.ctx.fbo, size, 1 / fps if index else 0.0)
        screen.resolve()
        yield screen.read()
        progress("frames", (index + 1) / len(eyes))


def settle(
    show: Show,
    screen: Screen,
    size: tuple[int, int],
    eye: Eye,
    progress: Progress = silent,
) -> None:
    """Where frames are held at a time, find the detail at which they are; else nothing."""
    for index in range(SETTLING):
        governor = show.state.governor
        if governor is None or (index > MEDIAN_FRAMES and _settled(governor)):
            break
        show.look_from(eye)
        screen.begin(size, SKY)
        show.frame(screen.ctx, screen.ctx.fbo, size, LONGEST_STEP_S)
        progress("finding what can be drawn in time", (index + 1) / SETTLING)


def _settled(governor: Governor | SizeControl) -> bool:
    if isinstance(governor, SizeControl):
        return governor.resting
    return not governor.correcting or governor.detail == governor.most


def timed_frames(
    show: Show, screen: Screen, size: tuple[int, int], eyes: Sequence[Eye], fps: float,
    progress: Progress = silent,
) -> list[dict[str, Any]]:  # fmt: skip
    """What each frame took and showed; nothing is read back."""
    rows = []
    for index, eye in enumerate(eyes):
        show.look_from(eye)
        started = perf_counter()
        screen.begin(size, SKY)
        show.frame(screen.ctx, screen.ctx.fbo, size, 1 / fps if index else 0.0)
        screen.resolve()
        screen.ctx.finish()
        rows.append(frame_row(show, perf_counter() - started))
        progress("frames", (index + 1) / len(eyes))
    return rows


def frame_row(show: Show, seconds: float) -> dict[str, Any]:
    """A frame's figures as plain values."""
    stats = show.stats
    assert stats is not None
    return {
        "ms": round(1e3 * seconds, 3),
        **{f"{name}_ms": round(1e3 * s, 3) for name, s in stats.seconds.items()},
        "tiles": stats.tiles,
        "plants": stats.plants,
        "levels": stats.rows,
        "draws": stats.draws,
        "triangles": stats.triangles,
        "fragments": stats.fragments,
        "detail": round(stats.detail, 4),
    }


def summary(show: Show, rows: Sequence[dict[str, Any]], size: tuple[int, int]) -> dict[str, Any]:
    """The figures of all frames: medians, the worst time, and each frame."""
    times = np.array([row["ms"] for row in rows])
    return {
        "size": list(size),
        "frames": len(rows),
        "plants_total": show.forest.total,
        "texture_bytes": show.forest.texture_bytes,
        "median_ms": round(float(np.median(times)), 3),
        "worst_ms": round(float(times.max()), 3),
        "median_fps": round(1e3 / float(np.median(times)), 2),
        "worst_fps": round(1e3 / float(times.max()), 2),
        "median_plants": int(np.median([row["plants"] for row in rows])),
        "median_triangles": int(np.median([row["triangles"] for row in rows])),
        "rows": list(rows),
    }
