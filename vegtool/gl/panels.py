"""Two pictures of a landscape and their difference, side by side."""

from __future__ import annotations

import moderngl

from vegtool.gl.context import OnGpu
from vegtool.gl.program import program
from vegtool.gl.screen import Screen


class Panels(OnGpu):
    """A context manager: leaving releases."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._screens = Screen(ctx), Screen(ctx)
        self._shader = program(ctx, "screen.vert", "panels.frag")
        self._corners = ctx.vertex_array(self._shader, [])

    def release(self) -> None:
        """Free everything on the GPU."""
        for screen in self._screens:
            screen.release()
        self._corners.release()

    def begin(
        self, index: int, size: tuple[int, int], background: tuple[float, float, float]
    ) -> None:
        """Draw picture 0 or 1 from here on."""
        self._screens[index].begin(size, background)

    def end(self, index: int) -> None:
        """It is drawn."""
        self._screens[index].resolve()

    def show(self, size: tuple[int, int]) -> None:
        """Draw both and their difference into the framebuffer in use, of `size` pixels."""
        self.ctx.enable_only(moderngl.NOTHING)
        for unit, screen in enumerate(self._screens):
            screen.picture.use(unit)
        self._shader["first"], self._shader["second"] = 0, 1
        self._shader["width"] = self._screens[0].size[0]
        self._corners.render(moderngl.TRIANGLES, vertices=3)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
