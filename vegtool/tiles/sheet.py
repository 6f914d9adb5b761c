"""Levels of several plants as one drawing: one material, whose textures show all their pictures.

What has no texture shows a white block in the colours of its vertices, as hybrid levels do
(lod.level_triangles). Where any level is drawn from one side alone, so is all: what has two sides
then stands there twice, as in the pairs of quads of a level with different sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray, IntArray
from vegtool.baking.pack import pack
from vegtool.errors import UsageError
from vegtool.lod import Triangles
from vegtool.plant import Material, Plant, Texture
from vegtool.srgb import linear_from_srgb, srgb_from_linear
from vegtool.tangents import tangents
from vegtool.tiles.variation import BRIGHTNESS, WARMTH

GUTTER = 4
"""Texels between pictures, which go on in it: a client's second mip still keeps them apart."""
WHITE = 8
"""Texels: side of the block that has no picture."""
FLAT = (128, 128, 255, 255)
"""A normal that points straight out."""
BRIGHTEST = (1 + BRIGHTNESS) * (1 + WARMTH)
"""A linear factor that no plant's tint is above. Vertex colours are 1 at most, so those of merged
groups are divided by it, and what a sheet shows is so much brighter; white, which cannot be, is
drawn at 87 %."""
OUTSIDE = 1e-3
"""Of a picture's side, how far beyond it texture coordinates may lie, by rounding."""


Key = tuple[int, int, bytes, bool, float]


@dataclass(frozen=True, eq=False)
class Sheet:
    """What a merged group is drawn with. Its colours, of pictures and of parts, are BRIGHTEST times
    those of the levels. Its pictures are painted when they are asked for.

    size: (2,) texels across and down. pictured: materials whose pictures it shows. rect: (p + 1, 4)
    int32 where, x, y, width and height; the last is white. with_normals: whether any level has
    normal textures. parts: each level as triangles whose texture coordinates are the sheet's.
    textured: (n,) bool, parts that show any picture. double_sided, unlit: of the one material.
    """

    size: IntArray
    pictured: tuple[Material, ...]
    rect: IntArray
    with_normals: bool
    parts: tuple[Triangles, ...]
    textured: npt.NDArray[np.bool_]
    double_sided: bool
    unlit: bool = False

    @cached_property
    def color(self) -> ByteArray:
        """(h, w, 4) uint8, sRGB, straight alpha, cut off at one half."""
        color = np.zeros((*self.size[::-1], 4), np.uint8)
        for rect, material in zip(self.rect, self.pictured, strict=False):
            _paste(color, rect, _picture(material))
        _paste(color, self.rect[-1], np.full((WHITE, WHITE, 4), 255, np.uint8))
        return color

    @cached_property
    def normal(self) -> ByteArray | None:
        """(h, w, 4) uint8 tangent space, or None where no level has one."""
        if not self.with_normals:
            return None
        normal = np.full((*self.size[::-1], 4), FLAT, np.uint8)
        for rect, material in zip(self.rect, self.pictured, strict=False):
            if material.normal_texture is not None:
                shape = int(rect[3]), int(rect[2])
                _paste(normal, rect, _resized(material.normal_texture.pixels, shape))
        return normal

    def material(self, name: str) -> Material:
        """Of everything that is drawn with the sheet."""
        normal = None if self.normal is None else Texture(f"{name}_normal", self.normal)
        return Material(
            name,
            color_texture=Texture(f"{name}_color", self.color),
            normal_texture=normal,
            alpha_mode="mask",
            double_sided=self.double_sided,
            unlit=self.unlit,
            role="leaf",
        )


def sheet_of(levels: Sequence[Plant], max_side: int) -> Sheet:
    """One sheet for these levels, in their order.

    Raises UsageError where the pictures do not fit into a square of `max_side` texels, and where
    light is in the colours of some levels and not of others.
    """
    unlit = {material.unlit for plant in levels for material in _used(plant)}
    if len(unlit) > 1:
        names = sorted({p.source or p.name for p in levels if any(m.unlit for m in _used(p))})
        raise UsageError(
            f"{', '.join(names)}: light is in the colours, and not in those of other species, with "
            "which they are to be merged; convert all with --prelit, or none"
        )
    pictured = {_key(m): m for plant in levels for m in _used(plant) if m.color_texture is not None}
    sizes = [m.color_texture.pixels.shape[1::-1] for m in pictured.values() if m.color_texture]
    packing = pack(np.array([*sizes, (WHITE, WHITE)], np.int32), GUTTER, max_side)
    if max(packing.width, packing.height) > max_side:
        raise UsageError(
            f"--max-texture: expected room for the pictures of {len(levels)} levels, "
            f"{packing.width} x {packing.height} texels; got {max_side}"
        )
    normals = any(m.normal_texture for plant in levels for m in _used(plant))
    place = dict(zip(pictured, packing.rect, strict=False))
    double_sided = all(m.double_sided for plant in levels for m in _used(plant))
    size = np.array([packing.width, packing.height], np.int32)
    parts = tuple(
        _part(plant, place, packing.rect[-1], size, double_sided, normals) for plant in levels
    )
    textured = np.array([any(m.color_texture for m in _used(plant)) for plant in levels])
    return Sheet(
        size, tuple(pictured.values()), packing.rect, normals, parts, textured, double_sided,
        unlit == {True},
    )  # fmt: skip


def _used(plant: Plant) -> list[Material]:
    return [plant.materials[index] for index in np.unique(plant.face_material)]


def _key(material: Material) -> Key:
    """What the picture of a material is made of."""
    masked = material.alpha_mode == "mask"
    return (
        id(material.color_texture), id(material.normal_texture), material.base_color.tobytes(),
        masked, material.alpha_cutoff if masked else 0.0,
    )  # fmt: skip


def _picture(material: Material) -> ByteArray:
    """What a material shows, as a sheet has it: BRIGHTEST times as bright, cut off at one half."""
    assert material.color_texture is not None
    pixels, factor = material.color_texture.pixels, material.base_color
    result = np.empty_like(pixels)
    for channel in range(3):
        light = linear_from_srgb(np.arange(256) / 255) * factor[channel] * BRIGHTEST
        table = np.rint(255 * srgb_from_linear(np.minimum(light, 1.0))).astype(np.uint8)
        result[..., channel] = table[pixels[..., channel]]
    result[..., 3] = 255
    if material.alpha_mode == "mask":
        # what passes at the material's cutoff passes at one half, and mips keep in between
        shown = pixels[..., 3] * factor[3] / max(material.alpha_cutoff, 1 / 255) / 2
        result[..., 3] = np.clip(np.rint(shown), 0, 255)
    return result


def _paste(into: ByteArray, rect: IntArray, pixels: ByteArray) -> None:
    """A picture at its place, its outermost texels carried on into the gutter."""
    x, y, width, height = (int(v) for v in rect)
    rows = np.clip(np.arange(-GUTTER, height + GUTTER), 0, height - 1)
    columns = np.clip(np.arange(-GUTTER, width + GUTTER), 0, width - 1)
    into[y - GUTTER : y + height + GUTTER, x - GUTTER : x + width + GUTTER] = pixels[rows][
        :, columns
    ]


def _resized(pixels: ByteArray, shape: tuple[int, ...]) -> ByteArray:
    """A picture as large as another, by nearest texels; of a level both are."""
    rows, columns = (
        np.arange(wanted) * have // wanted
        for wanted, have in zip(shape[:2], pixels.shape[:2], strict=True)
    )
    return np.asarray(pixels[rows][:, columns])


def _part(
    plant: Plant,
    place: dict[Key, IntArray],
    white: IntArray,
    size: IntArray,
    double_sided: bool,
    with_tangents: bool,
) -> Triangles:
    """A level in the sheet's terms."""
    positions, normals, uvs, colors, faces = [], [], [], [], []
    first = 0
    for index in np.unique(plant.face_material):
        material = plant.materials[index]
        of_material = plant.faces[plant.face_material == index]
        vertices, corners = np.unique(of_material, return_inverse=True)
        corners = corners.reshape(-1, 3)
        color = np.ones((len(vertices), 4)) if plant.colors is None else plant.colors[vertices]
        if material.color_texture is None:
            uv = np.tile((white[:2] + white[2:] / 2) / size, (len(vertices), 1))
            color = np.minimum(color * material.base_color * BRIGHTEST, 1.0)
            color[:, 3] = 1.0
        else:
            own = plant.uvs[vertices]
            if own.min() < -OUTSIDE or own.max() > 1 + OUTSIDE:
                raise UsageError(
                    f"{plant.source or plant.name}: repeats its textures, which cannot be merged; "
                    "convert it (vegtool convert), and its levels can"
                )
            rect = place[_key(material)]
            uv = (rect[:2] + np.clip(own, 0, 1) * rect[2:]) / size
        sides = [(plant.normals[vertices], corners)]
        if material.double_sided and not double_sided:
            sides.append((-plant.normals[vertices], corners[:, ::-1]))
        for normal, side in sides:
            positions.append(plant.positions[vertices])
            normals.append(normal)
            uvs.append(uv)
            colors.append(color)
            faces.append(side + first)
            first += len(vertices)
    found = [np.concatenate(v) for v in (positions, normals, uvs, colors)]
    indices = np.concatenate(faces).astype(np.int32)
    frame: FloatArray = np.zeros((len(found[0]), 4))
    if with_tangents:
        frame, of, indices = tangents(found[0], found[1], found[2], indices)
        found = [values[of] for values in found]
    return Triangles(found[0], found[1], frame, found[2], indices.ravel(), found[3])
