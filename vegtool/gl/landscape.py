"""A landscape drawn live: ground and plants, each kind of plant many times at once.

What is drawn is decided elsewhere and comes as rows of INSTANCE and batches of them; nothing here
knows of levels, tiles or distances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray, Picture
from vegtool.elements import Elements
from vegtool.gl.context import OnGpu, context
from vegtool.gl.draw import ANISOTROPY, Shot, pictured, set_footprint, set_light
from vegtool.gl.instances import (
    INSTANCE,
    NOISE,
    OVERDRAW_STEP,
    InstancedPlant,
    View,
    instance_program,
)
from vegtool.gl.pace import Pace
from vegtool.gl.points import SurfelSetBuffers
from vegtool.gl.program import program
from vegtool.gl.upload import Textures, rewritten
from vegtool.lighting.light import Light
from vegtool.plant import Plant
from vegtool.surfel_set import SurfelSet

GROUND_VERTEX = ("in_position", "in_normal")
GROUND_COLOR = (0.105, 0.125, 0.055)
"""Linear: grown-over soil."""


@dataclass(frozen=True)
class Batch:
    """Instances of one plant that are drawn by one call for each of its materials.

    plant: index that the landscape gave it. first, count: rows. share: the most that any of them
    keeps of its elements. fading: whether texels are hidden of some.
    """

    plant: int
    first: int
    count: int
    share: float
    fading: bool = False


@dataclass(frozen=True, eq=False)
class PointBatch:
    """Surfels of one plant at many places. surfels: index that the landscape gave them. rows: (n,)
    POINT_INSTANCE, relative to the eye. prefix: (n,) int32, how many are drawn at each."""

    surfels: int
    rows: np.ndarray
    prefix: IntArray


@dataclass(frozen=True, eq=False)
class Frame:
    """What is drawn of a landscape from one eye. rows: (n,) INSTANCE, relative to the eye; batches
    nearest first, which hides most at least cost. points: after those."""

    rows: np.ndarray
    batches: tuple[Batch, ...]
    points: tuple[PointBatch, ...] = ()


@dataclass(frozen=True)
class Drawn:
    """What a frame was made of, ground included: calls, triangles, samples that passed the depth
    test, and surfels."""

    draws: int
    triangles: int
    samples: int
    surfels: int = 0


@dataclass(frozen=True, eq=False)
class GroundMesh:
    """positions: (v, 3) float64 metres relative to origin, (3,). normals: (v, 3). faces: (f, 3)."""

    origin: FloatArray
    positions: FloatArray
    normals: FloatArray
    faces: IntArray


class Landscape(OnGpu):
    """Plants and ground on the GPU. A context manager: leaving releases.

    noise: by mip level, (s, s) uint8, what reveals texels (preview/reveal.py). pixels_fade: fades
    go by pixels of the screen, not by texels.
    """

    def __init__(
        self,
        noise: Sequence[ByteArray],
        ground: GroundMesh | None = None,
        *,
        pixels_fade: bool = False,
        ctx: moderngl.Context | None = None,
    ) -> None:
        self.ctx = ctx or context()
        self._plants: dict[int, InstancedPlant] = {}
        self._surfels: dict[int, SurfelSetBuffers] = {}
        self._added = self._sets = 0
        self.fading = "pixels" if pixels_fade else "texels"
        self._noise = _noise_texture(self.ctx, noise)
        self._rows = self.ctx.buffer(reserve=INSTANCE.itemsize * 1024, dynamic=True)
        self._samples, self._pace = self.ctx.query(samples=True), Pace(self.ctx)
        self._ground = None if ground is None else _Ground(self.ctx, ground)

    @property
    def plants(self) -> list[InstancedPlant]:
        """Those that are there, in the order in which they came."""
        return list(self._plants.values())

    def add(
        self,
        plant: Plant,
        elements: Elements,
        *,
        mipmaps: bool = True,
        shared: Textures | None = None,
    ) -> int:
        """Upload one more; returns its index, which no other gets. mipmaps: none for what is
        supersampled. shared: as of PlantBuffers."""
        self._plants[self._added] = InstancedPlant(
            plant, elements, mipmaps=mipmaps, shared=shared, ctx=self.ctx
        )
        self._added += 1
        return self._added - 1

    def add_surfels(self, surfels: SurfelSet) -> int:
        """Upload a set of surfels; returns its index among sets, which no other gets."""
        self._surfels[self._sets] = SurfelSetBuffers(surfels, ctx=self.ctx)
        self._sets += 1
        return self._sets - 1

    def surfels(self, index: int) -> SurfelSetBuffers:
        """A set that was added."""
        return self._surfels[index]

    def remove_surfels(self, index: int) -> None:
        """Free a set."""
        self._surfels.pop(index).release()

    def remove(self, plant: int) -> None:
        """Free one of them; what it shares stays."""
        self._plants.pop(plant).release()

    def release(self) -> None:
        """Free everything on the GPU."""
        for plant in self._plants.values():
            plant.release()
        self._plants.clear()
        for surfels in self._surfels.values():
            surfels.release()
        self._surfels.clear()
        self._noise.release()
        self._rows.release()
        if self._ground is not None:
            self._ground.release()

    @property
    def texture_bytes(self) -> int:
        """Of all plants' textures, mips counted."""
        return sum(plant.buffers.texture_bytes for plant in self._plants.values())

    def draw(
        self,
        frame: Frame,
        shot: Shot,
        light: Light,
        view: View = "lit",
        *,
        wireframe: bool = False,
        ground: bool = True,
        footprint: float = 1.0,
    ) -> Drawn:
        """Draw into the framebuffer in use, which is cleared and has depth.

        shot: its target is the eye, relative to which the rows are. footprint: samples per pixel
        and axis.
        """
        self._rows = rewritten(self._rows, frame.rows)
        if view == "overdraw":
            self.ctx.enable_only(moderngl.BLEND)
            self.ctx.blend_func = moderngl.ONE, moderngl.ONE
        self.ctx.wireframe = wireframe
        with self._samples:
            draws, triangles = self._draw_plants(frame, shot, light, view)
            drawn = [
                self._surfels[one.surfels].draw(
                    one.rows, one.prefix, shot, light, view, footprint=footprint
                )
                for one in frame.points
            ]
            draws += sum(calls for calls, _ in drawn)
            if ground and self._ground is not None:  # last: most of it is hidden
                self.ctx.disable(moderngl.CULL_FACE)
                triangles += self._ground.draw(shot, light, view)
                draws += 1
        self.ctx.wireframe = False
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        return Drawn(draws, triangles, self._samples.samples, sum(sent for _, sent in drawn))

    def _draw_plants(self, frame: Frame, shot: Shot, light: Light, view: View) -> tuple[int, int]:
        self._noise.use(NOISE)
        matrix = tuple(shot.view_projection.T.ravel())
        draws = triangles = 0
        told: set[moderngl.Program] = set()
        for batch in frame.batches:
            plant = self._plants[batch.plant]
            fading = self.fading if batch.fading else ""
            for group in plant.buffers.groups:
                shader = instance_program(plant.buffers, group, fading, ANISOTROPY, view)
                if shader not in told:
                    told.add(shader)
                    shader["view_projection"] = matrix
                    set_footprint(shader, 1.0)
                    set_light(shader, plant.buffers, light)
                    if "noise" in shader:
                        shader["noise"] = NOISE
                plant.buffers.use(group, shader)
                drawn = plant.draw(
                    group, shader, self._rows, batch.first, batch.count, batch.share, self._pace
                )
                draws += bool(drawn)
                triangles += drawn
        return draws, triangles


def picture(
    landscape: Landscape,
    frame: Frame,
    shot: Shot,
    light: Light,
    supersample: int = 1,
    samples: int = 0,
    *,
    ground: bool = True,
) -> Picture:
    """A frame as light and coverage, as `gl.draw.draw` gives them of one plant."""

    def render(part: Shot) -> None:
        landscape.draw(frame, part, light, ground=ground, footprint=supersample)

    return pictured(landscape.ctx, shot, render, supersample, samples)


class _Ground:
    """What plants stand on, in one colour."""

    def __init__(self, ctx: moderngl.Context, mesh: GroundMesh) -> None:
        self.ctx, self.origin, self.count = ctx, mesh.origin, len(mesh.faces)
        data = np.concatenate([mesh.positions, mesh.normals], axis=1).astype(np.float32)
        self._vertices = ctx.buffer(np.ascontiguousarray(data))
        self._indices = ctx.buffer(np.ascontiguousarray(mesh.faces, np.uint32))
        self._arrays: dict[tuple[str, ...], moderngl.VertexArray] = {}

    def draw(self, shot: Shot, light: Light, view: View) -> int:
        """Draw it; returns how many triangles it has."""
        array = self._array((f"OVERDRAW {OVERDRAW_STEP}",) if view == "overdraw" else ())
        place = np.eye(4)
        place[:3, 3] = self.origin - shot.target
        values = {
            "view_projection": tuple((shot.view_projection @ place).T.ravel()),
            "color": GROUND_COLOR,
            "sun_direction": tuple(light.unit),
            "sun": light.sun,
            "sky": (light.sky_above, light.sky_below),
        }
        for name, value in values.items():
            if name in array.program:  # the compiler drops what a variant does not read
                array.program[name] = value
        array.render()
        return self.count

    def release(self) -> None:
        for array in self._arrays.values():
            array.release()
        self._vertices.release()
        self._indices.release()

    def _array(self, defines: tuple[str, ...]) -> moderngl.VertexArray:
        if defines not in self._arrays:
            shader = program(self.ctx, "ground.vert", "ground.frag", *defines)
            names = [name for name in GROUND_VERTEX if name in shader]
            layout = " ".join("3f" if name in shader else "12x" for name in GROUND_VERTEX)
            content = [(self._vertices, layout, *names)]
            self._arrays[defines] = self.ctx.vertex_array(shader, content, self._indices)
        return self._arrays[defines]


def _noise_texture(ctx: moderngl.Context, noise: Sequence[ByteArray]) -> moderngl.Texture:
    height, width = noise[0].shape
    texture = ctx.texture((width, height), 1, np.ascontiguousarray(noise[0]), alignment=1)
    texture.build_mipmaps(0, len(noise) - 1)
    for level, smaller in enumerate(noise[1:], start=1):
        texture.write(np.ascontiguousarray(smaller), level=level, alignment=1)
    # no mean of two levels: its values are spread otherwise
    texture.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    return texture
