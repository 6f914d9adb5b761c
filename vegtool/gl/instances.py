"""A plant on the GPU that is drawn many times at once, each time with as many elements as it needs.

What differs from plant to plant is INSTANCE, a row of a buffer that is written anew for every
frame; all rows of one program and share are one call (more on software renderers: pace.py). OpenGL
3.3 has no first instance, so the buffer is bound with an offset before each.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

import moderngl
import numpy as np

from vegtool.arrays import FloatArray, IntArray, SingleArray
from vegtool.elements import Elements
from vegtool.gl.context import OnGpu
from vegtool.gl.pace import Pace
from vegtool.gl.program import program
from vegtool.gl.upload import MaterialGroup, PlantBuffers, Textures
from vegtool.plant import Plant
from vegtool.tangents import tangents

INSTANCE = np.dtype([("place", "f4", 4), ("turn", "f4", 4), ("shown", "f4", 3), ("tint", "u1", 4)])
"""place: metres from the eye to the foot, scale. turn: cosine and sine of the turn about y, share
of the elements that is kept (WHOLE: all), length of enlarged ones. shown: texels shown, see
reveal.glsl, a factor of the width, and the share of elements without texels that is shown. tint: 0
to 255 for linear factors of 0 to 2."""
GROWING = 0.3
"""Of the share of elements that is kept: those that are not whole yet."""
WHOLE = 1 / (1 - GROWING)
"""Share from which on all elements are whole."""
VERTEX = (
    ("in_position_u", 4), ("in_normal_v", 4), ("in_color", 4), ("in_middle_rank", 4),
    ("in_more", 4), ("in_tangent", 4),
)  # fmt: skip
"""Attributes of vertices and their floats."""
PER_INSTANCE = (
    ("in_place", "f", "4f", 0), ("in_turn", "f", "4f", 16), ("in_shown", "f", "3f", 32),
    ("in_tint", "f", "4f1", 44),
)  # fmt: skip
"""Attributes of INSTANCE: name, class, format and offset."""
NOISE = 6
"""Texture unit."""


class InstancedPlant(OnGpu):
    """A plant, or a level as the plant that a client loads, to be drawn many times.

    plant, elements: the same, in order. Positions are uploaded in metres from the plant's own
    origin, its foot. buffers: its textures and materials, with mips that keep
    coverage; without mipmaps for what is supersampled. shared: as of PlantBuffers.
    """

    def __init__(
        self,
        plant: Plant,
        elements: Elements,
        *,
        mipmaps: bool = True,
        shared: Textures | None = None,
        ctx: moderngl.Context | None = None,
    ) -> None:
        self.plant, self.elements = plant, elements
        self.buffers = PlantBuffers(
            plant, mipmaps=mipmaps, keep_coverage=mipmaps, shared=shared, ctx=ctx
        )
        self.ctx = self.buffers.ctx
        rows, faces = vertex_rows(plant, elements)
        self._vertices = self.ctx.buffer(rows.tobytes())
        self._indices = self.ctx.buffer(faces.astype(np.uint32).tobytes())
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        ends = np.searchsorted(elements.face_material, np.arange(len(plant.materials) + 1))
        self._ranges = [(int(a), int(b)) for a, b in pairwise(ends)]

    def release(self) -> None:
        """Free everything on the GPU."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self._vertices.release()
        self._indices.release()
        self.buffers.release()

    @property
    def buffer_bytes(self) -> int:
        """Of vertices and indices on the GPU."""
        return int(self._vertices.size + self._indices.size)

    def faces_kept(self, share: float) -> int:
        """How many faces are drawn of an instance that keeps a share of its elements."""
        return sum(self._kept(number, share) for number in range(len(self._ranges)))

    def draw(
        self, group: MaterialGroup, shader: moderngl.Program, rows: moderngl.Buffer,
        first: int, count: int, share: float, pace: Pace,
    ) -> int:  # fmt: skip
        """Draw the faces of one material of `count` instances from row `first` of a buffer of
        INSTANCE on, none of which keeps more than `share`; returns how many triangles that is."""
        kept = self._kept(group.number, share)
        if not kept or not count:
            return 0
        if group.material.double_sided:
            self.ctx.disable(moderngl.CULL_FACE)
        else:
            self.ctx.enable(moderngl.CULL_FACE)
        at_once = max(pace.most // kept, 1)
        begin, end = 3 * self._ranges[group.number][0], first + count
        for row in range(first, end, at_once):
            part = min(at_once, end - row)
            self._array(shader, rows, row).render(vertices=3 * kept, first=begin, instances=part)
            pace.sent(part * kept)
        return kept * count

    def _kept(self, number: int, share: float) -> int:
        first, end = self._ranges[number]
        return int(np.searchsorted(self.elements.face_rank[first:end], share))

    def _array(
        self, shader: moderngl.Program, rows: moderngl.Buffer, first: int
    ) -> moderngl.VertexArray:
        if shader not in self._arrays:
            layout = " ".join(f"{n}f" if name in shader else f"{4 * n}x" for name, n in VERTEX)
            names = [name for name, _ in VERTEX if name in shader]
            content = [(self._vertices, layout, *names)]
            self._arrays[shader] = self.ctx.vertex_array(shader, content, self._indices)
        array = self._arrays[shader]
        start = first * INSTANCE.itemsize
        for name, kind, form, offset in PER_INSTANCE:
            if name in shader:
                location = shader[name].location  # type: ignore[union-attr]
                array.bind(
                    location, kind, rows, form, offset=start + offset,
                    stride=INSTANCE.itemsize, divisor=1,
                )  # fmt: skip
        return array


def vertex_rows(plant: Plant, elements: Elements) -> tuple[SingleArray, IntArray]:
    """(v, 24) float32: VERTEX of the elements' vertices, and (f, 3) the faces of those: vertices on
    the seams of mirrored textures are two."""
    of, faces = elements.vertex, elements.faces
    split = np.arange(len(of), dtype=np.int32)
    frame: FloatArray = np.zeros((len(of), 4))
    if any(material.normal_texture is not None for material in plant.materials):
        frame, split, faces = tangents(plant.positions[of], plant.normals[of], plant.uvs[of], faces)
    of = of[split]
    rows = np.zeros((len(of), sum(n for _, n in VERTEX)), np.float32)
    rows[:, 0:3] = plant.positions[of]
    rows[:, 3], rows[:, 7] = plant.uvs[of].T
    rows[:, 4:7] = plant.normals[of]
    rows[:, 8:12] = 1.0 if plant.colors is None else plant.colors[of]
    rows[:, 12:15] = elements.middle[split]
    rows[:, 15] = elements.rank[split]
    rows[:, 16:18] = 1.0 if plant.exposure is None else plant.exposure[of]
    rows[:, 18] = elements.grows[split]
    rows[:, 19] = without_texels(plant)[of]
    rows[:, 20:24] = frame
    return rows, faces


View = Literal["lit", "painted", "overdraw"]
"""As it is; in the colours of the tints alone, lit; brighter the more often a pixel is drawn."""
OVERDRAW_STEP = 1 / 32
"""Of white, that a fragment adds."""


def without_texels(plant: Plant) -> np.ndarray:
    """(v,) bool: vertices of faces of which no texture shows more than one place, as the mesh of a
    hybrid level is: their texels cannot appear one by one."""
    mapped = np.zeros(len(plant.positions), bool)
    uv = plant.uvs[plant.faces]
    spread = (uv != uv[:, :1]).any(axis=(1, 2))
    textured = np.array([m.color_texture is not None for m in plant.materials])
    mapped[plant.faces[spread & textured[plant.face_material]]] = True
    return ~mapped


def instance_program(
    buffers: PlantBuffers, group: MaterialGroup, fading: str, anisotropy: int, view: View = "lit"
) -> moderngl.Program:
    """The program that draws one material of many plants. fading: "" for whole ones, "texels" or
    "pixels" for what reveals them."""
    material = group.material
    masked = material.alpha_mode == "mask"
    plain = material.color_texture is None and group.normal_map is None and group.light_map is None
    defines = {
        "VERTEX_LIT": plain,
        "MIPMAPPED": buffers.mipmaps and not plain,
        f"ANISOTROPY {anisotropy}.0": buffers.mipmaps and not plain,
        "NO_COLOR_MAP": material.color_texture is None,
        "UNLIT": material.unlit,
        "NORMAL_MAP": group.normal_map is not None and not material.unlit,
        "TANGENTS": group.normal_map is not None and not material.unlit,
        "LIGHT_MAP": group.light_map is not None and not material.unlit,
        "SOFT_EDGES": buffers.mipmaps and not plain and (masked or fading == "texels"),
        "REVEAL": bool(fading) and (fading == "pixels" or not plain),
        "DITHERED": fading == "pixels",
        "PAINTED": view == "painted",
        f"OVERDRAW {OVERDRAW_STEP}": view == "overdraw",
    }
    told = [name for name, wanted in defines.items() if wanted]
    told.append(f"GROWING {GROWING}")
    return program(buffers.ctx, "instance.vert", "instance.frag", *told)
