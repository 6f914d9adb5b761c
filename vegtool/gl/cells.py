"""How much of a rectangle do triangles cover? Many rectangles at once, one read-back for all.

Holst, Schumann: Surfel-based billboard hierarchies (2007), eq. 14.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.gl.context import check, context, framebuffer_kept
from vegtool.gl.program import program

SIDE = 16
"""Samples along each side of a rectangle."""
PER_ROW = 128
MOST = PER_ROW * 128
"""Rectangles of one picture."""


def covered(corners: FloatArray, cell: npt.NDArray[np.integer], count: int) -> FloatArray:
    """(count,) 0 to 1: the share of the samples that triangles cover. Raises CapabilityError where
    there is no OpenGL.

    corners: (t, 3, 2), -1 to 1 from side to side of the rectangle. cell: (t,) which rectangle of
    `count`, rising.
    """
    found = np.zeros(count)
    ends = np.searchsorted(cell, np.arange(0, count + MOST, MOST))
    for nth, (begin, end) in enumerate(pairwise(ends)):
        first = nth * MOST
        found[first : first + MOST] = _covered(
            corners[begin:end], cell[begin:end] - first, min(MOST, count - first)
        )
    return found


def _covered(corners: FloatArray, cell: npt.NDArray[np.integer], count: int) -> FloatArray:
    ctx, rows = context(), -(-count // PER_ROW)
    size = np.array([PER_ROW, rows])
    at = np.stack([cell % PER_ROW, cell // PER_ROW], axis=1)
    place = ((at[:, None] + (np.clip(corners, -1, 1) + 1) / 2) / size * 2 - 1).astype(np.float32)
    with framebuffer_kept(ctx):
        image = ctx.texture((PER_ROW * SIDE, rows * SIDE), 1, dtype="f1")
        frame = ctx.framebuffer([image])
        frame.use()
        frame.clear()
        if len(place):
            ctx.disable(ctx.DEPTH_TEST | ctx.CULL_FACE | ctx.BLEND)
            buffer = ctx.buffer(np.ascontiguousarray(place))
            shader = program(ctx, "cells.vert", "cells.frag")
            array = ctx.vertex_array(shader, [(buffer, "2f", "place")])
            array.render(ctx.TRIANGLES)
            array.release()
            buffer.release()
        pixels = np.frombuffer(image.read(alignment=1), dtype=np.uint8) > 0
        frame.release()
        image.release()
        check(ctx)
    cells = pixels.reshape(rows, SIDE, PER_ROW, SIDE).mean(axis=(1, 3)).ravel()
    return np.asarray(cells[:count])
