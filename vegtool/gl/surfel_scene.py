"""Models of surfel billboards and the ground, drawn live."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.context import OnGpu
from vegtool.gl.draw import MSAA, Shot, pictured
from vegtool.gl.instances import INSTANCE, View
from vegtool.gl.landscape import Drawn, Frame, GroundMesh, Landscape
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_choice import SurfelFrame
from vegtool.gl.surfel_data import SurfelData
from vegtool.gl.surfel_draw import BOTH, Parts, draw_surfels
from vegtool.lighting.light import Light

NOTHING = Frame(np.zeros(0, INSTANCE), ())
"""Of other plants."""
NO_NOISE = (np.zeros((1, 1), np.uint8),)
"""Nothing fades."""


class SurfelScene(OnGpu):
    """Models on the GPU, and what they stand on. A context manager: leaving releases."""

    def __init__(
        self, ground: GroundMesh | None = None, *, ctx: moderngl.Context | None = None
    ) -> None:
        self._landscape = Landscape(NO_NOISE, ground, ctx=ctx)
        self.ctx = self._landscape.ctx
        self._samples = self.ctx.query(samples=True)
        self._models: list[SurfelBuffers] = []

    def add(self, data: SurfelData) -> None:
        """Upload one more."""
        self._models.append(SurfelBuffers(data, ctx=self.ctx))

    def release(self) -> None:
        """Free everything on the GPU."""
        for model in self._models:
            model.release()
        self._models.clear()
        self._landscape.release()

    @property
    def texture_bytes(self) -> int:
        """Of all models' textures, mips counted."""
        return sum(model.texture_bytes for model in self._models)

    def draw(
        self,
        frames: Sequence[SurfelFrame],
        shot: Shot,
        light: Light,
        view: View = "lit",
        *,
        samples: int = MSAA,
        wireframe: bool = False,
        palettes: Sequence[FloatArray] | None = None,
        parts: Parts = BOTH,
    ) -> Drawn:
        """Draw a frame of each model into the framebuffer in use, which is cleared and has depth.

        palettes: of each model, where they are painted. Triangles of what is returned are all that
        are sent. Else as `surfel_draw.draw_surfels`.
        """
        if view == "overdraw":
            self.ctx.enable_only(moderngl.BLEND)
            self.ctx.blend_func = moderngl.ONE, moderngl.ONE
        self.ctx.wireframe = wireframe
        draws = triangles = 0
        with self._samples:
            for number, (model, frame) in enumerate(zip(self._models, frames, strict=True)):
                palette = None if palettes is None else palettes[number]
                drawn = draw_surfels(
                    model, frame, shot, light, view, samples=samples, palette=palette, parts=parts
                )
                draws, triangles = draws + drawn[0], triangles + drawn[1]
        ground = self._landscape.draw(NOTHING, shot, light, view, wireframe=wireframe)
        return Drawn(
            draws + ground.draws,
            triangles + ground.triangles,
            self._samples.samples + ground.samples,
        )

    def picture(
        self, frames: Sequence[SurfelFrame], shot: Shot, light: Light, supersample: int = 1,
        samples: int = 0, parts: Parts = BOTH,
    ) -> Picture:  # fmt: skip
        """Frames as light and coverage, the ground too."""

        def render(part: Shot) -> None:
            self.draw(frames, part, light, samples=samples, parts=parts)

        return pictured(self.ctx, shot, render, supersample, samples)
