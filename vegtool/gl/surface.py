"""What a camera sees, before any light falls on it: for those who do light in arrays."""

from __future__ import annotations

from dataclasses import dataclass

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
    shader_of,
)
from vegtool.gl.upload import PlantBuffers


@dataclass(frozen=True, eq=False)
class Seen:
    """The samples of a picture in which something is seen, n of them.

    at: (n, 2) int32 sample right and down, of `size`, width and height. face: (n,) int32 of the
    plant. color: (n, 3) linear albedo. normal: (n, 3) unit, turned to the viewer. position: (n, 3)
    metres. side: (n, 3) unit normals of the faces themselves. exposure: (n, 2) of the viewer's
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


def surface(
    buffers: PlantBuffers,
    shot: Shot,
    supersample: int = 1,
    anisotropy: int = ANISOTROPY,
    footprint: float = 1.0,
) -> Seen:
    """What each sample of a picture shows; `supersample` of them per pixel and axis.

    footprint: mip-mapped textures are filtered as for pixels so many times as wide. Drawn in one
    piece. Raises CapabilityError where OpenGL cannot hold that.
    """
    ctx = buffers.ctx
    size = supersample * shot.width, supersample * shot.height
    samples_per_metre = supersample * pixels_per_metre(shot)
    textures = [ctx.texture(size, 4, dtype="f4") for _ in range(4)]
    depth = ctx.depth_renderbuffer(size)
    frame = ctx.framebuffer(textures, depth)
    try:
        with framebuffer_kept(ctx):
            frame.use()
            frame.clear()
            ctx.enable_only(moderngl.DEPTH_TEST)
            for group in buffers.groups:
                shader = shader_of(buffers, group, "surface.frag", anisotropy)
                shader["view_projection"] = placed(buffers, shot)
                shader["first_face"] = group.first
                set_footprint(shader, supersample * footprint)
                buffers.use(group, shader, point_sampled=buffers.minified(group, samples_per_metre))
                render_group(buffers, group, shader)
            ctx.disable(moderngl.CULL_FACE)
            check(ctx)
        planes = [
            np.frombuffer(t.read(), np.float32).reshape(size[1], size[0], 4)[::-1] for t in textures
        ]
    finally:
        frame.release()
        depth.release()
        for texture in textures:
            texture.release()
    y, x = np.nonzero(planes[0][..., 3])
    color, normal, position, side = (plane[y, x] for plane in planes)
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
        np.stack([position[:, 3], side[:, 3]], axis=1),
        normal[:, 3],
        tints[buffers.plant.face_material[face]],
    )
