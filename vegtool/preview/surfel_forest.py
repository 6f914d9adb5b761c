"""Surfel billboards over triangles, chosen anew for every frame and drawn.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4.5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from time import perf_counter

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.context import OnGpu
from vegtool.gl.draw import MSAA
from vegtool.gl.landscape import GroundMesh
from vegtool.gl.surfel_choice import SurfelFrame, frame_of, instances, let_through, taken
from vegtool.gl.surfel_data import SurfelData
from vegtool.gl.surfel_draw import BOTH, Parts
from vegtool.gl.surfel_scene import SurfelScene
from vegtool.gl.window_client import Context
from vegtool.preview.eye import Eye
from vegtool.preview.palette import PALETTE
from vegtool.preview.scenery import AS_IT_IS, VIEWS, FrameStats, Look

LINEAR = PALETTE[:, :3] / 127.5
"""(10, 3) factors of light."""


class SurfelForest(OnGpu):
    """Models where they stand, and the ground, on the GPU. A context manager: leaving releases.

    data: a plant of each. epsilon: pixels, of each. foot: (n, 3) metres, of their origins.
    """

    def __init__(
        self, data: Sequence[SurfelData], epsilon: Sequence[float], foot: FloatArray,
        ground: GroundMesh | None = None,
    ) -> None:  # fmt: skip
        self.data, self.epsilon, self.foot = tuple(data), tuple(epsilon), foot
        self.ground, self.total = ground, len(foot)
        self._scene: SurfelScene | None = None

    def load(self, ctx: Context | None = None) -> Iterator[float]:
        """Upload everything; yields the share that is done."""
        self._scene = SurfelScene(self.ground, ctx=ctx)
        for number, data in enumerate(self.data):
            self._scene.add(data)
            yield (number + 1) / self.total

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._scene is not None:
            self._scene.release()
            self._scene = None

    @property
    def texture_bytes(self) -> int:
        """On the GPU."""
        return 0 if self._scene is None else self._scene.texture_bytes

    def draw(self, eye: Eye, size: tuple[int, int], look: Look = AS_IT_IS) -> FrameStats:
        """Draw into the framebuffer in use, and wait until that is done."""
        scene = self._loaded("draw")
        started = perf_counter()
        frames = self.choose(eye, size, look)
        chosen = perf_counter()
        parts = _parts(look)
        drawn = scene.draw(
            frames, eye.shot(*size), look.light, VIEWS.get(look.color, "painted"),
            wireframe=look.wireframe, palettes=self._palettes(look), parts=parts,
        )  # fmt: skip
        ended = perf_counter()
        billboards, triangles = self.counts(frames, parts)
        seen = sum(len(frame.rows) for frame in frames)
        return FrameStats(
            1, seen, self.total, seen, drawn.draws, triangles + 2 * billboards,
            drawn.samples // MSAA, look.detail,
            {"choose": chosen - started, "draw": ended - chosen},
            (f"{billboards:,} billboards, {triangles:,} triangles below them",),
        )  # fmt: skip

    def picture(
        self,
        eye: Eye,
        size: tuple[int, int],
        look: Look = AS_IT_IS,
        supersample: int = 1,
        samples: int = MSAA,
    ) -> Picture:
        """What `draw` draws, as light and coverage, the ground too."""
        scene, frames = self._loaded("picture"), self.choose(eye, size, look)
        return scene.picture(
            frames, eye.shot(*size), look.light, supersample, samples, _parts(look)
        )

    def choose(self, eye: Eye, size: tuple[int, int], look: Look) -> list[SurfelFrame]:
        """What may be drawn of each model; of those out of view, nothing."""
        planes, frames = eye.planes(*size), []
        for data, epsilon, foot in zip(self.data, self.epsilon, self.foot, strict=True):
            middle = foot + data.plant.center - eye.position
            apart = planes[:, :3] @ middle + planes[:, 3]
            seen = int((apart > -data.plant.radius).all())
            one = np.ones(seen)
            rows = instances(data, eye.position, foot[None][:seen], 0 * one, one)
            pixels = eye.focal_px(size[1]) * look.detail / epsilon
            frames.append(frame_of(data, rows, pixels))
        return frames

    def counts(self, frames: Sequence[SurfelFrame], parts: Parts = BOTH) -> tuple[int, int]:
        """How many billboards the shader lets through in all, and how many triangles below."""
        billboards = triangles = 0
        for data, frame in zip(self.data, frames, strict=True):
            for eye in frame.rows["eye"].astype(np.float64):
                steps = taken(data, eye, frame.pixels)
                if parts.billboards:
                    billboards += int(let_through(data.billboards, steps).sum())
                if parts.triangles:
                    triangles += sum(
                        int(np.diff(one.first)[let_through(one.arcs, steps)].sum())
                        for one in data.patches
                    )
        return billboards, triangles

    def _palettes(self, look: Look) -> list[FloatArray] | None:
        if look.color in VIEWS:
            return None
        if look.color == "by level":
            return [LINEAR] * self.total
        return [np.tile(LINEAR[n % len(LINEAR)], (len(LINEAR), 1)) for n in range(self.total)]

    def _loaded(self, what: str) -> SurfelScene:
        if self._scene is None:
            raise ValueError(f"SurfelForest.{what}: load it first")
        return self._scene


def _parts(look: Look) -> Parts:
    """Of a level that is held: 0 is what is drawn as triangles, all else what is not."""
    return BOTH if look.level is None else Parts(look.level > 0, look.level == 0)
