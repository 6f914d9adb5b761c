"""Textures of surfel billboards: colour, normal and signed depth of the coarsest triangles.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
3.3. Each billboard has a picture of its front, and one of its back where that shows something else;
where nothing is seen from behind, the wrong side is dropped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import IntArray
from vegtool.baking.bake import dilated
from vegtool.baking.pack import pack
from vegtool.baking.sides import compare_sides, pictures_of
from vegtool.gl.pictures import draw_pictures
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Atlas, Billboards
from vegtool.surfels.hierarchy import SurfelHierarchy

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


def billboards_of(one: SurfelHierarchy) -> Billboards:
    """The billboards as a level has them: o1 to the right, o2 up."""
    boxes = one.boxes
    number = np.arange(len(one), dtype=np.int32)
    return Billboards(
        boxes.center,
        boxes.axes[:, 0],
        boxes.axes[:, 1],
        boxes.half[:, :2],
        boxes.half[:, 2],
        number,
    )


def baked(
    buffers: PlantBuffers, first: IntArray, one: SurfelHierarchy, sizes: IntArray, max_side: int
) -> SurfelAtlas:
    """Textures of a hierarchy.

    buffers: the coarsest triangles, patch by patch. first: (p,) the first of each patch. sizes:
    (b, 2) int32 texels. Raises CapabilityError where OpenGL cannot hold the pictures.
    """
    patch, over = one.pairs()
    count = np.diff(np.append(first, len(buffers.plant.faces)))[patch]
    start = np.repeat(np.asarray(first)[patch] - np.cumsum(count) + count, count)
    face = (start + np.arange(int(count.sum()))).astype(np.int32)
    shown_by = np.repeat(over, count).astype(np.int32)
    planes = billboards_of(one)
    sides = compare_sides(buffers, planes, face, shown_by)
    behind = sides.back > 0
    own = np.flatnonzero(behind & sides.differ).astype(np.int32)
    packing = pack(np.concatenate([sizes, sizes[own]]), GUTTER, max_side)
    which = np.concatenate([np.arange(len(one)), own])
    side = np.where(np.arange(len(which)) < len(one), 1, -1)
    number = np.full(len(one), -1, dtype=np.int32)
    number[own] = len(one) + np.arange(len(own), dtype=np.int32)
    back = number[shown_by] >= 0
    drawn = draw_pictures(
        buffers,
        pictures_of(planes, which, side, packing.rect),
        np.concatenate([face, face[back]]),
        np.concatenate([shown_by, number[shown_by[back]]]),
        (packing.width, packing.height),
        SAMPLES,
    )
    color, normal, _ = dilated(drawn, packing, False)
    rect = packing.rect
    front = rect[: len(one)]
    both = front.copy()
    both[own] = rect[len(one) :]
    return SurfelAtlas(Atlas(color, normal, drawn.depth, front, both), behind)
