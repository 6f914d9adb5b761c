"""How long frames take that are drawn as a client draws them."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import moderngl
import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.draw import Shot, draw_tile, tiles
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light

WARM_UP = 2
"""Frames drawn first and not counted: programs are compiled, buffers uploaded."""


def time_frames(
    buffers: PlantBuffers, shot: Shot, light: Light, samples: int, repeats: int
) -> FloatArray:
    """(repeats,) seconds per frame, each finished by the GPU and none read back.

    samples: of multisampling. Raises CapabilityError as `draw` does.
    """
    return time_rendered(
        buffers.ctx, shot, lambda part: draw_tile((buffers,), part, light, 1, samples), repeats
    )


def time_rendered(
    ctx: moderngl.Context, shot: Shot, render: Callable[[Shot], object], repeats: int
) -> FloatArray:
    """The same of anything that is rendered of a shot, part by part."""
    seconds = np.empty(WARM_UP + repeats)
    with framebuffer_kept(ctx):
        for i in range(len(seconds)):
            since = perf_counter()
            for _, _, part in tiles(ctx, shot, 1):
                render(part)
            ctx.finish()
            seconds[i] = perf_counter() - since
        check(ctx)
    return seconds[WARM_UP:]
