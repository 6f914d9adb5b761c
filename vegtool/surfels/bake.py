"""Textures of surfel billboards: colour, normal and signed depth of the coarsest triangles.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
3.3. Each billboard has a picture of its front, and one of its back where that shows something else;
where nothing is seen from behind, the wrong side is dropped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import IntArray, checked
from vegtool.baking.bake import dilated
from vegtool.baking.pack import Packing, pack
from vegtool.baking.sides import compare_sides, pictures_of
from vegtool.gl.pictures import draw_pictures
from vegtool.gl.surfel_data import TEXEL_BYTES
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Atlas, Billboards
from vegtool.surfels.hierarchy import SurfelHierarchy
from vegtool.surfels.margin import billboards_of, going_on
from vegtool.surfels.texture_size import texture_sizes

GUTTER = 1
"""Texels around each picture: what a client filters beyond its edge. No mip is used far enough."""
SAMPLES = 4
"""Per axis and texel."""


@dataclass(frozen=True, eq=False)
class SurfelAtlas:
    """The textures of b billboards. atlas: as of a level of these, with both sides of each.
    behind: (b,) bool, whether anything is seen from behind; what is not is dropped there."""

    atlas: Atlas
    behind: np.ndarray

    def __post_init__(self) -> None:
        rects = np.concatenate([self.atlas.front, self.atlas.back]).astype(np.int64)
        height, width = self.atlas.color.shape[:2]
        beyond = rects[:, :2] + rects[:, 2:] > (width, height)
        if (rects < (0, 0, 1, 1)).any() or beyond.any():
            raise ValueError("SurfelAtlas: rectangles must lie in the atlas")
        behind = checked("SurfelAtlas.behind", self.behind, (len(self.atlas.front),), np.bool_)
        object.__setattr__(self, "behind", behind)


@dataclass(frozen=True, eq=False)
class Planned:
    """What is to be drawn of b billboards, and where it will lie. planes: b. face, shown_by: (m,)
    int32 faces, and which billboard shows each. behind: (b,) bool, whether anything is seen from
    behind. own: (k,) int32 those whose back has a picture of its own. packing: of all fronts, then
    these."""

    planes: Billboards
    face: IntArray
    shown_by: IntArray
    behind: np.ndarray
    own: IntArray
    packing: Packing

    @property
    def texture_bytes(self) -> int:
        """On the GPU, not compressed."""
        return TEXEL_BYTES * self.packing.width * self.packing.height


def planned(buffers: PlantBuffers, first: IntArray, one: SurfelHierarchy, max_side: int) -> Planned:
    """The pictures of a hierarchy, as large as eq. 9 has them.

    buffers: the coarsest triangles, patch by patch. first: (p,) the first of each patch. max_side:
    texels of the atlas; one that is higher is for the caller to refuse. Raises CapabilityError
    where OpenGL cannot hold the pictures.
    """
    patch, over = one.pairs()
    count = np.diff(np.append(first, len(buffers.plant.faces)))[patch]
    start = np.repeat(np.asarray(first)[patch] - np.cumsum(count) + count, count)
    face = (start + np.arange(int(count.sum()))).astype(np.int32)
    shown_by = np.repeat(over, count).astype(np.int32)
    planes = billboards_of(one)
    more, over = going_on(buffers.plant, face, shown_by, planes, planes.half_depth)
    face, shown_by = np.concatenate([face, more]), np.concatenate([shown_by, over])
    sides = compare_sides(buffers, planes, face, shown_by)
    behind = sides.back > 0
    own = np.flatnonzero(behind & sides.differ).astype(np.int32)
    sizes = texture_sizes(one)
    packing = pack(np.concatenate([sizes, sizes[own]]), GUTTER, max_side)
    return Planned(planes, face, shown_by, behind, own, packing)


def baked(buffers: PlantBuffers, plan: Planned) -> SurfelAtlas:
    """The textures that are planned. Raises CapabilityError where OpenGL cannot hold them."""
    planes, own, packing = plan.planes, plan.own, plan.packing
    count = len(planes)
    which = np.concatenate([np.arange(count), own])
    side = np.where(np.arange(len(which)) < count, 1, -1)
    number = np.full(count, -1, dtype=np.int32)
    number[own] = count + np.arange(len(own), dtype=np.int32)
    back = number[plan.shown_by] >= 0
    drawn = draw_pictures(
        buffers,
        pictures_of(planes, which, side, packing.rect),
        np.concatenate([plan.face, plan.face[back]]),
        np.concatenate([plan.shown_by, number[plan.shown_by[back]]]),
        (packing.width, packing.height),
        SAMPLES,
    )
    color, normal, _ = dilated(drawn, packing, False)
    front = packing.rect[:count]
    both = front.copy()
    both[own] = packing.rect[count:]
    return SurfelAtlas(Atlas(color, normal, drawn.depth, front, both), plan.behind)
