"""What the shaders of surfels do, read back: for those who measure it."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from vegtool.arrays import FloatArray, IntArray, SingleArray
from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.draw import Shot
from vegtool.gl.program import captured
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_choice import SurfelFrame
from vegtool.gl.surfel_data import SurfelItems
from vegtool.gl.surfel_draw import billboard_program, triangle_program


@dataclass(frozen=True, eq=False)
class SurfelsSeen:
    """What each pixel of a picture (h, w) shows of a model, its top row first.

    billboard: (h, w) int32 of the hierarchy, -1 where it is none. arc: (h, w) int32 of the
    multi-triangulation, -1 where it is none. plane: (h, w, 3) float32 metres from the plant's
    center, in its own frame, the place that is drawn: on the billboard's plane. surface: the same,
    what is drawn there: of billboards, the depth in the texture farther. covered: (h, w) float32
    alpha.
    """

    billboard: IntArray
    arc: IntArray
    plane: SingleArray
    surface: SingleArray
    covered: SingleArray


def surfels_seen(model: SurfelBuffers, frame: SurfelFrame, shot: Shot) -> SurfelsSeen:
    """What is seen of a frame; of several instances, the nearest. Drawn in one piece."""
    ctx, size = model.ctx, (shot.width, shot.height)
    textures = [ctx.texture(size, 4, dtype="f4") for _ in range(2)]
    depth = ctx.depth_renderbuffer(size)
    target = ctx.framebuffer(textures, depth)
    with framebuffer_kept(ctx):
        target.use()
        target.clear()
        ctx.enable_only(moderngl.DEPTH_TEST)
        model.write(frame.rows)
        for group in model.buffers.groups:
            shader = triangle_program(model, group, "lit", 0, None, read=True)
            _tell(shader, model, frame, shot)
            model.buffers.use(group, shader)
            if not group.material.double_sided:
                ctx.enable(moderngl.CULL_FACE)
            model.draw_patches(shader, frame, group)
            ctx.disable(moderngl.CULL_FACE)
        if len(model.data.billboards):
            shader = billboard_program(model, "lit", 0, None, read=True)
            _tell(shader, model, frame, shot)
            model.draw_billboards(shader, frame)
        check(ctx)
        planes = [
            np.frombuffer(target.read(components=4, attachment=i, dtype="f4"), np.float32)
            .reshape(shot.height, shot.width, 4)[::-1]
            for i in range(2)
        ]  # fmt: skip
    target.release()
    depth.release()
    for texture in textures:
        texture.release()
    number = np.rint(planes[0][..., 3]).astype(np.int32)
    of = np.append(model.data.billboards.number, np.int32(-1))
    unit = np.float32(model.buffers.scale)
    return SurfelsSeen(
        of[np.where(number > 0, number - 1, -1)], np.where(number < 0, -number - 1, -1),
        unit * planes[0][..., :3], unit * planes[1][..., :3], planes[1][..., 3],
    )  # fmt: skip


def shown(model: SurfelBuffers, items: SurfelItems, eyes: FloatArray, pixels: float) -> np.ndarray:
    """(e, n) bool: which items the shader lets through for eyes (e, 3), of all there are.

    eyes: in the plant's unit, relative to its center. pixels: pc / epsilon.
    """
    ctx = model.ctx
    shader = captured(ctx, "surfel_shown.vert", ("shown",))
    pairs = np.stack([items.below, items.above], axis=1).astype(np.int32)
    given = [ctx.buffer(np.ascontiguousarray(pairs)), ctx.buffer(eyes.astype(np.float32).tobytes())]
    result = ctx.buffer(reserve=4 * len(items) * len(eyes))
    content = [(given[0], "2i", "in_item"), (given[1], "3f/i", "in_eye")]
    array = ctx.vertex_array(shader, content)
    model.use(shader, pixels)
    nothing = ctx.simple_framebuffer((1, 1))  # OpenGL wants one that is complete
    with framebuffer_kept(ctx):
        nothing.use()
        array.transform(result, moderngl.POINTS, vertices=len(items), instances=len(eyes))
        check(ctx)
    found = np.frombuffer(result.read(), np.float32).reshape(len(eyes), len(items)) > 0.5
    array.release()
    nothing.release()
    for buffer in (*given, result):
        buffer.release()
    return found


def _tell(shader: moderngl.Program, model: SurfelBuffers, frame: SurfelFrame, shot: Shot) -> None:
    model.use(shader, frame.pixels)
    shader["view_projection"] = tuple(shot.view_projection.T.ravel())
    if "footprint" in shader:
        shader["footprint"] = 1.0
