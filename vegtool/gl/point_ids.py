"""Which of many discs are seen from outside: each pixel of a picture tells the one that it shows.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 3.4: surfels of children are drawn in place of geometry.
"""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, checked
from vegtool.gl.context import check, context, framebuffer_kept
from vegtool.gl.program import program

MOST = 1 << 24
"""Discs that floats can number."""
AT_ONCE = 200_000
"""Discs that are drawn before they are waited for: software renderers hold a kilobyte of each."""
LARGEST = 0.5
"""Of the radius of them all: no disc counts as larger."""

WITHIN = 1.001
"""Of that radius: half the width of pictures, so that no middle is on their border."""


def seen_discs(
    position: FloatArray,
    normal: FloatArray,
    radius: FloatArray,
    axes: FloatArray,
    resolution: int,
) -> npt.NDArray[np.bool_]:
    """(n,) which discs are seen from any of m directions, orthographically.

    position: (n, 3) metres. normal: (n, 3) unit, of either side. radius: (n,) metres. axes: (m, 3,
    3), rows right, up and towards the eye. resolution: pixels along a side of the picture, which
    holds all, whatever the direction. A disc hides what is behind it by more than its radius; one
    that covers no pixel is as large as the pixel of its middle. Raises ValueError for more than
    MOST, CapabilityError where nothing can draw.
    """
    position = checked("position", position, (None, 3), np.float64)
    count = len(position)
    if count >= MOST:
        raise ValueError(f"seen_discs: expected fewer than {MOST:,}; got {count:,}")
    seen = np.zeros(count + 1, np.bool_)
    if not count:
        return seen[1:]
    low, high = position.min(axis=0), position.max(axis=0)
    whole = WITHIN * float(np.linalg.norm(high - low) / 2) or 1.0
    local = (position - (low + high) / 2) / whole
    size = np.minimum(radius / whole, LARGEST)
    rows = np.column_stack([local, normal, size]).astype(np.float32)
    ctx = context()
    with framebuffer_kept(ctx):
        image = ctx.texture((resolution, resolution), 1, dtype="f4")
        depth = ctx.depth_renderbuffer((resolution, resolution))
        frame = ctx.framebuffer([image], depth)
        vertices = ctx.buffer(np.ascontiguousarray(rows))
        shader = program(ctx, "point_id.vert", "point_id.frag")
        array = ctx.vertex_array(
            shader, [(vertices, "3f 3f 1f", "in_position", "in_normal", "in_radius")]
        )
        try:
            frame.use()
            ctx.enable_only(moderngl.DEPTH_TEST | moderngl.PROGRAM_POINT_SIZE)
            shader["pixels"] = float(resolution)
            for view in axes:
                frame.clear()
                shader["axes"] = tuple(view.T.ravel())
                for first in range(0, count, AT_ONCE):
                    array.render(moderngl.POINTS, min(AT_ONCE, count - first), first=first)
                    ctx.finish()
                told = np.frombuffer(image.read(), np.float32)
                seen[told.astype(np.int32)] = True
            check(ctx)
        finally:
            ctx.disable(moderngl.PROGRAM_POINT_SIZE)
            for one in (array, vertices, frame, image, depth):
                one.release()
    return seen[1:]
