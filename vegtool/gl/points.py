"""Surfels drawn as oriented discs, a prefix of their order at each of many places.

Brandt et al.: Rendering of complex heterogenous scenes using progressive blue surfels (2019),
section 4.
"""

from __future__ import annotations

import moderngl
import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray
from vegtool.gl.context import OnGpu, context
from vegtool.gl.draw import Shot, set_sky
from vegtool.gl.instances import OVERDRAW_STEP, View
from vegtool.gl.pace import Pace
from vegtool.gl.program import program
from vegtool.gl.upload import rewritten
from vegtool.lighting.light import Light
from vegtool.surfel_set import SurfelSet

POINT_INSTANCE = np.dtype([("place", "f4", 4), ("turn_size", "f4", 4), ("tint", "u1", 4)])
"""place: metres from the eye to the points' center, and metres of a unit. turn_size: cosine and
sine of the turn about y, radius of the discs in that unit, factor of the width. tint: 0 to 255 for
linear factors of 0 to 2."""
AS_IT_IS = (127, 127, 127, 255)
"""A tint, nearly."""
GROUPS_PER_DOUBLING = 4
"""Of prefix lengths, drawn together: none is drawn longer than by a fifth."""
PER_SURFEL = (
    ("in_position", "3f", "f4", 3), ("in_normal", "3f", "f4", 3), ("in_color", "3f", "f4", 3),
    ("in_size", "1f", "f4", 1),
)  # fmt: skip
"""Attributes: name, format, and how that is stored: type and number."""
LIGHT = (("in_light", "4f1", "u1", 4),)
"""What surfels with light of their own have further; the last byte is 0."""
PER_INSTANCE = (("in_place", "4f", 0), ("in_turn_size", "4f", 16), ("in_tint", "4f1", 32))
"""Attributes: name, format and offset."""


class SurfelSetBuffers(OnGpu):
    """Surfels on the GPU, relative to their middle in units of their radius, both as they are
    bounded. A context manager: leaving releases."""

    def __init__(self, surfels: SurfelSet, *, ctx: moderngl.Context | None = None) -> None:
        self.surfels, self.ctx = surfels, ctx or context()
        low, high = surfels.bounds
        self.center = (low + high) / 2
        self.unit = float(np.linalg.norm(high - low) / 2) or 1.0
        local = (surfels.position - self.center) / self.unit
        columns = [local, surfels.normal, surfels.color, surfels.size[:, None]]
        if surfels.light is not None:
            columns.append(np.pad(np.rint(255 * surfels.light), ((0, 0), (0, 1))))
        self._attributes = PER_SURFEL + (() if surfels.light is None else LIGHT)
        rows = np.empty(len(surfels), [(name, kind, (n,)) for name, _, kind, n in self._attributes])
        for (name, *_), column in zip(self._attributes, columns, strict=True):
            rows[name] = column
        self._vertices = self.ctx.buffer(rows)
        self._rows = self.ctx.buffer(reserve=POINT_INSTANCE.itemsize, dynamic=True)
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        self._pace = Pace(self.ctx)

    def release(self) -> None:
        """Free everything on the GPU."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self._vertices.release()
        self._rows.release()

    def instances(
        self, eye: FloatArray, foot: FloatArray, turn: FloatArray, scale: FloatArray,
        radius: FloatArray, width: FloatArray | None = None, tint: ByteArray | None = None,
    ) -> np.ndarray:  # fmt: skip
        """(n,) POINT_INSTANCE: surfels at so many places, as an eye (3,) sees them.

        foot: (n, 3) metres, of their origin. turn: (n,) radians about y. scale: (n,). radius: (n,)
        metres of the discs of size 1, before scaling. width: (n,) factors of what is not height, or
        None for 1. tint: (n, 4) as of POINT_INSTANCE, or None for what changes nothing.
        """
        cosine, sine = np.cos(turn), np.sin(turn)
        wide = np.ones(len(foot)) if width is None else width
        x, y, z = self.center
        x, z = wide * x, wide * z
        middle = np.stack(
            [cosine * x + sine * z, np.full(len(foot), y), cosine * z - sine * x], axis=1
        )
        rows = np.empty(len(foot), POINT_INSTANCE)
        rows["place"][:, :3] = foot - eye + scale[:, None] * middle
        rows["place"][:, 3] = scale * self.unit
        rows["turn_size"] = np.stack([cosine, sine, radius / self.unit, wide], axis=1)
        rows["tint"] = AS_IT_IS if tint is None else tint
        return rows

    def pixels(
        self, eye: FloatArray, foot: FloatArray, turn: FloatArray, scale: FloatArray, focal: float
    ) -> FloatArray:
        """(n,) metres, before scaling, of a pixel at what is nearest to an eye of the bounds of
        the surfels at each of n places; section 4.1. focal: pixels of a metre at a distance of
        one."""
        x, y, z = ((eye - foot) / scale[:, None]).T
        cosine, sine = np.cos(turn), np.sin(turn)
        own = np.stack([cosine * x - sine * z, y, cosine * z + sine * x], axis=1)
        low, high = self.surfels.bounds
        away = np.linalg.norm(own - np.clip(own, low, high), axis=1)
        return np.asarray(away / focal)

    def draw(
        self, rows: np.ndarray, prefix: IntArray, shot: Shot, light: Light, view: View = "lit",
        footprint: float = 1.0,
    ) -> tuple[int, int]:  # fmt: skip
        """Draw the first `prefix` (n,) surfels at each of n places into the framebuffer in use,
        which has depth; returns draw calls, and how many surfels in all.

        shot: its target is the eye. footprint: samples per pixel and axis. Places whose prefixes
        are alike (GROUPS_PER_DOUBLING) are one call, and have as many as the longest.
        """
        defines = {
            "UNLIT": self.surfels.unlit, "DOUBLE_SIDED": self.surfels.double_sided,
            "LIGHT": self.surfels.light is not None,
            "PAINTED": view == "painted",
            "SOFT_EDGES": self.ctx.fbo.samples > 0,
            f"OVERDRAW {OVERDRAW_STEP}": view == "overdraw",
        }  # fmt: skip
        told = [name for name, wanted in defines.items() if wanted]
        shader = program(self.ctx, "point.vert", "point.frag", *told)
        matrix = shot.view_projection
        shader["view_projection"] = tuple(matrix.T.ravel())
        size = footprint * shot.width, footprint * shot.height
        across = matrix[:2, :3] - np.outer(matrix[:2, :3] @ matrix[3, :3], matrix[3, :3])
        pixel = across * (2 / np.array(size) / (across**2).sum(axis=1))[:, None]
        for name, value in (
            ("right", tuple(pixel[0])),
            ("up", tuple(pixel[1])),
            ("size", size),
            ("transmission_tint", tuple(self.surfels.transmission_tint)),
        ):
            if name in shader:
                shader[name] = value
        set_sky(shader, light)
        order = np.argsort(-prefix, kind="stable")
        order = order[prefix[order] > 0]
        count = np.minimum(prefix[order], len(self.surfels.position))
        self._rows = rewritten(self._rows, rows[order])
        self.ctx.enable(moderngl.PROGRAM_POINT_SIZE)
        starts = np.flatnonzero(
            np.diff(np.ceil(GROUPS_PER_DOUBLING * np.log2(count)), prepend=np.inf)
        )
        calls = sent = 0
        for first, end in zip(starts, np.append(starts[1:], len(count)), strict=False):
            most = int(count[first])
            at_once = max(self._pace.most // most, 1)
            for row in range(int(first), int(end), at_once):
                part = min(at_once, int(end) - row)
                array = self._array(shader, row)
                array.render(moderngl.POINTS, vertices=most, instances=part)
                self._pace.sent(most * part)
                calls += 1
                sent += most * part
        self.ctx.disable(moderngl.PROGRAM_POINT_SIZE)
        return calls, sent

    def _array(self, shader: moderngl.Program, first: int) -> moderngl.VertexArray:
        if shader not in self._arrays:
            layout, names = [], []
            for name, form, kind, count in self._attributes:
                unused = f"{count * np.dtype(kind).itemsize}x"
                layout.append(form if name in shader else unused)
                names += [name] if name in shader else []
            content = [(self._vertices, " ".join(layout), *names)]
            self._arrays[shader] = self.ctx.vertex_array(shader, content)
        array, start = self._arrays[shader], first * POINT_INSTANCE.itemsize
        for name, form, offset in PER_INSTANCE:
            if name in shader:
                location = shader[name].location  # type: ignore[union-attr]
                array.bind(
                    location, "f", self._rows, form, offset=start + offset,
                    stride=POINT_INSTANCE.itemsize, divisor=1,
                )  # fmt: skip
        return array
