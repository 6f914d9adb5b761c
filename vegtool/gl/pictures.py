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
from vegtool.gl.draw import set_light
from vegtool.gl.program import program
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import MaterialGroup, PlantBuffers
from vegtool.lighting.light import Light

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
class BakedLight:
    """Light that is put into the colours of pictures, in place of their normals.

    shadows: what the sun sees; None for plants that are unlit, whose colours stay. both_sides: one
    picture serves both sides of a billboard and shows the mean of their light.
    """

    light: Light
    shadows: SunMaps | None = None
    both_sides: bool = True


@dataclass(frozen=True, eq=False)
class Drawn:
    """color (h, w, 4) uint8 sRGB straight, depth (h, w) uint16, normal (h, w, 3) uint8 and light
    (h, w, 4) uint8 as in Atlas; None where they are not drawn.

    Nothing is dilated: colour and light are black and the normal flat where alpha is 0.
    seconds: by stage: stream (what is drawn, in order), draw, resolve, read and, where there are
    normals, reading those.
    """

    color: ByteArray
    depth: np.ndarray
    normal: ByteArray | None
    light: ByteArray | None
    seconds: dict[str, float]


def draw_pictures(
    buffers: PlantBuffers,
    pictures: Pictures,
    face: IntArray,
    picture: IntArray,
    size: tuple[int, int],
    samples: int,
    baked: BakedLight | None = None,
    light: bool = False,
) -> Drawn:
    """Draw `face[i]` of the plant into picture `picture[i]`, for all i; (m,) int32 each.

    size: width and height of the atlas in texels. samples: per axis and texel. baked: what light to
    put into colours; then there are no normals. light: draw what `Atlas.light` holds too.
    Raises CapabilityError where OpenGL cannot hold the plant or the pictures.
    """
    ctx = buffers.ctx
    width, height = size
    watch = _Watch(ctx)
    stream = _stream(buffers, pictures, face, picture)
    columns = min(width, describe(ctx).max_texture // samples)
    rows = int(np.clip(SAMPLE_LIMIT // (columns * samples * samples), 1, height))
    table = _picture_table(buffers, pictures)
    channels = _channels(baked is None, light)
    target = _Samples(ctx, (columns * samples, rows * samples), channels)
    atlas = _Resolved(ctx, size, channels)
    watch.lap("stream")
    try:
        with framebuffer_kept(ctx):
            for x, y in product(range(0, width, columns), range(0, height, rows)):
                tile = (x, y, min(columns, width - x), min(rows, height - y))
                target.use(tile[2] * samples, tile[3] * samples)
                part = _within(stream, pictures.rect, tile)
                _draw(buffers, part, table, tile, samples * _density(pictures), baked, light)
                watch.lap("draw")
                atlas.resolve(target, samples, tile)
                watch.lap("resolve")
            read = {name: atlas.read(name) for name in atlas.textures if name != "normal"}
            watch.lap("read")
            if "normal" in atlas.textures:
                read["normal"] = atlas.read("normal")
                watch.lap("normals")
            check(ctx)
    finally:
        for made in (table, target, atlas):
            made.release()
    return Drawn(read["color"], read["depth"], read.get("normal"), read.get("light"), watch.seconds)


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
    baked: BakedLight | None,
    light: bool,
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
            defines = _defines(buffers, group, baked, light)
            shader = program(ctx, "picture.vert", "picture.frag", *defines)
            if baked is not None and not group.material.unlit:
                set_light(shader, buffers, baked.light, baked.shadows)
                shader["both_sides"] = baked.both_sides
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


def _defines(
    buffers: PlantBuffers, group: MaterialGroup, baked: BakedLight | None, light: bool
) -> list[str]:
    """What the programs of pictures are made with."""
    plant = buffers.plant
    defines = {
        "VERTEX_COLORS": plant.colors is not None,
        "EXPOSURE": plant.exposure is not None,
        "NORMAL_MAP": group.normal_map is not None,
        "LIGHT_MAP": group.light_map is not None,
        "LIT": baked is not None,
        "UNLIT": group.material.unlit,
        "LIGHT": light,
    }
    shadows = () if baked is None or baked.shadows is None else baked.shadows.defines
    return [*(name for name, wanted in defines.items() if wanted), *shadows]


def _channels(normals: bool, light: bool) -> tuple[str, ...]:
    """What is drawn beside colour and depth, in the order of the shaders' outputs."""
    wanted = {"normal": normals, "light": light}
    return tuple(name for name, drawn in wanted.items() if drawn)


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
    """The supersampled target: colour, depth, and other channels."""

    def __init__(
        self, ctx: moderngl.Context, size: tuple[int, int], channels: tuple[str, ...]
    ) -> None:
        depth = ctx.depth_texture(size)
        depth.compare_func = ""  # read as a number
        formats = {"normal": RGB10_A2, "light": None}
        self.textures = {
            "color": ctx.texture(size, 4, internal_format=RGB10_A2),
            "depth": depth,
            **{name: ctx.texture(size, 4, internal_format=formats[name]) for name in channels},
        }
        for texture in self.textures.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        drawn = [texture for name, texture in self.textures.items() if name != "depth"]
        self.framebuffer = ctx.framebuffer(drawn, depth)

    def use(self, width: int, height: int) -> None:
        self.framebuffer.use()
        self.framebuffer.viewport = (0, 0, width, height)
        self.framebuffer.clear(depth=1.0)

    def release(self) -> None:
        self.framebuffer.release()
        for texture in self.textures.values():
            texture.release()


class _Resolved:
    """The atlas itself: colour, depth and other channels, one texel for K x K samples."""

    def __init__(
        self, ctx: moderngl.Context, size: tuple[int, int], channels: tuple[str, ...]
    ) -> None:
        self.ctx = ctx
        self.textures = {
            "color": ctx.texture(size, 4),
            "depth": ctx.texture(size, 1, dtype="nu2"),
            **{name: ctx.texture(size, 4) for name in channels},
        }
        self.framebuffer = ctx.framebuffer(list(self.textures.values()))

    def resolve(self, target: _Samples, samples: int, tile: Tile) -> None:
        """Average the target's samples into a tile of the atlas."""
        self.framebuffer.use()
        self.framebuffer.viewport = tile
        names = list(target.textures)
        defines = ["NORMALS"] * ("normal" in names)
        if "light" in names:
            defines.append(f"LIGHT {names.index('light')}")
        shader = program(self.ctx, "screen.vert", "picture_resolve.frag", *defines)
        for unit, (name, texture) in enumerate(target.textures.items()):
            texture.use(unit)
            shader[f"{name}_samples"] = unit
        shader["samples"] = samples
        shader["corner"] = tile[:2]
        self.ctx.enable_only(moderngl.NOTHING)
        array = self.ctx.vertex_array(shader, [])
        array.render(moderngl.TRIANGLES, vertices=3)
        array.release()

    def read(self, name: str) -> np.ndarray:
        """A channel, as in Drawn."""
        width, height = self.framebuffer.size
        self.framebuffer.viewport = (0, 0, width, height)
        kinds = {
            "color": (4, "f1", np.uint8),
            "depth": (1, "nu2", np.uint16),
            "normal": (3, "f1", np.uint8),
            "light": (4, "f1", np.uint8),
        }
        components, dtype, kind = kinds[name]
        attachment = list(self.textures).index(name)
        data = self.framebuffer.read(
            components=components, attachment=attachment, alignment=1, dtype=dtype
        )
        plane: np.ndarray = np.frombuffer(data, kind).reshape(height, width, components)
        return plane[..., 0] if components == 1 else plane

    def release(self) -> None:
        self.framebuffer.release()
        for texture in self.textures.values():
            texture.release()
