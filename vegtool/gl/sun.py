"""Depth maps from the sun, drawn once for any number of pictures.

Leaves are cut out as they are seen, without mips, and throw shadows from both sides. The maps of
all points of the sun lie side by side in one texture, which any OpenGL can hold and read.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.context import OnGpu, check, describe, framebuffer_kept
from vegtool.gl.program import program
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.shadow import BIAS, SUNS, SunDepths, disc, projections

SIDE = 1024
"""Texels of a map: of a plant 15 m across, one is 15 mm."""
ACROSS = 4
"""Maps side by side."""
SUN_DEPTH = 5
"""Texture unit."""


class SunMaps(OnGpu):
    """What the sun sees of some plants, on the GPU. A context manager: leaving releases.

    casters: what throws shadows, plants and levels alike, cut out by their alpha. direction: (3,)
    towards the sun. suns: points of its disc; one throws sharp shadows. side: texels of a map.
    Raises CapabilityError where OpenGL cannot draw.
    """

    def __init__(
        self,
        casters: Sequence[PlantBuffers],
        direction: FloatArray,
        suns: int = SUNS,
        side: int = SIDE,
    ) -> None:
        self.ctx = casters[0].ctx
        self.direction: FloatArray = np.asarray(direction) / np.linalg.norm(direction)
        self.suns, self.across = suns, min(suns, ACROSS)
        self.side = min(side, describe(self.ctx).max_texture // self.across)
        low = np.min([c.plant.bounds[0] for c in casters], axis=0)
        high = np.max([c.plant.bounds[1] for c in casters], axis=0)
        self.center: FloatArray = (low + high) / 2
        self.radius = float(np.linalg.norm(high - low)) / 2 or 1.0
        # a texel free all around, so that what lies outside is lit
        half = self.radius * self.side / (self.side - 2)
        self.projection = projections(disc(self.direction, suns), half)
        self.texel_m = 2 * half / self.side
        rows = -(-suns // self.across)
        self.texture = self.ctx.depth_texture((self.across * self.side, rows * self.side))
        self.texture.compare_func = ""  # read as a number
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._draw(casters)

    def release(self) -> None:
        """Free it on the GPU."""
        self.texture.release()

    @property
    def defines(self) -> tuple[str, ...]:
        """What a program is to be made with that looks into these maps."""
        return f"SUNS {self.suns}", f"SUNS_ACROSS {self.across}"

    def use(self, shader: moderngl.Program, receiver: PlantBuffers) -> None:
        """Set the uniforms of shadow.glsl for a plant on which shadows fall."""
        self.texture.use(SUN_DEPTH)
        shader["sun_depth"] = SUN_DEPTH
        shader["sun_side"] = self.side
        matrices = [self._placed(matrix, receiver).T for matrix in self.projection]
        uniform = shader["to_sun"]
        assert isinstance(uniform, moderngl.Uniform)
        uniform.write(np.array(matrices, np.float32).tobytes())  # one matrix is no list of them
        shader["sun_texel"] = self.texel_m / receiver.scale
        shader["sun_bias"] = BIAS

    def read(self) -> SunDepths:
        """The maps as arrays."""
        width, height = self.texture.size
        whole = np.frombuffer(self.texture.read(), np.float32).reshape(height, width)
        rows = whole.reshape(-1, self.side, self.across, self.side).swapaxes(1, 2)
        depth = rows.reshape(-1, self.side, self.side)[: self.suns]
        return SunDepths(
            np.ascontiguousarray(depth),
            self.projection,
            self.center,
            self.direction,
            self.texel_m,
        )

    def _placed(self, matrix: FloatArray, buffers: PlantBuffers) -> FloatArray:
        """(4, 4) the same for positions as they were uploaded."""
        place = np.diag([buffers.scale, buffers.scale, buffers.scale, 1.0])
        place[:3, 3] = buffers.origin - self.center
        return np.asarray(matrix @ place)

    def _draw(self, casters: Sequence[PlantBuffers]) -> None:
        ctx, side = self.ctx, self.side
        to_clip = np.diag([2.0, 2.0, 2.0, 1.0])
        to_clip[:3, 3] = -1.0
        frame = ctx.framebuffer(depth_attachment=self.texture)
        with framebuffer_kept(ctx):
            frame.use()
            frame.clear(depth=1.0)
            ctx.enable_only(moderngl.DEPTH_TEST)
            for i, matrix in enumerate(self.projection):
                frame.viewport = (side * (i % self.across), side * (i // self.across), side, side)
                for caster in casters:
                    placed = tuple((to_clip @ self._placed(matrix, caster)).T.ravel())
                    self._draw_from(caster, placed)
            check(ctx)
        frame.release()

    def _draw_from(self, caster: PlantBuffers, placed: tuple[float, ...]) -> None:
        for group in caster.groups:
            plain = () if group.material.color_texture is not None else ("NO_COLOR_MAP",)
            shader = program(self.ctx, "camera.vert", "depth.frag", *plain)
            shader["view_projection"] = placed
            # no mips here: they lose leaves, and the shadow is to be theirs
            sharp = caster.minified(group, 1 / self.texel_m)
            caster.use(group, shader, point_sampled=sharp, full_size=True)
            array = caster.vertex_array(shader)
            array.render(vertices=3 * group.count, first=3 * group.first)
