"""How many fragments a plant or level makes a GPU shade."""

from __future__ import annotations

from collections.abc import Callable

import moderngl

from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.draw import Shot, begin, placed, render_group, tiles
from vegtool.gl.program import program
from vegtool.gl.targets import drawing_target
from vegtool.gl.upload import PlantBuffers


def count_fragments(buffers: PlantBuffers, shot: Shot) -> int:
    """Fragments of all faces that the camera sees, without depth test and alpha test: a bound that
    no order of drawing changes. Raises CapabilityError where OpenGL cannot hold the plant.
    """
    shader = program(buffers.ctx, "camera.vert", "count.frag")

    def render(part: Shot) -> None:
        shader["view_projection"] = placed(buffers, part)
        for group in buffers.groups:
            render_group(buffers, group, shader)

    return count_rendered(buffers.ctx, shot, render)


def count_rendered(ctx: moderngl.Context, shot: Shot, render: Callable[[Shot], None]) -> int:
    """Fragments of all that is rendered of a shot, part by part, without depth test."""
    counted = 0
    with framebuffer_kept(ctx):
        for _, _, part in tiles(ctx, shot, 1):
            size = part.width, part.height
            begin(drawing_target(ctx, size, 0), size)
            ctx.disable(moderngl.DEPTH_TEST)
            query = ctx.query(samples=True)
            with query:
                render(part)
            counted += query.samples
        ctx.disable(moderngl.CULL_FACE)
        check(ctx)
    return counted
