"""A model of surfel billboards over triangles on the GPU, drawn many times in a frame."""

from __future__ import annotations

import moderngl
import numpy as np

from vegtool.arrays import ByteArray, SingleArray
from vegtool.gl.context import OnGpu
from vegtool.gl.pace import Pace
from vegtool.gl.surfel_choice import SURFEL_INSTANCE, Run, SurfelFrame
from vegtool.gl.surfel_data import SurfelData, SurfelPatches
from vegtool.gl.upload import SRGB8_ALPHA8, MaterialGroup, PlantBuffers, rewritten

PER_INSTANCE = (
    ("in_place", "f", "4f", 0), ("in_eye", "f", "3f", 16), ("in_turn", "f", "2f", 28),
)  # fmt: skip
"""Attributes of SURFEL_INSTANCE: name, class, format and offset."""
TEXELS_PER_ROW = 1536
"""Of textures that hold data: whole items of two and of six texels."""
STEPS, QUADS, VERTICES, COLOR, SURFACE = 7, 8, 9, 10, 11
"""Texture units."""
QUAD = np.array([0, 1, 2, 0, 2, 3], np.uint32)
"""Corners of its triangles."""


class SurfelBuffers(OnGpu):
    """A model on the GPU. A context manager: leaving releases.

    buffers: its plant's vertices, materials and textures, with mips that keep coverage; without
    mipmaps for what is supersampled.
    """

    def __init__(
        self, data: SurfelData, *, mipmaps: bool = True, ctx: moderngl.Context | None = None
    ) -> None:
        self.data = data
        self.buffers = PlantBuffers(data.plant, mipmaps=mipmaps, keep_coverage=mipmaps, ctx=ctx)
        self.ctx = self.buffers.ctx
        self.steps = _data_texture(self.ctx, data.steps)
        self._quads = _data_texture(self.ctx, data.quads)
        self._color = _atlas_texture(self.ctx, data.color, srgb=True)
        self._surface = _atlas_texture(self.ctx, data.surface, srgb=False)
        self._rows = self.ctx.buffer(reserve=SURFEL_INSTANCE.itemsize * 64, dynamic=True)
        billboard = 4 * np.arange(len(data.billboards), dtype=np.uint32)[:, None]
        self._indices = self.ctx.buffer((billboard + QUAD).tobytes() or bytes(4))
        self._patches = {one.material: _Patches(self.ctx, one) for one in data.patches}
        self._arrays: dict[tuple[moderngl.Program, int], moderngl.VertexArray] = {}
        self._pace = Pace(self.ctx)

    def release(self) -> None:
        """Free everything on the GPU."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        for patches in self._patches.values():
            patches.release()
        self._patches.clear()
        for owned in (
            self.steps, self._quads, self._color, self._surface, self._rows, self._indices
        ):  # fmt: skip
            owned.release()
        self.buffers.release()

    @property
    def texture_bytes(self) -> int:
        """Of the billboards' textures and the materials', mips counted."""
        return self.data.atlas_bytes + self.buffers.texture_bytes

    def repaint(self, color: ByteArray) -> None:
        """Other colours in the billboards' pictures, (h, w, 4) as they were."""
        self._color.write(np.ascontiguousarray(color))

    def write(self, rows: np.ndarray) -> None:
        """Tell of the instances of a frame, (n,) SURFEL_INSTANCE."""
        self._rows = rewritten(self._rows, rows)

    def use(self, shader: moderngl.Program, pixels: float) -> None:
        """Bind what programs of surfels read, and set their uniforms."""
        for name, unit, texture in (
            ("steps", STEPS, self.steps),
            ("quads", QUADS, self._quads),
            ("color_atlas", COLOR, self._color),
            ("surface_atlas", SURFACE, self._surface),
        ):
            if name in shader:
                texture.use(unit)
                shader[name] = unit
        if "vertices" in shader:
            self.buffers.vertex_texture.use(VERTICES)
            shader["vertices"] = VERTICES
        if "atlas_size" in shader:
            shader["atlas_size"] = self._color.size
        shader["pixels"] = pixels

    def draw_billboards(self, shader: moderngl.Program, frame: SurfelFrame) -> tuple[int, int]:
        """Draw those that may be drawn; returns the calls, and how many triangles they send."""
        sizes = [(run, 2 * run.items) for run in frame.billboards]
        return self._draw(shader, -1, sizes)

    def draw_patches(
        self, shader: moderngl.Program, frame: SurfelFrame, group: MaterialGroup
    ) -> tuple[int, int]:
        """The same of the triangles of one material."""
        for one, runs in zip(self.data.patches, frame.patches, strict=True):
            if one.material == group.number:
                sizes = [(run, int(one.first[run.items])) for run in runs]
                return self._draw(shader, group.number, sizes)
        return 0, 0

    def _draw(
        self, shader: moderngl.Program, material: int, sizes: list[tuple[Run, int]]
    ) -> tuple[int, int]:
        calls = sent = 0
        for run, triangles in sizes:
            at_once = max(self._pace.most // triangles, 1)
            for row in range(run.first, run.first + run.count, at_once):
                count = min(at_once, run.first + run.count - row)
                array = self._array(shader, material, row)
                array.render(moderngl.TRIANGLES, vertices=3 * triangles, instances=count)
                self._pace.sent(count * triangles)
                calls, sent = calls + 1, sent + count * triangles
        return calls, sent

    def _array(self, shader: moderngl.Program, material: int, row: int) -> moderngl.VertexArray:
        """Of billboards, -1, or the patches of a material; instances from a row on."""
        key = shader, material
        if key not in self._arrays:
            if material < 0:
                array = self.ctx.vertex_array(shader, [], self._indices)
            else:
                patches = self._patches[material]
                content = [(patches.corners, "4i", "in_corner")]
                array = self.ctx.vertex_array(shader, content, patches.indices)
            self._arrays[key] = array
        array, start = self._arrays[key], row * SURFEL_INSTANCE.itemsize
        for name, kind, form, offset in PER_INSTANCE:
            if name in shader:
                location = shader[name].location  # type: ignore[union-attr]
                array.bind(
                    location, kind, self._rows, form, offset=start + offset,
                    stride=SURFEL_INSTANCE.itemsize, divisor=1,
                )  # fmt: skip
        return array


class _Patches(OnGpu):
    """Triangles of one material: each patch has corners of its own, which know its steps."""

    def __init__(self, ctx: moderngl.Context, one: SurfelPatches) -> None:
        arc = np.repeat(np.arange(len(one.arcs)), np.diff(one.first))
        key = (arc[:, None].astype(np.int64) << 32) | one.faces
        unique, index = np.unique(key, return_inverse=True)
        arc = unique >> 32
        corners = np.empty((len(unique), 4), np.int32)
        corners[:, 0] = unique & 0xFFFFFFFF
        corners[:, 1], corners[:, 2] = one.arcs.below[arc], one.arcs.above[arc]
        corners[:, 3] = one.arcs.number[arc]
        self.corners = ctx.buffer(corners.tobytes())
        self.indices = ctx.buffer(index.astype(np.uint32).tobytes())

    def release(self) -> None:
        self.corners.release()
        self.indices.release()


def _data_texture(ctx: moderngl.Context, rows: SingleArray) -> moderngl.Texture:
    """Rows of whole texels, (n, 4 k) float32, as RGBA32F."""
    height = max(-(-rows.size // (4 * TEXELS_PER_ROW)), 1)
    texels = np.zeros((height, TEXELS_PER_ROW, 4), np.float32)
    texels.reshape(-1)[: rows.size] = rows.reshape(-1)
    texture = ctx.texture((TEXELS_PER_ROW, height), 4, texels, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def _atlas_texture(ctx: moderngl.Context, pixels: np.ndarray, *, srgb: bool) -> moderngl.Texture:
    height, width = pixels.shape[:2]
    texture = ctx.texture(
        (width, height), 4, np.ascontiguousarray(pixels),
        internal_format=SRGB8_ALPHA8 if srgb else None,
    )  # fmt: skip
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture
