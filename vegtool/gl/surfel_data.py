"""What is uploaded of a model of surfel billboards over triangles, as plain arrays.

Lengths are in radii of the plant and relative to its center, as in PlantBuffers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray, SingleArray, checked
from vegtool.plant import Plant

BILLBOARD_FLOATS = 24
"""Of a billboard: center, side | half width along o1, half depth | half height along o2, level |
normal, step above | front: x0, y0, width, height in texels | back."""
ONE_SIDED, ALIKE, DIFFERENT = 0.0, 1.0, 2.0
"""Of a billboard, what is seen from behind: nothing, the front's picture, one of its own."""
TEXEL_BYTES = 8
"""Of a pair of RGBA8 textures, not compressed: colour and coverage, normal and depth."""


@dataclass(frozen=True, eq=False)
class SurfelItems:
    """n things that are drawn, or not: what may be drawn from farthest away comes first.

    below, above: (n,) int32 steps; it is drawn where the one below is taken and the one above is
    not. above is -1 for what nothing is above. until: (n,) float64, falling: distance of the whole,
    times epsilon / pc, from which on the one above is taken from everywhere; infinite where there
    is none. number: (n,) int32, which of the model's it is.
    """

    below: IntArray
    above: IntArray
    until: FloatArray
    number: IntArray

    def __post_init__(self) -> None:
        below = checked("SurfelItems.below", self.below, (None,), np.int32)
        for name in ("above", "number"):
            value = checked(f"SurfelItems.{name}", getattr(self, name), (len(below),), np.int32)
            object.__setattr__(self, name, value)
        until = np.asarray(self.until, np.float64).view()
        until.flags.writeable = False
        if until.shape != below.shape or not (until[1:] <= until[:-1]).all():
            raise ValueError("SurfelItems.until: must fall, one for each item")
        object.__setattr__(self, "below", below)
        object.__setattr__(self, "until", until)

    def __len__(self) -> int:
        return len(self.below)


@dataclass(frozen=True, eq=False)
class SurfelPatches:
    """Patches of triangles of one material. arcs: n of them. first: (n + 1,) int32 into faces,
    (t, 3) int32 vertices of the plant, patch by patch. material: index into the plant's."""

    material: int
    arcs: SurfelItems
    first: IntArray
    faces: IntArray

    def __post_init__(self) -> None:
        faces = checked("SurfelPatches.faces", self.faces, (None, 3), np.int32)
        first = checked("SurfelPatches.first", self.first, (len(self.arcs) + 1,), np.int32)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "first", first)


@dataclass(frozen=True, eq=False)
class SurfelData:
    """A model of b billboards and patches of triangles, and s steps from fine to coarse.

    plant: whose vertices, materials and textures the patches have.
    steps: (s, 8) float32: center and radius of a sphere; half depth along the normal (3,), 0 of
    what is no billboard; error, infinite of what is never taken. A step is taken by an eye from
    which its error, and its depth from the side, are at most epsilon pixels (surfel_steps.glsl). It
    is where one above it is, whatever is rounded: errors and spheres grow by more than that
    (surfels/drawn.py). The first b are the billboards, in the order of `billboards`.
    billboards: b of them. quads: (b, 24) float32, see BILLBOARD_FLOATS.
    color: (h, w, 4) uint8 sRGB and coverage. surface: (h, w, 4) uint8 normal and signed depth, 128
    being the plane: Atlas in eight bits each.
    patches: by material. center: (3,) and radius: a sphere round all spheres. reach: (2,) what no
    billboard is taken within: of distances from that center, times epsilon / pc, and beside it.
    """

    plant: Plant
    steps: SingleArray
    billboards: SurfelItems
    quads: SingleArray
    color: ByteArray
    surface: ByteArray
    patches: tuple[SurfelPatches, ...]
    center: FloatArray
    radius: float
    reach: tuple[float, float]

    def __post_init__(self) -> None:
        count = len(self.billboards)
        quads = checked("SurfelData.quads", self.quads, (count, BILLBOARD_FLOATS), np.float32)
        color = checked("SurfelData.color", self.color, (None, None, 4), np.uint8)
        shape = color.shape[:2]
        surface = checked("SurfelData.surface", self.surface, (*shape, 4), np.uint8)
        if self.steps.ndim != 2 or self.steps.shape[1] != 8 or self.steps.dtype != np.float32:
            raise ValueError("SurfelData.steps: expected (s, 8) float32")
        for name, value in (("quads", quads), ("color", color), ("surface", surface)):
            object.__setattr__(self, name, value)

    @property
    def atlas_bytes(self) -> int:
        """Of the billboards' textures."""
        return int(TEXEL_BYTES * self.color.shape[0] * self.color.shape[1])
