"""What a camera sees, before any light falls on it: for those who do light in arrays."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from vegtool.arrays import FloatArray, IntArray, SingleArray
from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.draw import (
    ANISOTROPY,
    Shot,
    pixels_per_metre,
    placed,
    render_group,
    set_footprint,
    set_light,
    shader_of,
)
from vegtool.gl.pictures import BakedLight
from vegtool.gl.upload import PlantBuffers


@dataclass(frozen=True, eq=False)
class Seen:
    """The samples of a picture in which something is seen, n of them.

    at: (n, 2) int32 sample right and down, of `size`, width and height. face: (n,) int32 of the
    plant. color: (n, 3) linear albedo. normal: (n, 3) unit, turned to the viewer. position: (n, 3)
    metres; none where they were not asked for. side: (n, 3) unit normals of the faces, of the side
    that is seen. exposure: (n, 2) of the viewer's
    side and the other. transmission: (n,) share of light that passes through, times tint, (n, 3).
    """

    size: tuple[int, int]
    at: IntArray
    face: IntArray
    color: SingleArray
    normal: SingleArray
    position: FloatArray
    side: SingleArray
    exposure: SingleArray
    transmission: SingleArray
    tint: SingleArray

    def picture(self, values: FloatArray) -> SingleArray:
        """(h, w, c + 1) values (n, c) where they belong, and 1 where anything is seen."""
        width, height = self.size
        result = np.zeros((height, width, values.shape[1] + 1), np.float32)
        x, y = self.at.T
        result[y, x, :-1] = values
        result[y, x, -1] = 1.0
        return result


FORMATS = ("f4", "f2", "f2", "f4")
"""Of what surface.frag writes."""
_kept: WeakKeyDictionary[moderngl.Context, moderngl.Framebuffer] = WeakKeyDictionary()
"""The last target of each context, which grows."""


def surface(
    buffers: PlantBuffers,
    shot: Shot,
    supersample: int = 1,
    anisotropy: int = ANISOTROPY,
    footprint: float = 1.0,
    places: bool = True,
    lit: BakedLight | None = None,
) -> Seen:
    """What each sample of a picture shows; `supersample` of them per pixel and axis.

    footprint: mip-mapped textures are filtered as for pixels so many times as wide. places: whether
    positions are wanted. lit: light that goes into colours, 1 at most, with its shadows; without
    any, as of plants that are unlit, colours stay. Drawn in one piece. Raises CapabilityError where
    OpenGL cannot hold that.
    """
    ctx = buffers.ctx
    size = supersample * shot.width, supersample * shot.height
    samples_per_metre = supersample * pixels_per_metre(shot)
    frame = _target(ctx, size)
    shadows = None if lit is None else lit.shadows
    passing = any(m.transmission > 0 for m in buffers.plant.materials)
    with framebuffer_kept(ctx):
        frame.viewport = (0, 0, *size)
        frame.use()
        frame.clear(viewport=(0, 0, *size))
        ctx.enable_only(moderngl.DEPTH_TEST)
        for group in buffers.groups:
            shader = shader_of(buffers, group, "surface.frag", anisotropy, shadows)
            shader["view_projection"] = placed(buffers, shot)
            shader["first_face"] = group.first
            set_footprint(shader, supersample * footprint)
            if lit is not None:
                set_light(shader, buffers, lit.light, shadows)
            buffers.use(group, shader, point_sampled=buffers.minified(group, samples_per_metre))
            render_group(buffers, group, shader)
        ctx.disable(moderngl.CULL_FACE)
        check(ctx)
        planes = [_read(frame, i, size) for i in range(4 if places or passing else 3)]
    y, x = np.nonzero(planes[0][..., 3])
    color, normal, side, *rest = (plane[y, x].astype(np.float32) for plane in planes)
    position = rest[0] if rest else np.zeros((0, 4), np.float32)
    face = buffers.face_order[color[:, 3].astype(np.int32) - 1]
    tints = np.array([m.transmission_tint for m in buffers.plant.materials], np.float32)
    return Seen(
        size,
        np.stack([x, y], axis=1).astype(np.int32),
        face,
        color[:, :3],
        normal[:, :3],
        position[:, :3].astype(np.float64) * buffers.scale + buffers.origin,
        side[:, :3],
        np.stack([normal[:, 3], side[:, 3]], axis=1),
        position[:, 3] if passing else np.zeros(len(face), np.float32),
        tints[buffers.plant.face_material[face]],
    )


def _target(ctx: moderngl.Context, size: tuple[int, int]) -> moderngl.Framebuffer:
    """What is drawn into: at least `size` samples."""
    kept = _kept.get(ctx)
    if kept is not None:
        if kept.width >= size[0] and kept.height >= size[1]:
            return kept
        size = max(kept.width, size[0]), max(kept.height, size[1])
        for attached in (*kept.color_attachments, kept.depth_attachment, kept):
            attached.release()
    textures = [ctx.texture(size, 4, dtype=dtype) for dtype in FORMATS]
    _kept[ctx] = ctx.framebuffer(textures, ctx.depth_renderbuffer(size))
    return _kept[ctx]


def _read(frame: moderngl.Framebuffer, attachment: int, size: tuple[int, int]) -> np.ndarray:
    """(h, w, 4) of the lower left corner, top row first."""
    dtype = FORMATS[attachment]
    data = frame.read((0, 0, *size), 4, attachment=attachment, dtype=dtype)
    return np.frombuffer(data, dtype).reshape(size[1], size[0], 4)[::-1]
