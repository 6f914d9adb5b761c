"""A plant on the GPU: uploaded once, drawn any number of times.

Colour textures are sRGB8_ALPHA8, so that filtering happens in linear light. They have no mips
unless asked for: mips lose the coverage of alpha-tested leaves (DESIGN section 4), so bakes and
truths supersample instead, and only a picture of "what a client shows" wants them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import moderngl
import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray
from vegtool.gl.context import OnGpu, context, describe
from vegtool.gl.mipmaps import mip_levels
from vegtool.plant import Material, Plant, Texture

Owned = TypeVar("Owned", moderngl.Buffer, moderngl.Texture, moderngl.VertexArray)

Textures = dict[tuple[int, bool, float | None], moderngl.Texture]
"""By the id of a Texture, whether it is sRGB, and its cutoff."""

SRGB8_ALPHA8 = 0x8C43
VERTEX_FLOATS = 12
"""Per vertex: position, u, normal, v, colour (4); three vec4, as attributes or as texels. A fourth
holds the exposure, where a plant has one."""
ATTRIBUTES = {"in_position_u": 4, "in_normal_v": 4, "in_color": 4, "in_exposure": 2}
"""Of vertices, and how many floats of a vec4 each takes."""
LIGHT_MAP = 4
"""Texture unit."""
VERTICES_PER_ROW = 1024
"""Of the vertex data texture, or as many more as keep its height below the driver's limit."""
MINIFIED = 4.0
"""Texels per sample, along each axis, from which samples take one texel instead of four."""


@dataclass(frozen=True)
class MaterialGroup:
    """The faces of one material: `count` faces from `first` on, in the order of `face_order`.

    number: the material's index in the plant.
    """

    number: int
    material: Material
    first: int
    count: int
    color_map: moderngl.Texture
    normal_map: moderngl.Texture | None
    light_map: moderngl.Texture | None


class PlantBuffers(OnGpu):
    """A plant's vertices, indices and textures on the GPU. A context manager: leaving releases.

    origin, scale: (3,) and metres: what is uploaded (float32) is relative to the origin, in units
    of the scale, the plant's radius; so a matrix or a billboard has to be as well. A plant far from
    the origin, or of another size, is drawn with the same roundings.
    face_order: (f,) the plant's faces in the order of the index buffer, material by material.
    groups: one per material that has faces.
    mipmaps: give textures mips, as a client does, and leave the colour under alpha 0 as it is.
    keep_coverage: mips of cut-out materials that show as much, which no client makes; of all, a tap
    takes the nearest, which is a quarter faster than the mean of two.
    shared: textures that several plants have, all with mipmaps or all without; who gives them keeps
    their images and releases them.
    """

    def __init__(
        self,
        plant: Plant,
        *,
        mipmaps: bool = False,
        keep_coverage: bool = False,
        shared: Textures | None = None,
        ctx: moderngl.Context | None = None,
    ) -> None:
        self.plant = plant
        self.ctx = ctx or context()
        self.origin: FloatArray = plant.center
        self.scale: float = plant.radius or 1.0
        self.face_order = np.argsort(plant.face_material, kind="stable").astype(np.int32)
        self.mipmaps, self.keep_coverage = mipmaps, keep_coverage
        mips = moderngl.LINEAR_MIPMAP_NEAREST if keep_coverage else moderngl.LINEAR_MIPMAP_LINEAR
        self._filter = (mips if mipmaps else moderngl.LINEAR, moderngl.LINEAR)
        self._textures: Textures = {} if shared is None else shared
        self._shares = shared is not None
        self._owned: list[moderngl.Buffer | moderngl.Texture | moderngl.VertexArray] = []
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        self.groups = self._material_groups()

    def release(self) -> None:
        """Free everything on the GPU."""
        for owned in reversed(self._owned):
            owned.release()
        self._owned.clear()
        self._arrays.clear()
        if not self._shares:
            self._textures.clear()

    @property
    def texture_bytes(self) -> int:
        """Of all textures, their mips counted."""
        third = 3 if self.mipmaps else 0
        sizes = (4 * t.width * t.height for t in self._textures.values())
        return sum(size + (size // third if third else 0) for size in sizes)

    @cached_property
    def indices(self) -> moderngl.Buffer:
        """Three uint32 per face, material by material."""
        ordered = self.plant.faces[self.face_order].astype(np.uint32)
        return self._own(self.ctx.buffer(ordered.tobytes()))

    @cached_property
    def vertices(self) -> moderngl.Buffer:
        """Vec4 after vec4 per vertex: ATTRIBUTES, the exposure where there is one."""
        return self._own(
            self.ctx.buffer(vertex_data(self.plant, self.origin, self.scale).tobytes())
        )

    @cached_property
    def vertex_texture(self) -> moderngl.Texture:
        """The same vec4 per vertex as RGBA32F texels, whole vertices to a row."""
        data = vertex_data(self.plant, self.origin, self.scale)
        limit = describe(self.ctx).max_texture
        width = data.shape[1] // 4 * max(VERTICES_PER_ROW, -(-len(data) // limit))
        rows = max(1, -(-data.size // (4 * width)))
        texels = np.zeros((rows, width, 4), dtype=np.float32)
        texels.reshape(-1)[: data.size] = data.reshape(-1)
        texture = self.ctx.texture((width, rows), 4, texels, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return self._own(texture)

    @cached_property
    def texels_per_metre(self) -> FloatArray:
        """(m,) per material: density of its colour texture on the surface, the root of the ratio
        of areas; 0 where there is no texture or no area."""
        plant = self.plant
        uv = plant.uvs[plant.faces]
        (du1, dv1), (du2, dv2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
        materials = len(plant.materials)
        mapped = np.bincount(plant.face_material, np.abs(du1 * dv2 - du2 * dv1) / 2, materials)
        surface = np.bincount(plant.face_material, plant.face_areas, materials)
        images = [m.color_texture for m in plant.materials]
        pixels = np.array([0.0 if i is None else np.prod(i.pixels.shape[:2]) for i in images])
        ratio = np.divide(mapped * pixels, surface, out=np.zeros(materials), where=surface > 0)
        return np.asarray(np.sqrt(ratio))

    def minified(self, group: MaterialGroup, samples_per_metre: float) -> bool:
        """Whether texels lie so dense that filtering averages a sixteenth of them at most, and
        costs a third more for it; never with mips."""
        if self.mipmaps or group.material.color_texture is None:
            return False
        return bool(self.texels_per_metre[group.number] > MINIFIED * samples_per_metre)

    def vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """The plant as input of `program`, which declares some of ATTRIBUTES."""
        if program not in self._arrays:
            here = list(ATTRIBUTES)[: 3 + (self.plant.exposure is not None)]
            names = [name for name in here if name in program]
            layout = " ".join(_layout(ATTRIBUTES[n] if n in names else 0) for n in here)
            self._arrays[program] = self._own(
                self.ctx.vertex_array(program, [(self.vertices, layout, *names)], self.indices)
            )
        return self._arrays[program]

    def use(
        self,
        group: MaterialGroup,
        program: moderngl.Program,
        *,
        point_sampled: bool = False,
        full_size: bool = False,
    ) -> None:
        """Bind a material's textures (units 0, 1 and LIGHT_MAP) and set the uniforms of
        `material.glsl` and `lit.glsl`.

        point_sampled: take the nearest texel of the colour texture, unfiltered. full_size: take no
        smaller mips of it.
        """
        material = group.material
        plain = moderngl.NEAREST if point_sampled else moderngl.LINEAR
        whole = point_sampled or full_size
        group.color_map.filter = (plain, plain) if whole else self._filter
        group.color_map.use(0)
        if group.normal_map is not None:
            group.normal_map.use(1)
        if group.light_map is not None:
            group.light_map.use(LIGHT_MAP)
        cutoff = material.alpha_cutoff if material.alpha_mode == "mask" else 0.0
        values = {
            "color_map": 0,
            "normal_map": 1,
            "base_color": tuple(material.base_color),
            "alpha_cutoff": cutoff,
            "normal_scale": material.normal_scale,
            "light_map": LIGHT_MAP,
            "transmission": material.transmission,
            "transmission_tint": tuple(material.transmission_tint),
        }
        for name, value in values.items():
            if name in program:  # the compiler drops what a variant does not read
                program[name] = value

    def _material_groups(self) -> tuple[MaterialGroup, ...]:
        counts = np.bincount(self.plant.face_material, minlength=len(self.plant.materials))
        firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        return tuple(
            MaterialGroup(
                number,
                material,
                int(first),
                int(count),
                self._texture(material.color_texture, True, _cutoff(material)),
                self._plain(material.normal_texture),
                self._plain(material.light_texture),
            )
            for number, (material, first, count) in enumerate(
                zip(self.plant.materials, firsts, counts, strict=True)
            )
            if count
        )

    def _plain(self, image: Texture | None) -> moderngl.Texture | None:
        return None if image is None else self._texture(image, False, None)

    def _texture(self, image: Texture | None, srgb: bool, cutoff: float | None) -> moderngl.Texture:
        key = (id(image), srgb, cutoff)
        if key not in self._textures:
            pixels = np.full((1, 1, 4), 255, np.uint8) if image is None else image.pixels
            if cutoff is not None and not self.mipmaps:
                pixels = bled_under_alpha(pixels)
            height, width = pixels.shape[:2]
            limit = describe(self.ctx).max_texture
            while max(height, width) > limit:  # keep every second texel: rare, and never an error
                pixels = np.ascontiguousarray(pixels[::2, ::2])
                height, width = pixels.shape[:2]
            texture = self.ctx.texture(
                (width, height),
                4,
                np.ascontiguousarray(pixels),
                internal_format=SRGB8_ALPHA8 if srgb else None,
            )
            if self.mipmaps:
                texture.build_mipmaps()  # allocates them
                kept = cutoff if self.keep_coverage else None
                for level, smaller in enumerate(mip_levels(pixels, srgb, kept), start=1):
                    texture.write(np.ascontiguousarray(smaller), level=level)
            texture.filter = self._filter
            self._textures[key] = texture if self._shares else self._own(texture)
        return self._textures[key]

    def _own(self, made: Owned) -> Owned:
        self._owned.append(made)
        return made


def _cutoff(material: Material) -> float | None:
    """The least alpha of the texture that is shown; None for opaque materials."""
    if material.alpha_mode != "mask":
        return None
    return float(material.alpha_cutoff / max(material.base_color[3], 1e-6))


def vertex_data(plant: Plant, origin: FloatArray, scale: float) -> npt.NDArray[np.float32]:
    """(v, 12) float32: position relative to origin, in units of scale, u, normal, v, linear colour
    factors; (v, 16) with the exposure and two floats of nothing, where there is one."""
    extra = 0 if plant.exposure is None else 4
    data = np.zeros((len(plant.positions), VERTEX_FLOATS + extra), dtype=np.float32)
    data[:, 0:3] = (plant.positions - origin) / scale
    data[:, 3] = plant.uvs[:, 0]
    data[:, 4:7] = plant.normals
    data[:, 7] = plant.uvs[:, 1]
    data[:, 8:12] = 1.0 if plant.colors is None else plant.colors
    if plant.exposure is not None:
        data[:, 12:14] = plant.exposure
    return data


def _layout(floats: int) -> str:
    """How moderngl is told of a vec4 of which the first `floats` are read."""
    return " ".join([f"{floats}f"] * bool(floats) + [f"{4 * (4 - floats)}x"] * (floats < 4))


def rewritten(buffer: moderngl.Buffer, rows: np.ndarray) -> moderngl.Buffer:
    """A buffer with other rows in it, of one frame after another: the same, or a larger one where
    that is too small, which is then released."""
    if buffer.size < rows.nbytes:
        ctx = buffer.ctx
        buffer.release()
        buffer = ctx.buffer(reserve=rows.nbytes * 3 // 2, dynamic=True)
    buffer.orphan(buffer.size)
    buffer.write(np.ascontiguousarray(rows))
    return buffer


def bled_under_alpha(pixels: ByteArray) -> ByteArray:
    """The image with the first ring of texels under alpha 0 given their neighbours' mean colour.

    One ring is all that bilinear filtering without mips can reach, and it costs milliseconds.
    """
    height, width = pixels.shape[:2]
    clear = pixels[..., 3] == 0
    if not clear.any() or clear.all():
        return pixels
    shown = np.pad(~clear, 1, mode="wrap")
    steps = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]
    touched = np.zeros_like(clear)
    for dy, dx in steps:
        touched |= shown[1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]
    rows, columns = np.nonzero(clear & touched)
    total = np.zeros((len(rows), 3), dtype=np.int32)
    count = np.zeros(len(rows), dtype=np.int32)
    for dy, dx in steps:
        y, x = (rows + dy) % height, (columns + dx) % width
        weight = ~clear[y, x]
        total += pixels[y, x, :3] * weight[:, None]
        count += weight
    result = np.array(pixels)
    result[rows, columns, :3] = (total + count[:, None] // 2) // count[:, None]
    return result
