"""A plant, or a level as the plant that a client loads, drawn by a camera under one light."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.program import program
from vegtool.gl.sun import SunMaps
from vegtool.gl.targets import Target, drawing_target, pixel_target, side
from vegtool.gl.upload import MaterialGroup, PlantBuffers
from vegtool.lighting.light import Light

MSAA = 4
"""Samples per pixel of a live picture, as engines do by default."""
ANISOTROPY = 4
"""Taps along the longer axis of a pixel's footprint, as engines filter textures by default."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A camera in OpenGL's terms. view_projection: (4, 4), for positions relative to `target`,
    (3,) metres. width, height: pixels."""

    view_projection: FloatArray
    target: FloatArray
    width: int
    height: int


def draw(
    buffers: PlantBuffers | Sequence[PlantBuffers],
    shot: Shot,
    light: Light,
    supersample: int = 1,
    samples: int = 0,
    anisotropy: int = ANISOTROPY,
    shadows: SunMaps | None = None,
) -> Picture:
    """The picture of a plant or level, or of several that stand together.

    supersample: samples per axis and pixel, averaged; mip-mapped textures are filtered as for one
    of the whole pixel, so that the mean is that of pictures moved by parts of a pixel. samples: of
    multisampling, 0 for none; alpha is tested once per pixel then, as in a client. anisotropy: most
    taps of a mip-mapped texture; 1 is trilinear filtering. shadows: what the sun sees, for shadows
    to be drawn; light comes from their direction then. Raises CapabilityError where OpenGL cannot
    multisample so, or cannot hold the plant or the picture.
    """
    drawn_together = (buffers,) if isinstance(buffers, PlantBuffers) else tuple(buffers)
    ctx = drawn_together[0].ctx
    picture = np.empty((shot.height, shot.width, 4), np.float32)
    with framebuffer_kept(ctx):
        for x, y, part in tiles(ctx, shot, supersample):
            size = (0, 0, part.width, part.height)
            drawn = draw_tile(
                drawn_together, part, light, supersample, samples, anisotropy, shadows
            )
            data = drawn.frame.read(size, components=4, dtype="f4")
            pixels = np.frombuffer(data, np.float32).reshape(part.height, part.width, 4)
            picture[y : y + part.height, x : x + part.width] = pixels
        check(ctx)
    return picture


def tiles(ctx: moderngl.Context, shot: Shot, supersample: int) -> Iterator[tuple[int, int, Shot]]:
    """Parts of a picture that a target can hold, and where they lie, in pixels right and down;
    most pictures are one."""
    most = max(side(ctx) // supersample, 1)
    for x, y in product(range(0, shot.width, most), range(0, shot.height, most)):
        width, height = min(most, shot.width - x), min(most, shot.height - y)
        crop = np.eye(4)
        crop[0, 0], crop[0, 3] = shot.width / width, (shot.width - 2 * x - width) / width
        crop[1, 1], crop[1, 3] = shot.height / height, (2 * y + height - shot.height) / height
        yield x, y, Shot(crop @ shot.view_projection, shot.target, width, height)


def pictured(
    ctx: moderngl.Context, shot: Shot, render: Callable[[Shot], None], supersample: int,
    samples: int,
) -> Picture:  # fmt: skip
    """What is rendered of a shot, part by part, as light and coverage."""
    whole = np.empty((shot.height, shot.width, 4), np.float32)
    with framebuffer_kept(ctx):
        for x, y, part in tiles(ctx, shot, supersample):
            pixels = drawn_part(ctx, part, render, supersample, samples)
            data = pixels.frame.read((0, 0, part.width, part.height), components=4, dtype="f4")
            found = np.frombuffer(data, np.float32).reshape(part.height, part.width, 4)
            whole[y : y + part.height, x : x + part.width] = found
        check(ctx)
    return whole


def drawn_part(
    ctx: moderngl.Context, part: Shot, render: Callable[[Shot], None], supersample: int,
    samples: int,
) -> Target:  # fmt: skip
    """What is rendered of a picture that a target can hold; as of `draw_tile`. Raises ValueError
    where both kinds of samples are asked for, which are never averaged together."""
    if samples and supersample > 1:
        raise ValueError(f"expected supersample 1 beside multisampling, found {supersample}")
    size = supersample * part.width, supersample * part.height
    drawn = drawing_target(ctx, size, samples)
    begin(drawn, size)
    render(part)
    return resolved(ctx, drawn, (part.width, part.height), supersample, samples)


def draw_tile(
    buffers: Sequence[PlantBuffers],
    shot: Shot,
    light: Light,
    supersample: int,
    samples: int,
    anisotropy: int = ANISOTROPY,
    shadows: SunMaps | None = None,
) -> Target:
    """Draw a picture that a target can hold; what is returned has it in its lower left corner,
    top row first. The caller keeps the framebuffer (`framebuffer_kept`)."""

    def render_all(part: Shot) -> None:
        for each in buffers:
            render(each, part, light, supersample, anisotropy, shadows)

    return drawn_part(buffers[0].ctx, shot, render_all, supersample, samples)


def begin(drawn: Target, size: tuple[int, int]) -> None:
    """Draw into the lower left corner of a target from here on, empty and with a depth test."""
    area = (0, 0, *size)
    drawn.frame.viewport = area
    drawn.frame.use()
    drawn.frame.clear(viewport=area)
    drawn.frame.ctx.enable(moderngl.DEPTH_TEST)


def render(
    buffers: PlantBuffers,
    shot: Shot,
    light: Light,
    supersample: int = 1,
    anisotropy: int = ANISOTROPY,
    shadows: SunMaps | None = None,
) -> None:
    """Draw a plant into the framebuffer in use, whose pixels are `supersample` of the shot's."""
    matrix = placed(buffers, shot)
    samples_per_metre = supersample * pixels_per_metre(shot)
    for group in buffers.groups:
        shader = shader_of(buffers, group, "camera.frag", anisotropy, shadows)
        shader["view_projection"] = matrix
        set_footprint(shader, supersample)
        set_light(shader, buffers, light, shadows)
        buffers.use(group, shader, point_sampled=buffers.minified(group, samples_per_metre))
        render_group(buffers, group, shader)
    buffers.ctx.disable(moderngl.CULL_FACE)


def shader_of(
    buffers: PlantBuffers,
    group: MaterialGroup,
    fragment: str,
    anisotropy: int = ANISOTROPY,
    shadows: SunMaps | None = None,
) -> moderngl.Program:
    """The program of camera.vert and a fragment shader with what a material needs, and no more."""
    material = group.material
    defines = {
        "MIPMAPPED": buffers.mipmaps,
        f"ANISOTROPY {anisotropy}.0": buffers.mipmaps,
        "NO_COLOR_MAP": material.color_texture is None,
        "UNLIT": material.unlit,
        "NORMAL_MAP": group.normal_map is not None and not material.unlit,
        "LIGHT_MAP": group.light_map is not None and not material.unlit,
        "EXPOSURE": buffers.plant.exposure is not None and not material.unlit,
    }
    told = [name for name, wanted in defines.items() if wanted]
    if shadows is not None and not material.unlit:
        told += shadows.defines
    return program(buffers.ctx, "camera.vert", fragment, *told)


def set_footprint(shader: moderngl.Program, footprint: float) -> None:
    """Set the uniform of filter.glsl, where a program has it."""
    if "footprint" in shader:
        shader["footprint"] = float(footprint)


def set_light(
    shader: moderngl.Program, buffers: PlantBuffers, light: Light, shadows: SunMaps | None = None
) -> None:
    """Set the uniforms of shading.glsl and shadow.glsl, as far as a program has them."""
    set_sky(shader, light, light.unit if shadows is None else shadows.direction)
    if shadows is not None and "sun_depth" in shader:
        shadows.use(shader, buffers)


def set_sky(shader: moderngl.Program, light: Light, direction: FloatArray | None = None) -> None:
    """Set the uniforms of shading.glsl, as far as a program has them. direction: (3,) unit, of the
    sun, the light's own if None."""
    values = {
        "sun_direction": tuple(light.unit if direction is None else direction),
        "sun": light.sun,
        "sky": (light.sky_above, light.sky_below),
    }
    for name, value in values.items():
        if name in shader:
            shader[name] = value


def placed(buffers: PlantBuffers, shot: Shot) -> tuple[float, ...]:
    """The uniform `view_projection` of camera.vert, for positions as they were uploaded."""
    place = np.diag([buffers.scale, buffers.scale, buffers.scale, 1.0])
    place[:3, 3] = buffers.origin - shot.target
    # any multiple of the matrix draws the same: without metres, roundings do not depend on size
    return tuple((shot.view_projection @ place / buffers.scale).T.ravel())


def render_group(buffers: PlantBuffers, group: MaterialGroup, shader: moderngl.Program) -> None:
    """Draw the faces of one material, culled as it says."""
    if group.material.double_sided:
        buffers.ctx.disable(moderngl.CULL_FACE)
    else:
        buffers.ctx.enable(moderngl.CULL_FACE)
    buffers.vertex_array(shader).render(vertices=3 * group.count, first=3 * group.first)


def pixels_per_metre(shot: Shot) -> float:
    """Of a shot, at its target, across the view."""
    row, forward = shot.view_projection[0, :3], shot.view_projection[3, :3]
    across = row - forward * (row @ forward)
    return float(np.linalg.norm(across) * shot.width / 2 / shot.view_projection[3, 3])


_screens: WeakKeyDictionary[moderngl.Program, moderngl.VertexArray] = WeakKeyDictionary()


def resolved(
    ctx: moderngl.Context, drawn: Target, size: tuple[int, int], supersample: int, samples: int
) -> Target:
    """What was drawn into the lower left corner of a target, as `size` pixels, the means of their
    samples in linear light: top row first."""
    averaged = pixel_target(ctx, size)
    averaged.frame.viewport = (0, 0, *size)
    averaged.frame.use()
    ctx.disable(moderngl.DEPTH_TEST)
    defines = ("MULTISAMPLED",) if samples else ()
    shader = program(ctx, "screen.vert", "resolve.frag", *defines)
    shader["samples"] = samples or supersample
    shader["height"] = size[1]
    if shader not in _screens:
        _screens[shader] = ctx.vertex_array(shader, [])
    drawn.color.use(0)
    _screens[shader].render(moderngl.TRIANGLES, vertices=3)
    return averaged
