"""A plant, or a level as the plant that a client loads, drawn by a camera under one light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.gl import targets
from vegtool.gl.context import check, describe, framebuffer_kept
from vegtool.gl.program import program
from vegtool.gl.targets import Target, drawing_target, pixel_target
from vegtool.gl.upload import PlantBuffers

Picture = npt.NDArray[np.float32]
"""(height, width, 4): linear light premultiplied by coverage, and coverage."""
MSAA = 4
"""Samples per pixel of a live picture, as engines do by default."""

Tile = tuple[int, int, int, int]
"""Pixels x0, y0 from the upper left, width, height: a part of a picture drawn at a time."""


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
    in pixels. supersample: samples per axis and pixel, averaged. samples: of multisampling, 0 for
    none; alpha is tested once per pixel then, as in a client. Raises CapabilityError where OpenGL
    cannot multisample so, or cannot hold the plant or the picture.
    """
    ctx, light = buffers.ctx, light or Light()
    picture = np.empty((size[1], size[0], 4), np.float32)
    density = supersample * _pixels_per_metre(view_projection, size)
    with framebuffer_kept(ctx):
        for tile in tiles(ctx, size, supersample):
            x, y, width, height = tile
            area = (0, 0, width * supersample, height * supersample)
            drawn = drawing_target(ctx, area[2:], samples)
            begin(drawn, area)
            render(buffers, cropped(view_projection, size, tile), target, light, density)
            pixels = _resolved(ctx, drawn, (width, height), samples or supersample, samples > 0)
            picture[y : y + height, x : x + width] = pixels
        check(ctx)
    return picture


def tiles(ctx: moderngl.Context, size: tuple[int, int], supersample: int) -> Iterator[Tile]:
    """Parts of a picture that a target can hold; most pictures are one."""
    width, height = size
    columns = min(width, describe(ctx).max_texture // supersample)
    rows = max(min(height, targets.SAMPLE_LIMIT // (columns * supersample**2)), 1)
    for x, y in product(range(0, width, columns), range(0, height, rows)):
        yield x, y, min(columns, width - x), min(rows, height - y)


def cropped(view_projection: FloatArray, size: tuple[int, int], tile: Tile) -> FloatArray:
    """The matrix whose whole picture is a tile of another's."""
    (width, height), (x, y, w, h) = size, tile
    crop = np.eye(4)
    crop[0, 0], crop[0, 3] = width / w, (width - 2 * x - w) / w
    crop[1, 1], crop[1, 3] = height / h, (2 * y + h - height) / h
    return np.asarray(crop @ view_projection)


def _pixels_per_metre(view_projection: FloatArray, size: tuple[int, int]) -> float:
    """At the target, which lies at the origin, across the view."""
    row, forward = view_projection[0, :3], view_projection[3, :3]
    across = row - forward * (row @ forward)
    return float(np.linalg.norm(across) * size[0] / 2 / view_projection[3, 3])


def begin(drawn: Target, area: tuple[int, int, int, int]) -> None:
    """Draw into an area of a target from here on, empty and with a depth test."""
    drawn.frame.viewport = area
    drawn.frame.use()
    drawn.frame.clear(viewport=area)
    drawn.frame.ctx.enable(moderngl.DEPTH_TEST)


def render(
    buffers: PlantBuffers,
    view_projection: FloatArray,
    target: FloatArray,
    light: Light,
    samples_per_metre: float = np.inf,
) -> None:
    """Draw a plant into the framebuffer in use; culls as its materials say.

    samples_per_metre: at the target. Textures without mips that are much finer are not filtered.
    """
    ctx = buffers.ctx
    shift = np.eye(4)
    shift[:3, 3] = buffers.origin - target
    matrix = tuple((view_projection @ shift).T.ravel())
    sun = tuple(light.direction / np.linalg.norm(light.direction))
    for group in buffers.groups:
        plain = () if group.material.color_texture is not None else ("NO_COLOR_MAP",)
        mapped = () if group.normal_map is None else ("NORMAL_MAP",)
        shader = program(ctx, "camera.vert", "camera.frag", *plain, *mapped)
        shader["view_projection"] = matrix
        shader["sun_direction"] = sun
        shader["sun"] = light.sun
        shader["sky"] = (light.sky_above, light.sky_below)
        buffers.use(group, shader, point_sampled=buffers.minified(group, samples_per_metre))
        if group.material.double_sided:
            ctx.disable(moderngl.CULL_FACE)
        else:
            ctx.enable(moderngl.CULL_FACE)
        buffers.vertex_array(shader).render(vertices=3 * group.count, first=3 * group.first)
    ctx.disable(moderngl.CULL_FACE)


_screens: WeakKeyDictionary[moderngl.Program, moderngl.VertexArray] = WeakKeyDictionary()


def _resolved(
    ctx: moderngl.Context, drawn: Target, size: tuple[int, int], samples: int, multisampled: bool
) -> Picture:
    width, height = size
    averaged = pixel_target(ctx, size)
    averaged.frame.viewport = (0, 0, width, height)
    averaged.frame.use()
    ctx.disable(moderngl.DEPTH_TEST)
    defines = ("MULTISAMPLED",) if multisampled else ()
    shader = program(ctx, "screen.vert", "resolve.frag", *defines)
    shader["samples"] = samples
    shader["height"] = height
    if shader not in _screens:
        _screens[shader] = ctx.vertex_array(shader, [])
    drawn.color.use(0)
    _screens[shader].render(moderngl.TRIANGLES, vertices=3)
    data = averaged.frame.read((0, 0, width, height), components=4, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(height, width, 4)
