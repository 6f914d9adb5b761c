"""What a landscape is drawn into: multisampled half-float light, resolved to sRGB bytes.

The same for a window and without one, so that both show the same.
"""

from __future__ import annotations

import moderngl
import numpy as np

from vegtool.arrays import ByteArray
from vegtool.errors import CapabilityError
from vegtool.gl.context import OnGpu, context, describe
from vegtool.gl.draw import MSAA
from vegtool.gl.program import program


class Screen(OnGpu):
    """Of any size, which may change from frame to frame. A context manager: leaving releases."""

    def __init__(self, ctx: moderngl.Context | None = None, samples: int = MSAA) -> None:
        self.ctx = ctx or context()
        if samples > self.ctx.max_samples:
            raise CapabilityError(
                f"a frame needs {samples}x multisampling; {describe(self.ctx).renderer} does "
                f"{self.ctx.max_samples}x. Use a driver that can, such as Mesa 20.2 or newer."
            )
        self.samples = samples
        self.size = (0, 0)
        self._owned: list[moderngl.Framebuffer | moderngl.Texture | moderngl.Renderbuffer] = []
        self._shader = program(self.ctx, "screen.vert", "present.frag")
        self._corners = self.ctx.vertex_array(self._shader, [])

    def release(self) -> None:
        """Free everything on the GPU."""
        self._free()
        self._corners.release()

    def begin(self, size: tuple[int, int], background: tuple[float, float, float]) -> None:
        """Draw into it from here on: `size` pixels of a linear colour, with a depth test."""
        self._fit(size)
        self._drawn.use()
        self._drawn.clear(*background, 1.0)
        self.ctx.enable_only(moderngl.DEPTH_TEST)

    def resolve(self) -> moderngl.Framebuffer:
        """Samples to pixels, their mean in linear light, as sRGB; returns what holds them."""
        self._pixels.use()
        self.ctx.enable_only(moderngl.NOTHING)
        self._color.use(0)
        self._shader["drawn"] = 0
        self._shader["samples"] = self.samples
        self._corners.render(moderngl.TRIANGLES, vertices=3)
        return self._pixels

    @property
    def picture(self) -> moderngl.Texture:
        """What was resolved last: sRGB, lowest row first."""
        return self._resolved

    def read(self) -> ByteArray:
        """(h, w, 3) uint8 sRGB, top row first, of what was resolved last."""
        width, height = self.size
        data = np.frombuffer(self._pixels.read(components=4), np.uint8)
        return np.ascontiguousarray(data.reshape(height, width, 4)[::-1, :, :3])

    def _fit(self, size: tuple[int, int]) -> None:
        wanted = (max(size[0], 1), max(size[1], 1))
        if wanted == self.size:
            return
        ctx, old = self.ctx, self._owned
        try:
            color = ctx.texture(wanted, 4, dtype="f2", samples=self.samples)
            depth = ctx.depth_renderbuffer(wanted, samples=self.samples)
            drawn = ctx.framebuffer([color], depth)
            resolved = ctx.texture(wanted, 4)
            pixels = ctx.framebuffer([resolved])
        except moderngl.Error as error:
            _ = ctx.error  # told here, and not to what is drawn next
            raise CapabilityError(
                f"{describe(ctx).renderer} cannot draw a frame of {wanted[0]} x {wanted[1]} pixels "
                f"({error}); make it smaller"
            ) from error
        self._drawn, self._pixels = drawn, pixels
        self._color, self._resolved = color, resolved
        self._owned = [drawn, color, depth, pixels, resolved]
        self.size = wanted
        drawn.use()  # what is released must not be in use
        for made in old:
            made.release()

    def _free(self) -> None:
        for made in self._owned:
            made.release()
        self._owned.clear()
        self.size = (0, 0)
