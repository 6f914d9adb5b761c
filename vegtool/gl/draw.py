"""A plant, or a level as the plant that a client loads, drawn by a camera under one light."""

from __future__ import annotations

from dataclasses import dataclass, field

import moderngl
import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.program import program
from vegtool.gl.upload import PlantBuffers

Picture = npt.NDArray[np.float32]
"""(height, width, 4): linear light premultiplied by coverage, and coverage."""
MSAA = 4
"""Samples per pixel of a live picture, as engines do by default."""


@dataclass(frozen=True, eq=False)
class Light:
    """A sun and a sky. direction: (3,) towards the sun. Strengths are factors of the albedo."""

    direction: FloatArray = field(default_factory=lambda: np.array([0.5, 1.0, 0.7]))
    sun: float = 0.70
    sky_above: float = 0.38
    sky_below: float = 0.20


def draw(
    buffers: PlantBuffers,
    view_projection: FloatArray,
    size: tuple[int, int],
    target: FloatArray,
    light: Light | None = None,
    supersample: int = 1,
    samples: int = 0,
) -> Picture:
    """The picture of a plant or level.

    view_projection: (4, 4), for positions relative to `target`, (3,) metres. size: width, height
    in pixels. supersample: pictures drawn that much larger per axis and averaged. samples: of
    multisampling, 0 for none; alpha is tested once per pixel then, as in a client. Raises
    CapabilityError where OpenGL cannot hold the plant or the picture.
    """
    ctx, light = buffers.ctx, light or Light()
    width, height = size[0] * supersample, size[1] * supersample
    shift = np.eye(4)
    shift[:3, 3] = buffers.origin - target
    matrix = tuple((view_projection @ shift).T.ravel())
    sun = light.direction / np.linalg.norm(light.direction)

    color = ctx.texture((width, height), 4, dtype="f2", samples=samples)
    depth = ctx.depth_renderbuffer((width, height), samples=samples)
    frame = ctx.framebuffer([color], depth)
    with framebuffer_kept(ctx):
        frame.use()
        frame.clear()
        ctx.enable(moderngl.DEPTH_TEST)
        for group in buffers.groups:
            defines = ("NORMAL_MAP",) if group.normal_map is not None else ()
            shader = program(ctx, "camera.vert", "camera.frag", *defines)
            shader["view_projection"] = matrix
            shader["sun_direction"] = tuple(sun)
            shader["sun"] = light.sun
            shader["sky"] = (light.sky_above, light.sky_below)
            buffers.use(group, shader)
            if group.material.double_sided:
                ctx.disable(moderngl.CULL_FACE)
            else:
                ctx.enable(moderngl.CULL_FACE)
            buffers.vertex_array(shader).render(vertices=3 * group.count, first=3 * group.first)
        ctx.disable(moderngl.CULL_FACE)
        picture = _read(ctx, frame, width, height, supersample, samples)
        check(ctx)
    for owned in (frame, color, depth):
        owned.release()
    return picture


def _read(
    ctx: moderngl.Context,
    frame: moderngl.Framebuffer,
    width: int,
    height: int,
    supersample: int,
    samples: int,
) -> Picture:
    source = frame
    if samples:
        resolved = ctx.texture((width, height), 4, dtype="f2")
        source = ctx.framebuffer([resolved])
        ctx.copy_framebuffer(source, frame)
    data = np.frombuffer(source.read(components=4, dtype="f2"), np.float16)
    if samples:
        source.release()
        resolved.release()
    picture = data.reshape(height, width, 4)[::-1].astype(np.float32)
    k = supersample
    if k > 1:
        picture = picture.reshape(height // k, k, width // k, k, 4).mean(axis=(1, 3))
    return picture
