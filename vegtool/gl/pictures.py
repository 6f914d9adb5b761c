"""Pictures of parts of a plant, many at once: orthographic, supersampled, into one atlas.

All pictures are drawn by one call per material: the stream holds a vertex and a picture number
per corner, and the vertex shader fetches both from textures. So the plant is uploaded once for
all levels, and no state changes between pictures.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from time import perf_counter

import moderngl
import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray
from vegtool.gl.context import check, describe, framebuffer_kept
from vegtool.gl.program import program
from vegtool.gl.upload import PlantBuffers

RGB10_A2 = 0x8059
CLIP_PLANES = (0x3000, 0x3001, 0x3002, 0x3003)
PICTURES_PER_ROW = 1024
SAMPLE_LIMIT = 4_000_000
"""Samples drawn at a time, 12 bytes each; larger atlases are drawn tile by tile."""
LEAST_HALF_SIZE = 1e-7
"""Of the plant's radius: keeps the scale of a picture without width finite; it stays empty."""

Tile = tuple[int, int, int, int]
"""Texels x0, y0, width, height: a part of the atlas that is drawn at a time."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """n pictures to draw: planes as in Billboards, side (n,) int32 1 front or -1 back, and rect
    (n, 4) int32 texels x0, y0, width, height in the atlas."""

    center: FloatArray
    u: FloatArray
    v: FloatArray
    half_size: FloatArray
    half_depth: FloatArray
    side: IntArray
    rect: IntArray


@dataclass(frozen=True, eq=False)
class Drawn:
    """color (h, w, 4) uint8 sRGB straight, normal (h, w, 3) uint8, depth (h, w) uint16 as in Atlas.

    Nothing is dilated: colour is black and the normal flat where alpha is 0.
    seconds: by stage: stream (what is drawn, in order), draw, resolve, read.
    """

    color: ByteArray
    normal: ByteArray
    depth: np.ndarray
    seconds: dict[str, float]


def draw_pictures(
    buffers: PlantBuffers,
    pictures: Pictures,
    face: IntArray,
    picture: IntArray,
    size: tuple[int, int],
    samples: int,
) -> Drawn:
    """Draw `face[i]` of the plant into picture `picture[i]`, for all i; (m,) int32 each.

    size: width and height of the atlas in texels. samples: per axis and texel.
    Raises CapabilityError where OpenGL cannot hold the plant or the pictures.
    """
    ctx = buffers.ctx
    width, height = size
    watch = _Watch(ctx)
    stream = _stream(buffers, pictures, face, picture)
    columns = min(width, describe(ctx).max_texture // samples)
    rows = int(np.clip(SAMPLE_LIMIT // (columns * samples * samples), 1, height))
    table = _picture_table(buffers, pictures)
    target = _Samples(ctx, (columns * samples, rows * samples))
    atlas = _Resolved(ctx, size)
    watch.lap("stream")
    try:
        with framebuffer_kept(ctx):
            for x, y in product(range(0, width, columns), range(0, height, rows)):
                tile = (x, y, min(columns, width - x), min(rows, height - y))
                target.use(tile[2] * samples, tile[3] * samples)
                part = _within(stream, pictures.rect, tile)
                _draw(buffers, part, table, tile, samples * _density(pictures))
                watch.lap("draw")
                atlas.resolve(target, samples, tile)
                watch.lap("resolve")
            color, normal, depth = atlas.read()
            watch.lap("read")
            check(ctx)
    finally:
        for made in (table, target, atlas):
            made.release()
    return Drawn(color, normal, depth, watch.seconds)


def _density(pictures: Pictures) -> float:
    """Texels per metre of the pictures together."""
    area = float(4 * pictures.half_size.prod(axis=1).sum())
    texels = float(pictures.rect[:, 2:].astype(np.float64).prod(axis=1).sum())
    return float(np.sqrt(texels / area)) if area > 0 else np.inf


class _Watch:
    """Seconds by stage; waits for the GPU at every lap, so that a stage pays for itself."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self.seconds: dict[str, float] = {}
        self.since = perf_counter()

    def lap(self, stage: str) -> None:
        self.ctx.finish()
        now = perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self.since
        self.since = now


@dataclass(frozen=True, eq=False)
class _Stream:
    """The faces and their pictures, sorted by run: the front's materials, then the back's."""

    face: IntArray
    picture: IntArray
    run: IntArray


def _stream(
    buffers: PlantBuffers, pictures: Pictures, face: IntArray, picture: IntArray
) -> _Stream:
    back = pictures.side[picture] < 0
    run = buffers.plant.face_material[face] + back * len(buffers.plant.materials)
    order = np.argsort(run.astype(np.uint16), kind="stable")  # 16 bits: a radix sort
    return _Stream(face[order], picture[order], run[order])


def _within(stream: _Stream, rect: IntArray, tile: Tile) -> _Stream:
    """The part of the stream that reaches into a tile of the atlas."""
    low, high = np.array(tile[:2]), np.array(tile[:2]) + tile[2:]
    inside = ((rect[:, :2] < high) & (rect[:, :2] + rect[:, 2:] > low)).all(axis=1)
    if inside.all():
        return stream
    keep = inside[stream.picture]
    return _Stream(stream.face[keep], stream.picture[keep], stream.run[keep])


def _draw(
    buffers: PlantBuffers,
    stream: _Stream,
    table: moderngl.Texture,
    tile: Tile,
    samples_per_metre: float,
) -> None:
    """Draw a tile of the atlas into the framebuffer in use."""
    if not len(stream.face):
        return
    ctx, plant = buffers.ctx, buffers.plant
    corners = np.empty((len(stream.face), 3, 2), dtype=np.uint32)
    corners[..., 0] = plant.faces[stream.face]
    corners[..., 1] = stream.picture[:, None]
    vertices = ctx.buffer(corners)
    starts = np.searchsorted(stream.run, np.arange(2 * len(plant.materials) + 1))
    colors = () if plant.colors is None else ("VERTEX_COLORS",)
    for plane in CLIP_PLANES:
        ctx.enable_direct(plane)
    for side in (1, -1):
        # Row 0 is the top: the picture is upside down for GL, which turns every winding.
        ctx.front_face = "cw" if side > 0 else "ccw"
        for group in buffers.groups:
            run = group.number + (0 if side > 0 else len(plant.materials))
            first, end = int(starts[run]), int(starts[run + 1])
            if first == end:
                continue
            mapped = () if group.normal_map is None else ("NORMAL_MAP",)
            shader = program(ctx, "picture.vert", "picture.frag", *colors, *mapped)
            shader["side"] = side
            shader["tile"] = tile
            shader["vertices"] = 2
            shader["pictures"] = 3
            buffers.use(group, shader, point_sampled=buffers.minified(group, samples_per_metre))
            buffers.vertex_texture.use(2)
            table.use(3)
            culling = 0 if group.material.double_sided else moderngl.CULL_FACE
            ctx.enable_only(moderngl.DEPTH_TEST | culling)
            array = ctx.vertex_array(shader, [(vertices, "2u", "in_vertex_picture")])
            array.render(moderngl.TRIANGLES, vertices=3 * (end - first), first=3 * first)
            array.release()
    for plane in CLIP_PLANES:
        ctx.disable_direct(plane)
    ctx.front_face = "ccw"
    vertices.release()


def _picture_table(buffers: PlantBuffers, pictures: Pictures) -> moderngl.Texture:
    """Four texels per picture, as `picture.vert` reads them."""
    count = len(pictures.center)
    rows = max(1, -(-count // PICTURES_PER_ROW))
    data = np.zeros((rows * PICTURES_PER_ROW, 4, 4), dtype=np.float32)
    data[:count, 0, :3] = pictures.u
    data[:count, 1, :3] = pictures.v
    data[:count, :2, 3] = np.maximum(pictures.half_size / buffers.scale, LEAST_HALF_SIZE)
    data[:count, 2, :3] = (pictures.center - buffers.origin) / buffers.scale
    half_depth = pictures.half_depth / buffers.scale
    data[:count, 2, 3] = np.where(half_depth > LEAST_HALF_SIZE, half_depth, 0)
    data[:count, 3] = pictures.rect
    texture = buffers.ctx.texture((4 * PICTURES_PER_ROW, rows), 4, data, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


class _Samples:
    """The supersampled target: colour, normal, depth."""

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int]) -> None:
        self.color = ctx.texture(size, 4, internal_format=RGB10_A2)
        self.normal = ctx.texture(size, 4, internal_format=RGB10_A2)
        self.depth = ctx.depth_texture(size)
        self.depth.compare_func = ""  # read as a number
        self.textures = (self.color, self.normal, self.depth)
        for texture in self.textures:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.framebuffer = ctx.framebuffer([self.color, self.normal], self.depth)

    def use(self, width: int, height: int) -> None:
        self.framebuffer.use()
        self.framebuffer.viewport = (0, 0, width, height)
        self.framebuffer.clear(depth=1.0)

    def release(self) -> None:
        self.framebuffer.release()
        for texture in self.textures:
            texture.release()


class _Resolved:
    """The atlas itself: colour, normal, depth, one texel for K x K samples."""

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int]) -> None:
        self.ctx = ctx
        self.textures = (
            ctx.texture(size, 4),
            ctx.texture(size, 4),
            ctx.texture(size, 1, dtype="nu2"),
        )
        self.framebuffer = ctx.framebuffer(self.textures)

    def resolve(self, target: _Samples, samples: int, tile: Tile) -> None:
        """Average the target's samples into a tile of the atlas."""
        self.framebuffer.use()
        self.framebuffer.viewport = tile
        shader = program(self.ctx, "screen.vert", "picture_resolve.frag")
        for unit, texture in enumerate(target.textures):
            texture.use(unit)
        shader["color_samples"], shader["normal_samples"], shader["depth_samples"] = 0, 1, 2
        shader["samples"] = samples
        shader["corner"] = tile[:2]
        self.ctx.enable_only(moderngl.NOTHING)
        array = self.ctx.vertex_array(shader, [])
        array.render(moderngl.TRIANGLES, vertices=3)
        array.release()

    def read(self) -> tuple[ByteArray, ByteArray, np.ndarray]:
        width, height = self.framebuffer.size
        self.framebuffer.viewport = (0, 0, width, height)

        def plane(attachment: int, components: int, dtype: str, kind: type) -> np.ndarray:
            data = self.framebuffer.read(
                components=components, attachment=attachment, alignment=1, dtype=dtype
            )
            return np.frombuffer(data, kind).reshape(height, width, components)

        return (
            plane(0, 4, "f1", np.uint8),
            plane(1, 3, "f1", np.uint8),
            plane(2, 1, "nu2", np.uint16)[..., 0],
        )

    def release(self) -> None:
        self.framebuffer.release()
        for texture in self.textures:
            texture.release()
